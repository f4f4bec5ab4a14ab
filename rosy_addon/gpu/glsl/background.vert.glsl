// A rectangle at the far end of the view.

uniform vec2 low_corner, high_corner;
out vec2 background_position;

void main()
{
  gl_Position = vec4(mix(low_corner, high_corner, vertex_data.xy), 1.0, 1.0);
  background_position = vertex_data.xy;
}
