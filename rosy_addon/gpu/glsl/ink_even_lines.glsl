// Evenly spaced lines in place of streaks, as `even_lines`. Included by ink.comp.glsl.

uniform sampler2DArray line_image;
uniform float min_edge_width;
uniform int line_count;
uniform vec2 fade_pixels;

// The coverage of an interval of the length `edge` by lines with the distance 1, as
// `even_lines._box_filtered`.
float box_filtered(float position, float width, float edge)
{
  float half_width = 0.5 * width, low = position - 0.5 * edge, high = position + 0.5 * edge;
  float covered = max(min(high, half_width) - max(low, -half_width), 0.0);
  covered += max(high - (1.0 - half_width), 0.0) + max(half_width - 1.0 - low, 0.0);
  return covered / edge;
}

// The same function as `even_lines.EvenLines._relief`.
float even_line_relief(float streak, float period, float growth, float width)
{
  float position = 0.5 - 0.5 * streak;
  float edge = clamp(1.0 / max(period, 1e-6), min_edge_width, 1.0);
  float between = 0.5 * growth * width;
  float covered = box_filtered(position, width - between, edge);
  if (between > 0.0) {
    covered += box_filtered(0.5 - position, between, edge);
  }
  return smooth_unit_step((period - fade_pixels.x) / (fade_pixels.y - fade_pixels.x)) *
         (covered - width);
}

// The fraction of a pixel that a line covers, as `even_lines.EvenLines.coverage`.
float even_line_coverage(int line, ivec2 pixel, float width)
{
  vec4 fine = texelFetch(line_image, ivec3(pixel, line), 0);
  float crowding = line_crowding(line, pixel);
  float coverage = width;
  if (crowding < 1.0) {
    coverage += (1.0 - crowding) * even_line_relief(fine.x, fine.y, fine.z, width);
  }
  if (crowding > 0.0) {
    float streak = texelFetch(line_image, ivec3(pixel, line_count + line), 0).x;
    coverage += crowding * even_line_relief(streak, COARSE_RATIO * fine.y, fine.z, width);
  }
  return coverage;
}

// The width of a line at a mean width, as `even_lines.uneven_width`. `variation` is the sum of the
// weighted breaks and the paper grain.
float uneven_line_width(float mean_width, float variation, float break_weight)
{
  float width = coverage_threshold(mean_width, 0) + variation / ((1.0 - break_weight) * (2.0 * sqrt(3.0)));
  return clamp(width, 0.0, 1.0);
}
