// Vertices to clip space. vertex_data.w is the id of the triangle.

uniform vec4 clip_x, clip_y, clip_z, clip_w;
out float triangle_id;

void main()
{
  vec4 point = vec4(vertex_data.xyz, 1.0);
  gl_Position = vec4(dot(clip_x, point), dot(clip_y, point), dot(clip_z, point), dot(clip_w, point));
  triangle_id = vertex_data.w;
}
