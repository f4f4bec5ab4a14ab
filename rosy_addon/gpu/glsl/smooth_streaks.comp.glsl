// Average each pixel's streaks with the streaks of its neighbors in both directions of the line, as
// `fast_lic` does for antialiased pictures. Neighbors on one line have streamlines of their own, which differ
// a little.

#include "line_neighbor.glsl"

uniform sampler2DArray line_means;
uniform ivec2 box_origin;
layout(rgba16f) uniform writeonly image2DArray smooth_means;

void main()
{
  ivec2 pixel = ivec2(gl_GlobalInvocationID.xy) + box_origin;
  int line = int(gl_GlobalInvocationID.z);
  if (any(greaterThanEqual(pixel, imageSize(smooth_means).xy))) {
    return;
  }
  float phase = texelFetch(cells, pixel, 0).x;
  if (phase == 0.0) {
    return;
  }
  ivec2 offset = next_along(pixel, line);
  vec4 means = texelFetch(line_means, ivec3(pixel, line), 0);
  vec4 ahead = texelFetch(line_means, neighbor_line(pixel, line, offset, phase), 0);
  vec4 behind = texelFetch(line_means, neighbor_line(pixel, line, -offset, phase), 0);
  imageStore(smooth_means, ivec3(pixel, line), 0.5 * means + 0.25 * (ahead + behind));
}
