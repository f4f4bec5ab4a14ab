// The picture: line integral convolution along each line through a pixel, in both directions. The mean of
// the images of all lines gets the contrast of one of them. Then color and light are applied.

#include "magnitude.glsl"
#include "line_angle.glsl"
#include "pixel_tone.glsl"
#include "gray.glsl"
#include "lic_trace.glsl"
#include "lic_lines.glsl"
#include "line_family.glsl"
#include "mapped_color.glsl"

uniform sampler2D field_values, palette;
uniform float crossing_correlation, gain, hue_sharpness;
uniform int colors_magnitude, colors_values, undefined_drawing;
uniform ivec2 box_origin;
layout(rgba32f) uniform writeonly image2D picture;
#pragma constant(degree, line_count, sheet_count, kernel, flow_mode)
#pragma constant(colors_magnitude, magnitude_length, colors_values, noise_channels, is_antialiased)
#pragma constant(family_count, break_steps, overshoot_steps, even_lines)

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
  bool uses_magnitude = colors_magnitude != 0 || magnitude_length != 0;
  float relative_magnitude = uses_magnitude ? magnitude_share(value.xy) : 1.0;
  float line_angle = line_angle_of(pixel, value.xy);
  Families families = families_at(pixel);
  Reach reach = reach_at(relative_magnitude);
  vec3 lic_sum = vec3(0.0), hue_sum = vec3(0.0);
  float sample_sum = 0.0, hue_weight = 0.0;
  for (int line = 0; line < line_count; ++line) {
    FilteredLine filtered = filtered_line(pixel, line, cell, reach, line_angle);
    lic_sum += filtered.mean;
    sample_sum += filtered.samples;
    if (family_count > 1) {
      float weight = exp(hue_sharpness * gray(filtered.mean));
      int family = line_family(line, line_angle, families);
      family = modulo(family, textureSize(palette, 0).x);
      hue_sum += weight * texelFetch(palette, ivec2(family, 0), 0).xyz;
      hue_weight += weight;
    }
  }
  lic_sum /= float(line_count);
  sample_sum /= float(line_count);
  // Restore the contrast of one image in the mean of M images (equation 6, `contrast.blend_gain`).
  float shared_variance =
      clamp(crossing_correlation * full_samples / sample_sum, 0.0, float(line_count - 1));
  lic_sum *= gain * sqrt(float(line_count) / (1.0 + shared_variance));
  vec3 tone = noise_channels == 1 ? lic_sum.xxx : lic_sum;
  vec4 light_and_position = texelFetch(tones, pixel, 0);
  vec3 color = tone + NOISE_MEAN;
  // Where the surface has no value, the position in the color map is negative.
  if (colors_magnitude != 0) {
    color = mapped_color(relative_magnitude) * (1.0 + COLOR_CONTRAST * tone);
  }
  else if (colors_values != 0 && light_and_position.w >= 0.0) {
    color = mapped_color(light_and_position.w) * (1.0 + COLOR_CONTRAST * tone);
  }
  else if (family_count > 1) {
    color = hue_sum / hue_weight * (1.0 + COLOR_CONTRAST * tone);
  }
  bool is_plain = value.xy == vec2(0.0) && undefined_drawing != UNDEFINED_TEXTURE;
  color = is_plain ? vec3(NOISE_MEAN) : color;
  float alpha = is_plain && undefined_drawing == UNDEFINED_HIDDEN ? 0.0 : 1.0;
  imageStore(picture, pixel, vec4(to_linear(color) * light_and_position.xyz, alpha));
}
