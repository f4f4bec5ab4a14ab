// Directions with the gradients of their angles on screen, by differences over connected neighbors.
// Streamlines use them at positions away from the center of a pixel.

#include "line_neighbor.glsl"

uniform ivec2 box_origin;
layout(rgba16f) uniform writeonly image2DArray angle_gradients;
#pragma constant(line_count, sheet_count)

// The sine of the angle from a direction to the direction of the same sheet at a neighbor.
float angle_difference(ivec2 pixel, int line, ivec2 offset, vec2 direction, float phase)
{
  int sheet = neighbor_sheet(pixel, line, offset, phase);
  if (sheet < 0) {
    return 0.0;
  }
  bool is_opposite = sheet >= line_count;
  ivec3 texel = ivec3(pixel + offset, is_opposite ? sheet - line_count : sheet);
  vec2 line_direction = unit_or_zero(texelFetch(directions, texel, 0).xy);
  vec2 relative = times(is_opposite ? -line_direction : line_direction, conjugate(direction));
  return relative.x > 0.0 ? relative.y : 0.0;
}

void main()
{
  ivec2 pixel = ivec2(gl_GlobalInvocationID.xy) + box_origin;
  int line = int(gl_GlobalInvocationID.z);
  if (any(greaterThanEqual(pixel, imageSize(angle_gradients).xy))) {
    return;
  }
  float phase = texelFetch(cells, pixel, 0).x;
  if (phase == 0.0) {
    return;
  }
  vec2 line_direction = texelFetch(directions, ivec3(pixel, line), 0).xy;
  vec2 direction = unit_or_zero(line_direction);
  float left = angle_difference(pixel, line, ivec2(-1, 0), direction, phase);
  float right = angle_difference(pixel, line, ivec2(1, 0), direction, phase);
  float below = angle_difference(pixel, line, ivec2(0, -1), direction, phase);
  float above = angle_difference(pixel, line, ivec2(0, 1), direction, phase);
  vec2 gradient = 0.5 * vec2(right - left, above - below);
  imageStore(angle_gradients, ivec3(pixel, line), vec4(line_direction, gradient));
}
