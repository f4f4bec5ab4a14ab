// The fraction of each pixel that outlines along silhouettes and creases cover.

uniform sampler2D outline_widths, field_values, depth_slopes;
uniform float outline;
uniform ivec2 box_origin;
layout(r32f) uniform writeonly image2D outline_coverage;

void main()
{
  ivec2 pixel = ivec2(gl_GlobalInvocationID.xy) + box_origin;
  ivec2 frame = imageSize(outline_coverage);
  if (any(greaterThanEqual(pixel, frame))) {
    return;
  }
  vec4 value = texelFetch(field_values, pixel, 0);
  float inverse_depth = texelFetch(depth_slopes, pixel, 0).x, coverage = 0.0;
  int radius = value.w == 0.0 ? -1 : int(ceil(outline));
  for (int dy = -radius; dy <= radius; ++dy) {
    for (int dx = -radius; dx <= radius; ++dx) {
      ivec2 neighbor = pixel + ivec2(dx, dy);
      float distance_pixels = length(vec2(dx, dy));
      bool inside = all(greaterThanEqual(neighbor, ivec2(0))) && all(lessThan(neighbor, frame));
      if (!inside || outline - distance_pixels <= coverage) {
        continue;
      }
      float width = texelFetch(outline_widths, neighbor, 0).x;
      if (width - distance_pixels <= coverage) {
        continue;
      }
      vec4 other = texelFetch(field_values, neighbor, 0), slope = texelFetch(depth_slopes, neighbor, 0);
      float tolerance = DEPTH_JUMP * slope.w * max(distance_pixels, 1.0);
      if (other.w == value.w && inverse_depth >= slope.x - tolerance) {
        coverage = clamp(width - distance_pixels, 0.0, 1.0);
      }
    }
  }
  imageStore(outline_coverage, pixel, vec4(coverage));
}
