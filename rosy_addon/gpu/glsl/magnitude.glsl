uniform sampler2D max_magnitude;
uniform float magnitude_range;

// The magnitude of a representation relative to the largest one or to the range of the look, at most 1.
float magnitude_share(vec2 z)
{
  float max_value =
      magnitude_range > 0.0 ? magnitude_range : texelFetch(max_magnitude, ivec2(0), 0).x;
  return min(length(z) / (max_value > 0.0 ? max_value : 1.0), 1.0);
}
