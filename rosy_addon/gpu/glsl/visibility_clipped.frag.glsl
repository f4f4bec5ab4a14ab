// Does the same as visibility.frag, but discards fragments that the clip planes cut away.

uniform int first_triangle_id;
in float triangle_id;
in vec4 clip_distances;
in vec2 more_clip_distances;
out vec4 visibility;

void main()
{
  if (any(lessThan(clip_distances, vec4(0.0))) || any(lessThan(more_clip_distances, vec2(0.0)))) {
    discard;
  }
  visibility = vec4(uintBitsToFloat(uint(first_triangle_id) + uint(triangle_id)), 0.0, 0.0, 1.0);
}
