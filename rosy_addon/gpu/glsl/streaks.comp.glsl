// The streaks of hatching: means along each line through a pixel, of the noise, of the noise for breaks, and
// of the tone. There is one thread for each line.

#include "magnitude.glsl"
#include "line_angle.glsl"
#include "pixel_tone.glsl"
#include "gray.glsl"
#include "lic_trace.glsl"
#include "lic_lines.glsl"

uniform sampler2D field_values;
uniform ivec2 box_origin;
layout(rgba16f) uniform writeonly image2DArray line_means;
#pragma constant(degree, line_count, sheet_count, kernel, flow_mode)
#pragma constant(magnitude_length, noise_channels, is_antialiased, even_lines)

void main()
{
  ivec2 pixel = ivec2(gl_GlobalInvocationID.xy) + box_origin;
  int line = int(gl_GlobalInvocationID.z);
  if (any(greaterThanEqual(pixel, imageSize(line_means).xy))) {
    return;
  }
  vec4 cell = texelFetch(cells, pixel, 0);
  if (cell.x == 0.0) {
    return;
  }
  vec4 value = texelFetch(field_values, pixel, 0);
  float relative_magnitude = magnitude_length != 0 ? magnitude_share(value.xy) : 1.0;
  float line_angle = flow_mode == FLOW_TO_ANGLE ? line_angle_of(pixel, value.xy) : 0.0;
  FilteredLine filtered =
      filtered_line(pixel, line, cell, reach_at(relative_magnitude), line_angle);
  vec4 means = vec4(gray(filtered.mean), gray(filtered.break_mean), filtered.tone, 0.0);
  imageStore(line_means, ivec3(pixel, line), means);
}
