// Streaks that are carried along the covering, as `ibfv`: the sums of all states are in `line_image`.
// Included by
// lic.comp.glsl and streaks.comp.glsl.

// The mean of a line, and its effective samples.
struct Carried {
  vec3 mean;
  float samples;
};

// The sums of the two sheets of a line, and the share of the first. The weights are in the last components;
// the own noise has the weight OWN_WEIGHT in them.
struct SheetSums {
  vec4 one;
  vec4 other;
  float one_share;
};

vec4 sums_of_sheet(ivec2 pixel, int sheet, vec3 source)
{
  return texelFetch(line_image, ivec3(pixel, sheet), 0) - (1.0 - OWN_WEIGHT) * vec4(source, 1.0);
}

// The sums of a line. `forward_share` is that of what drifts forward, which comes along the opposite sheet.
// Lines that point one way have one sheet.
SheetSums sums_of_line(ivec2 pixel, int line, float forward_share, vec3 source)
{
  SheetSums result;
  if (degree == line_count) {
    // Every other sheet of a RoSy of odd degree is a direction.
    int sheet = sheet_count == degree ? line :
                                        ((line & 1) == 1 ? line + line_count : line) / 2;
    result.one = result.other = sums_of_sheet(pixel, sheet, source);
    result.one_share = 1.0;
    return result;
  }
  result.one = sums_of_sheet(pixel, line + line_count, source);
  result.other = sums_of_sheet(pixel, line, source);
  result.one_share = forward_share;
  return result;
}

// Those of the shorter streaks of breaks, which are in the second and third component.
SheetSums sums_of_breaks(SheetSums sums)
{
  sums.one = sums.one.yyyz;
  sums.other = sums.other.yyyz;
  return sums;
}

// The sum of the squares of weights, where their sum is `total`.
float square_sum(float total, float line_decay)
{
  float rest = 1.0 - (total - OWN_WEIGHT) * (1.0 - line_decay) / max(line_decay, 1e-6);
  rest = clamp(rest, 0.0, 1.0);
  float squares = line_decay * line_decay * (1.0 - rest * rest) / (1.0 - line_decay * line_decay);
  return OWN_WEIGHT * OWN_WEIGHT + squares;
}

// The blend of the two sheets of a line. Streamlines that end early are scaled to the standard deviation of
// full ones.
Carried carried_mean(SheetSums sums, float line_decay, float full_count)
{
  float one_share = sums.one_share, other_share = 1.0 - one_share;
  vec4 total = one_share * sums.one + other_share * sums.other;
  float squares = one_share * one_share * square_sum(sums.one.w, line_decay) +
                  other_share * other_share * square_sum(sums.other.w, line_decay) +
                  2.0 * one_share * other_share * OWN_WEIGHT * OWN_WEIGHT;
  Carried result;
  result.samples = total.w * total.w / squares;
  float cell_count = result.samples * step_length / grain;
  float scale = sqrt(result.samples / full_count) * min(0.5 * cell_count, 1.0);
  result.mean = total.xyz * (carried_contrast / total.w * scale);
  if (flow_mode != FLOW_NONE) {
    result.mean = vec3(result.mean.x + times(result.mean.yz, wave_phase).x);
  }
  return result;
}
