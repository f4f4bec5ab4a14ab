// Vertices to the clip space of a light, with their depth along its axis.

uniform vec4 clip_x, clip_y, clip_z, clip_w, depth_row;
out float light_depth;

void main()
{
  vec4 point = vec4(vertex_data.xyz, 1.0);
  gl_Position = vec4(dot(clip_x, point), dot(clip_y, point), dot(clip_z, point), dot(clip_w, point));
  light_depth = dot(depth_row, point);
}
