// As seen.vert, and where the corners lie beside planes.

void main()
{
  vec4 point = vec4(corner.xyz, 1.0);
  gl_Position = vec4(dot(clip_x, point), dot(clip_y, point), dot(clip_z, point), dot(clip_w, point));
  triangle = corner.w;
  beyond = vec4(dot(plane0, point), dot(plane1, point), dot(plane2, point), dot(plane3, point));
  beyond_too = vec2(dot(plane4, point), dot(plane5, point));
}
