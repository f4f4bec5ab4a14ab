// As visibility.vert, with distances to the clip planes.

void main()
{
  vec4 point = vec4(vertex_data.xyz, 1.0);
  gl_Position = vec4(dot(clip_x, point), dot(clip_y, point), dot(clip_z, point), dot(clip_w, point));
  triangle_id = vertex_data.w;
  clip_distances = vec4(dot(plane0, point), dot(plane1, point), dot(plane2, point), dot(plane3, point));
  more_clip_distances = vec2(dot(plane4, point), dot(plane5, point));
}
