// One color behind everything in the 3D view.

uniform vec4 background_color;
out vec4 view_color;

void main()
{
  // Linear: Blender's frame buffer encodes the display color.
  view_color = vec4(background_color.xyz, 1.0);
}
