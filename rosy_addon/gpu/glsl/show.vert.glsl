// The surface again, a little nearer to the eye than it is, so that its own depth does not hide it.

void main()
{
  vec4 point = vec4(corner.xyz, 1.0);
  vec4 at = vec4(dot(clip_x, point), dot(clip_y, point), dot(clip_z, point), dot(clip_w, point));
  at.z -= nearer * at.w;
  gl_Position = at;
  beyond = vec4(dot(plane0, point), dot(plane1, point), dot(plane2, point), dot(plane3, point));
  beyond_too = vec2(dot(plane4, point), dot(plane5, point));
}
