// Hatching: the ink that each line through a pixel leaves on the paper, from its streaks or as evenly spaced
// lines, and the outline.

#include "magnitude.glsl"
#include "line_angle.glsl"
#include "line_family.glsl"
#include "line_member.glsl"
#include "pixel_tone.glsl"
#include "gray.glsl"
#include "mapped_color.glsl"
#include "inks.glsl"
#include "ink_even_lines.glsl"
#include "line_neighbor.glsl"

uniform sampler2D field_values, outline_coverage;
uniform sampler2DArray line_means;
uniform float breaks, outline, min_transmittance, streak_std, break_std, disc_std;
uniform float paper_grain_depth;
uniform int colors_magnitude, flow_mode, colors_values, break_steps, overshoot_steps, undefined_drawing;
uniform ivec2 box_origin;
uniform vec4 flow_weights;
layout(rgba32f) uniform writeonly image2D picture;
#pragma constant(flow_mode, colors_magnitude, colors_values, noise_channels, family_count)
#pragma constant(is_light_ink, is_antialiased, even_lines, ink_count)

// The derivatives, across a line to the left and per pixel, of its streaks (x) and its breaks (y), as
// `fast_lic`.
vec2 streak_slopes(ivec2 pixel, int line, float phase)
{
  ivec2 along = next_along(pixel, line), left = ivec2(-along.y, along.x);
  vec2 difference = texelFetch(line_means, neighbor_line(pixel, line, left, phase), 0).xy -
                    texelFetch(line_means, neighbor_line(pixel, line, -left, phase), 0).xy;
  return 0.5 * difference;
}

void main()
{
  ivec2 pixel = ivec2(gl_GlobalInvocationID.xy) + box_origin;
  if (any(greaterThanEqual(pixel, imageSize(picture)))) {
    return;
  }
  vec4 cell = texelFetch(cells, pixel, 0);
  if (cell.x == 0.0) {
    return;
  }
  vec4 value = texelFetch(field_values, pixel, 0);
  float line_angle = line_angle_of(pixel, value.xy);
  Families families = families_at(pixel);
  float pixel_tone = tone_at(pixel), value_position = texelFetch(tones, pixel, 0).w;
  vec3 one_ink = vec3(0.0), ink_light = vec3(1.0);
  // Where the surface has no value, the position in the color map is negative.
  if (colors_magnitude != 0) {
    one_ink = to_linear(mapped_color(magnitude_share(value.xy)));
  }
  else if (colors_values != 0 && value_position >= 0.0) {
    one_ink = to_linear(mapped_color(value_position));
  }
  else if (ink_count == 1) {
    one_ink = ink_of_tone(0.0, pixel_tone);
  }
  float first_onset = 10.0, paper = 1.0;
  for (int line = 0; line < line_count; ++line) {
    first_onset = min(first_onset, onset_darkness(line, line_angle, pixel));
  }
  bool is_undirected = value.xy == vec2(0.0);
  vec3 disc_noise = is_undirected ? disc_mean(pixel) : vec3(0.0);
  if (flow_mode != FLOW_NONE) {
    disc_noise = vec3(dot(disc_noise, flow_weights.xyz));
  }
  // The light that all inks together let through, and the sum of the weights of their lines.
  float target = 1.0, transmittance = 1.0, onset_sum = 1.0;
  for (int line = 0; line < line_count; ++line) {
    vec4 means = vec4(0.0);
    if (even_lines == 0 || break_steps > 0 || overshoot_steps > 0) {
      means = texelFetch(line_means, ivec3(pixel, line), 0);
    }
    if (line == 0 || overshoot_steps > 0) {
      float tone = overshoot_steps > 0 ? means.z : pixel_tone;
      transmittance = is_light_ink != 0 ? 1.0 - tone : tone;
      target = min_transmittance + transmittance * (1.0 - min_transmittance);
      if (ink_count == 1 && colors_magnitude == 0 && colors_values == 0) {
        transmittance = 1.0 - ink_coverage(target, one_ink);
      }
      onset_sum = 0.0;
      for (int other_line = 0; other_line < line_count; ++other_line) {
        float delay = onset_darkness(other_line, line_angle, pixel) - first_onset;
        onset_sum += onset_weight(delay, transmittance);
      }
    }
    float line_delay = onset_darkness(line, line_angle, pixel) - first_onset;
    float line_share = onset_weight(line_delay, transmittance) / onset_sum;
    if (is_undirected) {
      line_share = line == 0 ? 1.0 : 0.0;
    }
    float darkness = 1.0 - pow(transmittance, line_share);
    vec3 ink = one_ink;
    if (ink_count > 1) {
      float ink_index = soft_rank(line_rank(line, line_angle), line_count);
      if (family_count > 1) {
        int family = line_family(line, line_angle, families);
        ink_index = float(min(family, ink_count - 1));
      }
      ink = ink_of_tone(ink_index, pixel_tone);
      darkness = ink_coverage(pow(target, line_share), ink);
    }
    float streak = means.x / streak_std, break_streak = 0.0, break_weight = 0.0;
    vec2 slopes = vec2(0.0);
    if (is_antialiased != 0 && even_lines == 0 && !is_undirected) {
      slopes = streak_slopes(pixel, line, cell.x) / vec2(streak_std, break_std);
    }
    if (break_steps > 0) {
      break_streak = means.y / break_std;
      // As `hatching`: breaks are fewer where the ink is dense.
      float min_breaks = WOBBLE_BREAKS * wobble_strength;
      break_weight = min_breaks + (1.0 - min_breaks) * breaks * (1.0 - darkness) * (1.0 - darkness);
    }
    float grain_offset =
        paper_grain_depth > 0.0 ? paper_grain_depth * grain_height(line_member(line), pixel) : 0.0;
    float coverage;
    if (even_lines != 0 && !is_undirected) {
      break_weight = min(break_weight, MAX_BREAK_AMOUNT);
      float width = darkness;
      if (break_steps > 0 || paper_grain_depth > 0.0) {
        float variation = break_weight * break_streak + grain_offset;
        width = uneven_line_width(darkness, variation, break_weight);
      }
      coverage = even_line_coverage(line, pixel, width);
    }
    else {
      if (break_steps > 0) {
        streak = mix(streak, break_streak, break_weight);
        slopes.x = mix(slopes.x, slopes.y, break_weight);
      }
      if (is_undirected) {
        streak = gray(disc_noise) / disc_std - (undefined_drawing == UNDEFINED_TEXTURE ? 0.0 : NO_INK);
      }
      float threshold = coverage_threshold(darkness, int(is_undirected));
      coverage = ink_above_threshold(streak + grain_offset, threshold, slopes.x);
    }
    paper *= 1.0 - coverage;
    ink_light *= 1.0 - coverage * (1.0 - transmittance_of(ink));
  }
  if (outline > 0.0) {
    float coverage = texelFetch(outline_coverage, pixel, 0).x;
    vec3 ink = ink_count > 1 ? ink_of_tone(0.0, pixel_tone) : one_ink;
    ink_light *= 1.0 - coverage * (1.0 - transmittance_of(ink));
    paper *= 1.0 - coverage;
  }
  vec3 drawn_color = one_ink;
  if (ink_count > 1) {
    vec3 seen_color = complement_if_light(complement_if_light(paper_color.xyz) * ink_light);
    // The visible color is a mix of paper and ink. Solve for the ink.
    drawn_color = paper_color.xyz + (seen_color - paper_color.xyz) / max(1.0 - paper, MIN_COVERAGE);
    drawn_color = clamp(drawn_color, 0.0, 1.0);
  }
  float opacity = 1.0 - paper * (1.0 - paper_color.w);
  if (is_undirected && undefined_drawing == UNDEFINED_HIDDEN) {
    opacity = 0.0;
  }
  float paper_share = paper * paper_color.w / max(opacity, MIN_COVERAGE);
  imageStore(picture, pixel, vec4(mix(drawn_color, paper_color.xyz, paper_share), opacity));
}
