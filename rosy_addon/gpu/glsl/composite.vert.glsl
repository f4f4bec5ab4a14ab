// The surface, moved a little towards the eye so that its own depth does not hide it.

uniform float depth_bias;
uniform vec4 clip_x, clip_y, clip_z, clip_w, plane_0, plane_1, plane_2, plane_3, plane_4, plane_5;
out vec4 clip_distances;
out vec2 more_clip_distances;

void main()
{
  vec4 point = vec4(vertex_data.xyz, 1.0);
  vec4 position = vec4(dot(clip_x, point), dot(clip_y, point), dot(clip_z, point), dot(clip_w, point));
  position.z -= depth_bias * position.w;
  gl_Position = position;
  clip_distances = vec4(dot(plane_0, point), dot(plane_1, point), dot(plane_2, point), dot(plane_3, point));
  more_clip_distances = vec2(dot(plane_4, point), dot(plane_5, point));
}
