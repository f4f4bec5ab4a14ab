// The noise that streaks are sums of (`ibfv`), around 0.

// The channels of the noise. Of streaks that drift, the constant part and the two of the wave. Of lines with
// breaks, the noise twice, for streaks of either length, and the weight of the shorter ones.
vec3 streak_source(vec3 noise_value)
{
  vec3 centered = noise_value - NOISE_MEAN;
  if (flow_mode == FLOW_NONE) {
    return break_steps > 0 ? vec3(centered.xx, 1.0) : centered;
  }
  // The channels are a third of a cycle apart.
  float real_part = (2.0 * centered.x - centered.y - centered.z) / 3.0;
  float imaginary_part = (centered.y - centered.z) * inversesqrt(3.0);
  return vec3((centered.x + centered.y + centered.z) / 3.0, real_part, imaginary_part);
}

// The same, raised above the four neighbors, which restores what interpolation blurs.
vec3 sharpened_source(ivec2 pixel, vec4 cell)
{
  vec3 own = streak_source(cell.yzw), result = own;
  for (int bit = 1; bit < 9; bit += 2) {
    if (((neighbor_mask(cell.x) >> bit) & 1) == 1) {
      ivec2 neighbor = pixel + ivec2(bit % 3 - 1, bit / 3 - 1);
      result += sharpening * (own - streak_source(texelFetch(cells, neighbor, 0).yzw));
    }
  }
  return result;
}
