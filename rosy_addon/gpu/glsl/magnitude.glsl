uniform sampler2D max_magnitude;
uniform vec2 magnitude_ends;

// The position of the magnitude of a representation between the ends of the range of the look, 0 to 1.
float magnitude_share(vec2 z)
{
  float low = magnitude_ends.x, high = magnitude_ends.y;
  if (low == high) {
    float largest = texelFetch(max_magnitude, ivec2(0), 0).x;
    high = largest > 0.0 ? largest : 1.0;
  }
  return (clamp(length(z), min(low, high), max(low, high)) - low) / (high - low);
}
