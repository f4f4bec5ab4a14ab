// Does the same as visibility.vert, and outputs the distances to the clip planes.

uniform vec4 clip_x, clip_y, clip_z, clip_w, plane_0, plane_1, plane_2, plane_3, plane_4, plane_5;
out float triangle_id;
out vec4 clip_distances;
out vec2 more_clip_distances;

void main()
{
  vec4 point = vec4(vertex_data.xyz, 1.0);
  gl_Position = vec4(dot(clip_x, point), dot(clip_y, point), dot(clip_z, point), dot(clip_w, point));
  triangle_id = vertex_data.w;
  clip_distances = vec4(dot(plane_0, point), dot(plane_1, point), dot(plane_2, point), dot(plane_3, point));
  more_clip_distances = vec2(dot(plane_4, point), dot(plane_5, point));
}
