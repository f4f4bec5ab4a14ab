// Streamlines on the covering and their filtered noise. Included by lic.comp.glsl
// and streaks.comp.glsl.

uniform sampler2D cells, tones;
uniform sampler2DArray angle_gradients, noise_gradients;
uniform float line_width;
uniform int line_count, sheet_count, flow_mode, kernel, noise_channels, is_antialiased;
uniform int break_steps;
uniform vec4 flow_weights;

// Sums over the samples of a streamline: of the weighted noise, of the weights and of their squares.
// For kernels that move, the noise has its mean subtracted, and uses all components. `full_square_sum` is
// the value of `square_sum` for a streamline that does not end early.
struct Sums {
  vec3 weighted_sum;
  float weight;
  float square_sum;
  float full_square_sum;
};

// A kernel that moves along a line: its steps in each direction, the distances in steps by which the streaks
// of the channels have drifted, and the fraction of the kernel that drifts forward.
struct Drift {
  int half_steps;
  vec3 shifts;
  float forward_share;
};

// Sums over half a streamline: `all` over all its steps, `near` over its first steps with other weights.
// `tones` is the sum of the tones along the overshoot, and the number of these tones.
struct Half {
  Sums all;
  Sums near;
  vec2 tones;
};

// The weights of samples at positions between steps, forward if positive, as `filter_kernel.sample_weights`
// with linear interpolation.
vec3 interpolated_weights(vec3 position, int half_steps)
{
  float width = float(half_steps + 1);
  if (kernel == KERNEL_TAPER) {
    return max(1.0 - abs(position) / width, 0.0);
  }
  if (kernel == KERNEL_RAMP) {
    vec3 rise = (2.0 - 1.0 / width) * max(position + width, 0.0);
    return min(max(1.0 - position / width, 0.0), rise);
  }
  return clamp(width - abs(position), 0.0, 1.0);
}

// The weights of the noise channels of a sample, as `flow.MovingKernel`.
vec3 drifting_weights(float position, Drift drift)
{
  if (flow_mode == FLOW_ALONG) {
    float along = drift.forward_share > 0.0 ? position : -position;
    return flow_weights.xyz * interpolated_weights(along + drift.shifts, drift.half_steps);
  }
  vec3 forward = interpolated_weights(position + drift.shifts, drift.half_steps);
  vec3 backward = interpolated_weights(drift.shifts - position, drift.half_steps);
  return flow_weights.xyz * mix(backward, forward, drift.forward_share);
}

// The number of steps on one side, forward (1) or backward (-1), beyond which all weights are 0.
int drifting_steps(Drift drift, float side)
{
  // Kernels whose streaks have drifted backward reach furthest forward, and vice versa.
  float against = drift.forward_share > 0.0 ? -side : side;
  vec3 reach = against * drift.shifts;
  if (flow_mode != FLOW_ALONG && drift.forward_share > 0.0 && drift.forward_share < 1.0) {
    reach = abs(reach);
  }
  return drift.half_steps + int(ceil(max(max(reach.x, reach.y), reach.z)));
}

void add_drifting(inout Sums sums, vec3 noise_value, vec3 weights)
{
  sums.weighted_sum += dot(weights, noise_value - NOISE_MEAN);
  sums.square_sum += dot(weights, weights);
  sums.full_square_sum += dot(weights, weights);
}

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
  sums.weight = sums.square_sum = sums.full_square_sum = 0.0;
  return sums;
}

Sums both_halves(vec3 start, Sums forward, Sums backward, Drift drift)
{
  Sums sums = forward;
  if (flow_mode != FLOW_NONE) {
    sums.weighted_sum += backward.weighted_sum;
    sums.square_sum += backward.square_sum;
    sums.full_square_sum += backward.full_square_sum;
    add_drifting(sums, start, drifting_weights(0.0, drift));
    return sums;
  }
  sums.weighted_sum += backward.weighted_sum + start;
  sums.weight += backward.weight + 1.0;
  sums.square_sum += backward.square_sum + 1.0;
  return sums;
}

// The effective number of samples of a streamline of full length, for a kernel at rest (`filter_kernel`).
float samples_at_rest(int half_steps)
{
  float width = float(half_steps + 1), count = 2.0 * width - 1.0;
  return kernel == KERNEL_TAPER ? 3.0 * width * width * width / (2.0 * width * width + 1.0) :
         kernel == KERNEL_RAMP  ? 3.0 * width * count / (4.0 * width - 1.0) :
                                  count;
}

// The number of samples of equal weight whose mean has the same variance (`filter_kernel`, and
// `flow.MovingKernel`).
float effective_samples(Sums sums, Drift drift)
{
  if (flow_mode != FLOW_NONE) {
    float samples = samples_at_rest(drift.half_steps) * sums.square_sum / sums.full_square_sum;
    return max(samples, MIN_EFFECTIVE_SAMPLES);
  }
  return sums.weight * sums.weight / sums.square_sum;
}

// The decrease of the weights of the samples over the length of half a streamline (`filter_kernel`).
// `along` is 1 along the directions of a field without opposites, and -1 against them.
float weight_slope(float along)
{
  return kernel == KERNEL_TAPER ? 1.0 : kernel == KERNEL_RAMP ? along : 0.0;
}

// The noise at a position relative to the center of a pixel.
vec3 noise_near(ivec2 pixel, vec4 cell, vec2 offset)
{
  if (is_antialiased == 0) {
    return cell.yzw;
  }
  vec4 gradient = texelFetch(noise_gradients, ivec3(pixel, 0), 0);
  vec3 change = vec3(dot(gradient.xy, offset), 0.0, 0.0);
  if (noise_channels > 1 || flow_mode != FLOW_NONE) {
    vec2 third = texelFetch(noise_gradients, ivec3(pixel, 1), 0).xy;
    change.yz = vec2(dot(gradient.zw, offset), dot(third, offset));
  }
  return cell.yzw + change;
}

// Trace half a streamline from a pixel on a sheet. Its state is a pixel and a sheet of the covering;
// each step is second-order Adams-Bashforth. The sums do not contain the start. `side` is 1 forward and
// -1 backward. `slope` is the decrease of the weights of a kernel at rest.
Half traced_half(ivec2 pixel, int sheet, float direction_sign, vec4 cell, float side, Drift drift,
                 Drift near_drift, int overshoot_count, float slope)
{
  Half result;
  result.all = result.near = empty_sums();
  result.tones = vec2(0.0);
  int step_count = drift.half_steps, near_step_count = near_drift.half_steps;
  float weight_step = slope / float(step_count + 1);
  float near_weight_step = slope / float(near_step_count + 1);
  if (flow_mode != FLOW_NONE) {
    step_count = drifting_steps(drift, side);
    near_step_count = break_steps > 0 ? drifting_steps(near_drift, side) : 0;
    step_count = max(step_count, near_step_count);
  }
  vec2 offset = vec2(0.0), previous_velocity = vec2(0.0);
  int step_index = 0;
  for (; step_index < max(step_count, overshoot_count); ++step_index) {
    bool opposite = sheet >= line_count;
    int line = opposite ? sheet - line_count : sheet;
    // The direction at the center of the pixel, and the gradient of its angle.
    vec4 sample_ = texelFetch(angle_gradients, ivec3(pixel, line), 0);
    vec2 velocity = sample_.xy + dot(sample_.zw, offset) * vec2(-sample_.y, sample_.x);
    velocity *= opposite ? -direction_sign : direction_sign;
    offset += step_index == 0 ? velocity : 1.5 * velocity - 0.5 * previous_velocity;
    previous_velocity = velocity;
    // A step goes at most to an adjacent pixel, however sharply the direction turns.
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
    vec3 noise_value = noise_near(pixel, cell, offset);
    if (flow_mode != FLOW_NONE) {
      if (step_index < step_count) {
        add_drifting(result.all, noise_value, drifting_weights(side * distance_steps, drift));
      }
      if (step_index < near_step_count) {
        add_drifting(result.near, noise_value, drifting_weights(side * distance_steps, near_drift));
      }
    }
    else if (step_index < step_count) {
      add(result.all, noise_value, 1.0 - distance_steps * weight_step);
    }
    if (step_index < overshoot_count) {
      result.tones += vec2(tone_at(pixel), 1.0);
    }
    if (flow_mode == FLOW_NONE && step_index < near_step_count) {
      add(result.near, noise_value, 1.0 - distance_steps * near_weight_step);
    }
  }
  if (flow_mode != FLOW_NONE) {
    // Add the weights of the samples that are missing because the streamline ended early.
    for (; step_index < step_count; ++step_index) {
      float position = side * float(step_index + 1);
      vec3 weights = drifting_weights(position, drift);
      result.all.full_square_sum += dot(weights, weights);
      if (step_index < near_step_count) {
        weights = drifting_weights(position, near_drift);
        result.near.full_square_sum += dot(weights, weights);
      }
    }
  }
  return result;
}

// The mean of the noise along a streamline, minus the mean of all noise. Streamlines that end early are
// scaled to the standard deviation of streamlines of full length (`contrast`).
vec3 normalized_mean(Sums sums, float full_count, Drift drift)
{
  float sample_count = effective_samples(sums, drift);
  float cell_count = sample_count / line_width;
  vec3 mean;
  if (flow_mode != FLOW_NONE) {
    float factor = sqrt(samples_at_rest(drift.half_steps) / sums.full_square_sum);
    mean = sums.weighted_sum * (factor / sample_count);
  }
  else {
    mean = sums.weighted_sum / sums.weight - NOISE_MEAN;
  }
  return mean * sqrt(sample_count / full_count) * min(0.5 * cell_count, 1.0);
}
