// Corners of triangles on their way to the frame. corner.w is the number of the triangle.

void main()
{
  vec4 point = vec4(corner.xyz, 1.0);
  gl_Position = vec4(dot(clip_x, point), dot(clip_y, point), dot(clip_z, point), dot(clip_w, point));
  triangle = corner.w;
}
