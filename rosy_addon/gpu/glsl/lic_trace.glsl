// Streamlines on the covering and their filtered noise. Included by lic.comp.glsl.

// Sums over the samples of a streamline: of the weighted noise, of the weights and of their squares.
struct Sums {
  vec3 weighted_sum;
  float weight;
  float square_sum;
};

// Sums over half a streamline: `all` over all its steps, `near` over its first steps with weights of
// their own. `tones` is the sum of the tones along the overshoot, and their number.
struct Half {
  Sums all;
  Sums near;
  vec2 tones;
};

void add(inout Sums sums, vec3 noise_value, float weight)
{
  sums.weighted_sum += weight * noise_value;
  sums.weight += weight;
  sums.square_sum += weight * weight;
}

Sums empty_sums()
{
  Sums sums;
  sums.weighted_sum = vec3(0.0);
  sums.weight = sums.square_sum = 0.0;
  return sums;
}

Sums both_halves(vec3 start, Sums forward, Sums backward)
{
  Sums sums = forward;
  sums.weighted_sum += backward.weighted_sum + start;
  sums.weight += backward.weight + 1.0;
  sums.square_sum += backward.square_sum + 1.0;
  return sums;
}

// The number of samples of equal weight whose mean has the same variance (`filter_kernel`).
float effective_samples(Sums sums)
{
  return sums.weight * sums.weight / sums.square_sum;
}

// The target tone of a pixel.
float tone_at(ivec2 pixel)
{
  vec3 light = texelFetch(tones, pixel, 0).xyz;
  return clamp((light.x + light.y + light.z) / 3.0, 0.0, 1.0);
}

// How much the weights of the samples of half a streamline fall over its length (`filter_kernel`).
// `along` is 1 along the directions of a field without opposites, and -1 against them.
float weight_slope(float along)
{
  return kernel == KERNEL_TAPER ? 1.0 : kernel == KERNEL_RAMP ? along : 0.0;
}

// Trace half a streamline from a pixel on a sheet. Its state is a pixel and a sheet of the covering;
// each step is second-order Adams-Bashforth. The sums do not contain the start. `slope` is that of the
// weights.
Half traced_half(ivec2 pixel, int sheet, float direction_sign, vec4 cell, int step_count,
                 int near_step_count, int overshoot_count, float slope)
{
  Half result;
  result.all = result.near = empty_sums();
  result.tones = vec2(0.0);
  float weight_step = slope / float(step_count + 1);
  float near_weight_step = slope / float(near_step_count + 1);
  vec2 offset = vec2(0.0), previous_velocity = vec2(0.0);
  for (int step_index = 0; step_index < max(step_count, overshoot_count); ++step_index) {
    bool opposite = sheet >= line_count;
    int line = opposite ? sheet - line_count : sheet;
    // The direction at the center of the pixel, and the gradient of its angle.
    vec4 sample_ = texelFetch(angle_gradients, ivec3(pixel, line), 0);
    vec2 velocity = sample_.xy + dot(sample_.zw, offset) * vec2(-sample_.y, sample_.x);
    velocity *= opposite ? -direction_sign : direction_sign;
    offset += step_length * (step_index == 0 ? velocity : 1.5 * velocity - 0.5 * previous_velocity);
    previous_velocity = velocity;
    // At most to an adjacent pixel, however sharply the direction turns.
    vec2 pixel_step = clamp(round(offset), -1.0, 1.0);
    offset -= pixel_step;
    ivec2 pixel_move = ivec2(pixel_step);
    int bit = pixel_move.x + 3 * pixel_move.y + 4;
    if (((neighbor_mask(cell.x) >> bit) & 1) == 0) {
      break;
    }
    if (bit != 4) {
      pixel += pixel_move;
      float phase = cell.x;
      cell = texelFetch(cells, pixel, 0);
      // k' = k + round((t(p) - t(q)) S / 2 pi) mod S
      sheet = wrap_once(sheet + int(round(phase - cell.x)), sheet_count);
    }
    float distance_steps = float(step_index + 1);
    if (step_index < step_count) {
      add(result.all, cell.yzw, 1.0 - distance_steps * weight_step);
    }
    if (step_index < overshoot_count) {
      result.tones += vec2(tone_at(pixel), 1.0);
    }
    if (step_index < near_step_count) {
      add(result.near, cell.yzw, 1.0 - distance_steps * near_weight_step);
    }
  }
  return result;
}

// The mean of the noise along a streamline, around 0. Streamlines that end early are scaled to the
// standard deviation of full ones (`contrast`).
vec3 normalized_mean(Sums sums, float full_count)
{
  float sample_count = effective_samples(sums);
  float cell_count = sample_count * step_length / grain;
  return (sums.weighted_sum / sums.weight - NOISE_MEAN) * sqrt(sample_count / full_count) *
         min(0.5 * cell_count, 1.0);
}
