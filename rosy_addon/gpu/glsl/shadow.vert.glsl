// Corners of triangles on their way into a light's view, and how far away along its axis they are.

void main()
{
  vec4 point = vec4(corner.xyz, 1.0);
  gl_Position = vec4(dot(clip_x, point), dot(clip_y, point), dot(clip_z, point), dot(clip_w, point));
  away = dot(ahead, point);
}
