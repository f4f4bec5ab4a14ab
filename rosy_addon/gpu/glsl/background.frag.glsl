// One color behind everything in the 3D view.

void main()
{
  // Linear: Blender's frame buffer encodes the display color.
  view_color = vec4(background_color.xyz, 1.0);
}
