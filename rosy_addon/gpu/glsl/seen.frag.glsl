// Which body a pixel sees, counted from 1, and which of its triangles.

void main()
{
  seen = vec4(body + 1.0, triangle, 0.0, 1.0);
}
