// Streaks that are carried along the covering, as `ibfv`: the sums of all states are in `line_image`.
// Included by lic.comp.glsl.

// The mean of a line, and its effective samples.
struct Carried {
  vec3 mean;
  float samples;
};

// The sums of a state, with the weights in the last component. The own noise has the weight OWN_WEIGHT in
// them.
vec4 sheet_sums(ivec2 pixel, int sheet, vec3 source)
{
  return texelFetch(line_image, ivec3(pixel, sheet), 0) - (1.0 - OWN_WEIGHT) * vec4(source, 1.0);
}

// The sum of the squares of the weights, where their sum is `total`.
float square_sum(float total)
{
  float rest = clamp(1.0 - (total - OWN_WEIGHT) * (1.0 - decay) / decay, 0.0, 1.0);
  return OWN_WEIGHT * OWN_WEIGHT + decay * decay * (1.0 - rest * rest) / (1.0 - decay * decay);
}

// Blend the two sheets of a line. `forward_share` is that of what drifts forward, which comes along the
// opposite sheet. Lines that point one way have one sheet. Streamlines that end early are scaled to the
// standard deviation of full ones.
Carried carried_mean(ivec2 pixel, int line, float forward_share, vec3 source)
{
  vec4 line_sums;
  float squares;
  if (degree == line_count) {
    // Every other sheet of a RoSy of odd degree is a direction.
    int sheet = sheet_count == degree ? line :
                                        ((line & 1) == 1 ? line + line_count : line) / 2;
    line_sums = sheet_sums(pixel, sheet, source);
    squares = square_sum(line_sums.w);
  }
  else {
    vec4 one = sheet_sums(pixel, line + line_count, source);
    vec4 other = sheet_sums(pixel, line, source);
    float rest_share = 1.0 - forward_share;
    line_sums = forward_share * one + rest_share * other;
    squares = forward_share * forward_share * square_sum(one.w) +
              rest_share * rest_share * square_sum(other.w) +
              2.0 * forward_share * rest_share * OWN_WEIGHT * OWN_WEIGHT;
  }
  Carried result;
  result.samples = line_sums.w * line_sums.w / squares;
  float cell_count = result.samples * step_length / grain;
  float scale = sqrt(result.samples / full_samples) * min(0.5 * cell_count, 1.0);
  result.mean = line_sums.xyz * (carried_contrast / line_sums.w * scale);
  if (flow_mode != FLOW_NONE) {
    result.mean = vec3(result.mean.x + times(result.mean.yz, wave_phase).x);
  }
  return result;
}
