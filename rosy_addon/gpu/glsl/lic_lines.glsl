// Noise that is filtered along the lines through a pixel. Included by lic.comp.glsl and streaks.comp.glsl.

uniform float full_samples, break_samples;
uniform int line_count, sheet_count, magnitude_length, flow_mode, half_length, break_steps;
uniform int overshoot_steps, even_lines;
uniform vec4 flow_shifts;

// How far the noise is filtered at a pixel: the numbers of steps in each direction, and the drift of streaks.
struct Reach {
  int overshoot_count;
  Drift drift;
  Drift break_drift;
};

// Means along a line: of the noise, of the noise for breaks of the line, and of the tone along the overshoot.
struct FilteredLine {
  vec3 mean;
  float samples;
  vec3 break_mean;
  float tone;
};

// The reach at a pixel. `relative_magnitude` is 1 if the magnitude does not change the length of streaks.
Reach reach_at(float relative_magnitude)
{
  Reach reach;
  int step_count = half_length, break_step_count = break_steps;
  reach.overshoot_count = overshoot_steps;
  if (magnitude_length != 0) {
    step_count = int(round(float(step_count) * relative_magnitude));
    break_step_count = int(round(float(break_step_count) * relative_magnitude));
    reach.overshoot_count = int(round(float(overshoot_steps) * relative_magnitude));
  }
  // Evenly spaced lines have no streaks, but they have breaks.
  step_count = even_lines != 0 ? break_steps : step_count;
  reach.drift.half_steps = step_count;
  reach.break_drift.half_steps = break_step_count;
  reach.drift.shifts = reach.break_drift.shifts = vec3(0.0);
  if (flow_mode != FLOW_NONE) {
    // Shifts are proportional to the number of steps, which is largest for the largest magnitude.
    int largest_count = max(even_lines != 0 ? break_steps : half_length, 1);
    reach.drift.shifts = flow_shifts.xyz * (float(step_count) / float(largest_count));
    reach.break_drift.shifts =
        flow_shifts.xyz * (float(break_step_count) / float(max(break_steps, 1)));
  }
  return reach;
}

// Filter the noise along a line. `line_angle` is the angle of line 0.
FilteredLine filtered_line(ivec2 pixel, int line, vec4 cell, Reach reach, float line_angle)
{
  bool has_opposite_sheet = sheet_count == 2 * line_count;
  int backward_sheet = has_opposite_sheet ? line + line_count : line;
  float backward_sign = has_opposite_sheet ? 1.0 : -1.0;
  // For odd N, every other sheet is the opposite half of a member.
  float along = has_opposite_sheet && (line & 1) == 1 ? -1.0 : 1.0;
  Drift drift = reach.drift, break_drift = reach.break_drift;
  drift.forward_share = 0.0;
  if (flow_mode == FLOW_ALONG) {
    drift.forward_share = along > 0.0 ? 1.0 : 0.0;
  }
  else if (flow_mode == FLOW_TO_ANGLE) {
    float cosine = cos(line_angle + TAU * float(line) / float(sheet_count));
    drift.forward_share = smooth_unit_step(0.5 + cosine * (0.5 / ONE_WAY_COSINE));
  }
  break_drift.forward_share = drift.forward_share;
  Half forward = traced_half(pixel, line, 1.0, cell, 1.0, drift, break_drift, reach.overshoot_count,
                             weight_slope(along));
  Half backward = traced_half(pixel, backward_sheet, backward_sign, cell, -1.0, drift, break_drift,
                              reach.overshoot_count, weight_slope(-along));
  FilteredLine result;
  result.break_mean = vec3(0.0);
  result.tone = 0.0;
  if (overshoot_steps > 0) {
    vec2 tone_sum = vec2(tone_at(pixel), 1.0) + forward.tones + backward.tones;
    result.tone = tone_sum.x / tone_sum.y;
  }
  Sums sums = both_halves(cell.yzw, forward.all, backward.all, drift);
  result.mean = normalized_mean(sums, full_samples, drift);
  result.samples = effective_samples(sums, drift);
  if (break_steps > 0) {
    Sums near_sums = both_halves(cell.yzw, forward.near, backward.near, break_drift);
    result.break_mean = normalized_mean(near_sums, break_samples, break_drift);
  }
  return result;
}
