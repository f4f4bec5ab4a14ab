// As seen.frag, but for what lies beyond planes.

void main()
{
  if (any(lessThan(beyond, vec4(0.0))) || any(lessThan(beyond_too, vec2(0.0)))) {
    discard;
  }
  seen = vec4(body + 1.0, triangle, 0.0, 1.0);
}
