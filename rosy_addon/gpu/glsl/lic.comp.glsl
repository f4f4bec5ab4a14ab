// The picture: line integral convolution along each line through a pixel, in both directions, or streaks
// that have been carried there. The mean of the images of all lines gets the contrast of one of them. Then color, ink and light are
// applied.

vec3 mapped_color(float value)
{
  int last_texel = textureSize(color_map, 0).x - 1;
  float position = clamp(value, 0.0, 1.0) * float(last_texel);
  int low_texel = min(int(position), last_texel - 1);
  vec3 low = texelFetch(color_map, ivec2(low_texel, 0), 0).xyz;
  vec3 high = texelFetch(color_map, ivec2(low_texel + 1, 0), 0).xyz;
  return mix(low, high, position - float(low_texel));
}

// The family of a line, as `family_hues`, from the angle of line 0 and the stored angle of the
// families. `known_families` is the number of families, or 1 at a pixel without families.
int line_family(int line, float first_angle, float family_angle, int known_families)
{
  // For odd N, every other line is the opposite half of a member.
  float opposite = (sheet_count > degree && (degree & line & 1) == 1) ? 0.5 * TAU : 0.0;
  float angle = first_angle + opposite + TAU * float(line) / float(sheet_count);
  float forward = (angle * float(degree) - family_angle * float(family_count)) / TAU;
  return modulo(int(round(forward)), known_families);
}

float gray(vec3 mean)
{
  return noise_channels == 1 ? mean.x : (mean.x + mean.y + mean.z) / 3.0;
}

void main()
{
  ivec2 pixel = ivec2(gl_GlobalInvocationID.xy) + box_origin;
  ivec2 frame = imageSize(picture);
  if (any(greaterThanEqual(pixel, frame))) {
    return;
  }
  vec4 cell = texelFetch(cells, pixel, 0);
  if (cell.x == 0.0) {
    return;
  }
  vec4 value = texelFetch(field_values, pixel, 0);
  float relative_magnitude = 1.0;
  if (magnitude_mode != 0) {
    relative_magnitude = magnitude_share(value.xy);
  }
  int step_count = (magnitude_mode & MAGNITUDE_LENGTH) != 0 ?
                       int(round(float(half_length) * relative_magnitude)) :
                       half_length;

  // Without wobble, the texture has another size.
  float wobble = wobble_strength > 0.0 ?
                     wobble_strength * texelFetch(wobble_angles, pixel, 0).x :
                     0.0;
  float frame_angle = float(degree) * (guiding_angle - wobble);
  vec2 z = times(value.xy, vec2(cos(frame_angle), -sin(frame_angle)));
  float first_angle = 0.0, family_angle = 0.0;
  int known_families = 1;
  if (family_count > 1) {
    first_angle = angle_of(z) / float(degree) + guiding_angle;
    vec2 family_value = texelFetch(field_channels, ivec3(pixel, family_channel), 0).xy;
    family_angle = angle_of(family_value);
    known_families = family_value == vec2(0.0) ? 1 : family_count;
  }
  vec4 light_and_position = texelFetch(tones, pixel, 0);
  vec3 light = light_and_position.xyz;
  float pixel_tone = tone_at(pixel);
  bool is_colored_by_magnitude = (magnitude_mode & MAGNITUDE_COLOR) != 0;
  // Without a number, the position in the color map is negative.
  bool is_mapped = is_colored_by_magnitude || (colors_values != 0 && light_and_position.w >= 0.0);
  float map_position = is_colored_by_magnitude ? relative_magnitude : light_and_position.w;
  float line_angle = angle_of(z) / float(degree), first_onset = 10.0, paper = 1.0;
  vec3 one_ink = vec3(0.0), ink_light = vec3(1.0);
  if (is_hatched != 0) {
    if (is_mapped) {
      one_ink = to_linear(mapped_color(map_position));
    }
    else if (ink_count == 1) {
      one_ink = ink_of_tone(0.0, pixel_tone);
    }
    for (int line = 0; line < line_count; ++line) {
      first_onset = min(first_onset, onset_darkness(line, line_angle, pixel));
    }
  }
  // Even lines have no streaks, but breaks.
  step_count = even_lines != 0 ? break_steps : step_count;
  int break_step_count = break_steps, overshoot_count = overshoot_steps;
  if ((magnitude_mode & MAGNITUDE_LENGTH) != 0) {
    break_step_count = int(round(float(break_step_count) * relative_magnitude));
    overshoot_count = int(round(float(overshoot_count) * relative_magnitude));
  }
  float line_decay = decay, line_break_decay = break_decay;
  if (is_carried != 0) {
    if ((magnitude_mode & MAGNITUDE_LENGTH) != 0) {
      line_decay = decay_of_steps(step_count);
      line_break_decay = decay_of_steps(break_step_count);
    }
    // Nothing is traced but overshoot.
    step_count = break_step_count = 0;
  }
  Drift drift, break_drift;
  drift.half_steps = step_count;
  break_drift.half_steps = break_step_count;
  if (flow_mode != FLOW_NONE) {
    // Relative to the steps of lines of the largest magnitude.
    int largest_count = max(even_lines != 0 ? break_steps : half_length, 1);
    drift.shifts = flow_shifts.xyz * (float(step_count) / float(largest_count));
    break_drift.shifts = flow_shifts.xyz * (float(break_step_count) / float(max(break_steps, 1)));
  }
  bool is_undirected = value.xy == vec2(0.0);
  vec3 disc_noise = is_hatched != 0 && is_undirected ? disc_mean(pixel) : vec3(0.0);
  if (flow_mode != FLOW_NONE) {
    disc_noise = vec3(dot(disc_noise, flow_weights.xyz));
  }
  vec3 source = is_carried != 0 ? sharpened_source(pixel, cell) : vec3(0.0);
  // The light that all inks together let through, and the sum of the weights of their lines.
  float target = 1.0, transmittance = 1.0, onset_sum = 1.0;
  vec3 lic_sum = vec3(0.0), hue_sum = vec3(0.0);
  float sample_sum = 0.0, hue_weight = 0.0;
  for (int line = 0; line < line_count; ++line) {
    bool has_opposite_sheet = sheet_count == 2 * line_count;
    int backward_sheet = has_opposite_sheet ? line + line_count : line;
    float backward_sign = has_opposite_sheet ? 1.0 : -1.0;
    // For odd N, every other sheet is the opposite half of a member.
    float along = has_opposite_sheet && (line & 1) == 1 ? -1.0 : 1.0;
    if (flow_mode == FLOW_ALONG) {
      drift.forward_share = along > 0.0 ? 1.0 : 0.0;
    }
    else if (flow_mode == FLOW_TO_ANGLE) {
      float cosine = cos(line_angle + TAU * float(line) / float(sheet_count));
      drift.forward_share = smooth_unit_step(0.5 + cosine * (0.5 / ONE_WAY_COSINE));
    }
    break_drift.forward_share = drift.forward_share;
    Half forward, backward;
    forward.tones = backward.tones = vec2(0.0);
    if (is_carried == 0 || overshoot_steps > 0) {
      forward = traced_half(pixel, line, 1.0, cell, 1.0, drift, break_drift, overshoot_count,
                            weight_slope(along));
      backward = traced_half(pixel, backward_sheet, backward_sign, cell, -1.0, drift, break_drift,
                             overshoot_count, weight_slope(-along));
    }
    SheetSums carried_sums;
    vec3 mean;
    float sample_count;
    if (is_carried != 0) {
      float forward_share = flow_mode == FLOW_NONE ? 0.5 : drift.forward_share;
      carried_sums = sums_of_line(pixel, line, forward_share, source);
      Carried carried = carried_mean(carried_sums, line_decay, full_samples);
      mean = carried.mean;
      sample_count = carried.samples;
    }
    else {
      Sums line_sums = both_halves(cell.yzw, forward.all, backward.all, drift);
      mean = normalized_mean(line_sums, full_samples, drift);
      sample_count = effective_samples(line_sums, drift);
    }
    if (is_hatched != 0) {
      if (line == 0 || overshoot_steps > 0) {
        vec2 tone_sum = vec2(pixel_tone, 1.0) + forward.tones + backward.tones;
        float mean_tone = tone_sum.x / tone_sum.y;
        transmittance = is_light_ink != 0 ? 1.0 - mean_tone : mean_tone;
        target = min_transmittance + transmittance * (1.0 - min_transmittance);
        if (ink_count == 1 && !is_colored_by_magnitude && colors_values == 0) {
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
          int family = line_family(line, first_angle, family_angle, known_families);
          ink_index = float(min(family, ink_count - 1));
        }
        ink = ink_of_tone(ink_index, pixel_tone);
        darkness = ink_coverage(pow(target, line_share), ink);
      }
      float streak = gray(mean) / streak_std, break_streak = 0.0, break_weight = 0.0;
      if (break_steps > 0) {
        vec3 break_mean;
        if (is_carried != 0) {
          SheetSums near_sums = sums_of_breaks(carried_sums);
          break_mean = carried_mean(near_sums, line_break_decay, break_samples).mean;
        }
        else {
          Sums near_sums = both_halves(cell.yzw, forward.near, backward.near, break_drift);
          break_mean = normalized_mean(near_sums, break_samples, break_drift);
        }
        break_streak = gray(break_mean) / break_std;
        // As `hatching`: breaks are fewer where the ink is dense.
        float min_breaks = WOBBLE_BREAKS * wobble_strength;
        break_weight =
            min_breaks + (1.0 - min_breaks) * breaks * (1.0 - darkness) * (1.0 - darkness);
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
        }
        if (is_undirected) {
          streak = gray(disc_noise) / disc_std;
        }
        float excess = streak + grain_offset - coverage_threshold(darkness, int(is_undirected));
        coverage = smooth_unit_step(excess / (2.0 * softness) + 0.5);
      }
      paper *= 1.0 - coverage;
      vec3 ink_transmittance = transmittance_of(ink);
      ink_light *= 1.0 - coverage * (1.0 - ink_transmittance);
    }
    lic_sum += mean;
    sample_sum += sample_count;
    if (family_count > 1) {
      float weight = exp(hue_sharpness * gray(mean));
      int family = line_family(line, first_angle, family_angle, known_families);
      family = modulo(family, textureSize(palette, 0).x);
      hue_sum += weight * texelFetch(palette, ivec2(family, 0), 0).xyz;
      hue_weight += weight;
    }
  }
  if (is_hatched != 0 && outline > 0.0) {
    float coverage = outline_coverage(pixel, value);
    vec3 ink = ink_count > 1 ? ink_of_tone(0.0, pixel_tone) : one_ink;
    vec3 ink_transmittance = transmittance_of(ink);
    ink_light *= 1.0 - coverage * (1.0 - ink_transmittance);
    paper *= 1.0 - coverage;
  }
  lic_sum /= float(line_count);
  sample_sum /= float(line_count);
  // Restore the contrast of one image in the mean of M images (equation 6, `contrast.blend_gain`).
  float shared_variance =
      clamp(crossing_correlation * full_samples / sample_sum, 0.0, float(line_count - 1));
  lic_sum *= gain * sqrt(float(line_count) / (1.0 + shared_variance));
  vec3 tone = noise_channels == 1 ? lic_sum.xxx : lic_sum;
  vec3 ink = tone + NOISE_MEAN;
  if (is_mapped) {
    ink = mapped_color(map_position) * (1.0 + COLOR_CONTRAST * tone);
  }
  else if (family_count > 1) {
    ink = hue_sum / hue_weight * (1.0 + COLOR_CONTRAST * tone);
  }
  vec4 color = vec4(to_linear(ink) * light, 1.0);
  if (is_hatched != 0) {
    vec3 drawn_color = one_ink;
    if (ink_count > 1) {
      vec3 seen_color = complement_if_light(complement_if_light(paper_color.xyz) * ink_light);
      // The visible color is a mix of paper and ink. Solve for the ink.
      drawn_color = paper_color.xyz + (seen_color - paper_color.xyz) / max(1.0 - paper, MIN_COVERAGE);
      drawn_color = clamp(drawn_color, 0.0, 1.0);
    }
    color = clear_paper != 0 ? vec4(drawn_color, 1.0 - paper) :
                                vec4(mix(drawn_color, paper_color.xyz, paper), 1.0);
  }
  imageStore(picture, pixel, color);
}
