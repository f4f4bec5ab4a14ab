// Hatching: which lines are drawn at a tone, and in which ink. Included by ink.comp.glsl.

uniform sampler2D cells, ink_thresholds, disc_offsets, ink_table, paper_grain;
uniform sampler2DArray line_image;
uniform float layering, softness, onset_range, onset_lead;
uniform int line_count, sheet_count, layers, ink_count, is_light_ink, is_antialiased;
uniform int paper_grain_shift, paper_grain_channels, even_lines;
uniform vec2 crowded_pixels;
uniform vec4 paper_color;

// The number of lines that are closer to the guiding angle than this line, as `hatching._line_ranks`. `first`
// is the angle from the guiding angle to line 0.
float line_rank(int line, float first)
{
  float angle = first + TAU * float(line) / float(sheet_count);
  return atan(abs(sin(angle)), abs(cos(angle))) * 4.0 * float(line_count) / TAU;
}

// A rank with soft transitions between whole numbers, as `hatching._soft_rank`.
float soft_rank(float rank, int count)
{
  float position = 0.0;
  for (int layer = 1; layer < count; ++layer) {
    position += smooth_unit_step((rank - float(layer) + RANK_BLEND) / (2.0 * RANK_BLEND));
  }
  return position;
}

// How crowded evenly spaced lines are at a pixel, from 0 to 1, as `even_lines.EvenLines.crowding`.
float line_crowding(int line, ivec2 pixel)
{
  float period = texelFetch(line_image, ivec3(pixel, line), 0).y;
  float low = crowded_pixels.x, high = crowded_pixels.y;
  return 1.0 - smooth_unit_step((period - low) / (high - low));
}

// The darkness from which on a line is drawn, as `hatching._onset_darkness`. It is above 1 for a line that
// exceeds the number of layers.
float onset_darkness(int line, float first, ivec2 pixel)
{
  float rank = line_rank(line, first), onset = soft_rank(rank, layers) * layering;
  if (layers < line_count) {
    onset += 2.0 * smooth_unit_step((rank - float(layers) + RANK_BLEND) / (2.0 * RANK_BLEND));
  }
  if (even_lines != 0) {
    onset += line_crowding(line, pixel) * layering * float(line_count);
  }
  return onset;
}

// The weight, 0 to 1, of a line whose onset is later than the onset of the first line by `delay`.
float onset_weight(float delay, float transmittance)
{
  return smooth_unit_step((1.0 - transmittance - delay + onset_lead) / (onset_range + onset_lead));
}

// Interpolate between the inks of one table: dark or light.
vec3 table_ink(float ink, int first_texel)
{
  int low_index = min(int(ink), ink_count - 1);
  int high_index = min(low_index + 1, ink_count - 1);
  vec3 low = texelFetch(ink_table, ivec2(first_texel + low_index, 0), 0).xyz;
  vec3 high = texelFetch(ink_table, ivec2(first_texel + high_index, 0), 0).xyz;
  return mix(low, high, ink - float(low_index));
}

// An ink at a tone, as `inks.Inks.ink_at_tone`.
vec3 ink_of_tone(float ink, float tone)
{
  return mix(table_ink(ink, 0), table_ink(ink, ink_count), tone);
}

// Light inks on dark paper are computed as the negatives of dark inks on light paper.
vec3 complement_if_light(vec3 light)
{
  return is_light_ink != 0 ? 1.0 - light : light;
}

// The fraction of the paper's light, by color channel, that an ink lets through.
vec3 transmittance_of(vec3 ink)
{
  return complement_if_light(ink) / max(complement_if_light(paper_color.xyz), 1e-3);
}

// The coverage at which an ink leaves a given fraction of the paper's luminance.
float ink_coverage(float target, vec3 ink)
{
  float paper_luminance = dot(complement_if_light(paper_color.xyz), LUMINANCE_WEIGHTS);
  float ink_luminance = dot(complement_if_light(ink), LUMINANCE_WEIGHTS);
  float ink_transmittance = ink_luminance / max(paper_luminance, 1e-3);
  return clamp((1.0 - target) / max(1.0 - ink_transmittance, 1e-3), 0.0, 1.0);
}

// The height of the paper grain for a member. In the picture, each member has its own part of one
// texture; on the surface, one of the channels.
float grain_height(int member, ivec2 pixel)
{
  if (paper_grain_channels == 0) {
    ivec2 texel = pixel + ivec2(member * paper_grain_shift, 0);
    return texelFetch(paper_grain, texel, 0).x;
  }
  vec3 heights = texelFetch(paper_grain, pixel, 0).xyz - NOISE_MEAN;
  int channel = modulo(member, paper_grain_channels);
  return channel == 0 ? heights.x : channel == 1 ? heights.y : heights.z;
}

// The threshold of the noise above which ink is drawn, for a coverage: of streaks in row 0, of
// undirected texture in row 1.
float coverage_threshold(float coverage, int row)
{
  int last_texel = textureSize(ink_thresholds, 0).x - 1;
  float position = clamp(coverage, 0.0, 1.0) * float(last_texel);
  int low_index = min(int(position), last_texel - 1);
  float low = texelFetch(ink_thresholds, ivec2(low_index, row), 0).x;
  float high = texelFetch(ink_thresholds, ivec2(low_index + 1, row), 0).x;
  return mix(low, high, position - float(low_index));
}

// The fraction of a pixel that has ink: where a streak exceeds a threshold. The edges are soft, at least as
// soft as by the mean over a pixel, given the slope of the streak per pixel; as in `hatching`.
float ink_above_threshold(float streak, float threshold, float slope)
{
  float half_width = softness;
  if (is_antialiased != 0) {
    slope *= PIXEL_SOFTNESS;
    slope *= slope;
    threshold *= sqrt(1.0 + slope / 5.0);
    half_width = sqrt(half_width * half_width + slope);
  }
  return smooth_unit_step((streak - threshold) / (2.0 * half_width) + 0.5);
}

// The mean of the noise over a disc around a pixel, minus the mean of all noise, as in `undirected_texture`.
vec3 disc_mean(ivec2 pixel)
{
  ivec2 last = textureSize(cells, 0) - 1;
  vec3 sum = vec3(0.0);
  float count = 0.0;
  for (int index = 0; index < DISC_SAMPLE_COUNT; ++index) {
    ivec2 neighbor = pixel + ivec2(texelFetch(disc_offsets, ivec2(index, 0), 0).xy);
    vec4 cell = texelFetch(cells, clamp(neighbor, ivec2(0), last), 0);
    if (all(equal(neighbor, clamp(neighbor, ivec2(0), last))) && cell.x != 0.0) {
      sum += cell.yzw - NOISE_MEAN;
      count += 1.0;
    }
  }
  return sum / max(count, 1.0);
}
