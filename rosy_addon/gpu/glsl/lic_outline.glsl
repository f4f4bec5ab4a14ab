// The outline along silhouettes and creases. Included by lic.comp.glsl.

bool is_inside(ivec2 pixel)
{
  return all(greaterThanEqual(pixel, ivec2(0))) && all(lessThan(pixel, imageSize(picture)));
}

// The width of the outline at a pixel at the border of its surface. It is 0 at other pixels, and
// where a surface in front begins: the outline is then drawn on that surface (`outline`).
float edge_width(ivec2 pixel, vec4 value, vec4 slope)
{
  float width = 0.0;
  int bits = neighbor_mask(texelFetch(cells, pixel, 0).x);
  if (bits == ALL_NEIGHBORS || value.xy == vec2(0.0)) {
    return width;
  }
  for (int direction = 0; direction < 4; ++direction) {
    ivec2 offset = direction == 0 ? ivec2(1, 0) :
                   direction == 1 ? ivec2(-1, 0) :
                   direction == 2 ? ivec2(0, 1) :
                                    ivec2(0, -1);
    ivec2 neighbor = pixel + offset;
    bool inside = is_inside(neighbor);
    if (!inside || ((bits >> (offset.x + 3 * offset.y + 4)) & 1) == 1) {
      continue;
    }
    vec4 other = texelFetch(field_values, neighbor, 0);
    float jump = (texelFetch(depth_slopes, neighbor, 0).x - slope.x) / (DEPTH_JUMP * slope.w);
    bool is_undefined = other.w == value.w && other.xy == vec2(0.0);
    if (other.w == 0.0 || jump < -1.0) {
      width = is_undefined ? width : outline;
    }
    else if (jump <= 1.0 && !is_undefined) {
      width = max(width, 0.5 * outline);
    }
  }
  return width;
}

// The share of a pixel that outlines cover.
float outline_coverage(ivec2 pixel, vec4 value)
{
  float inverse_depth = texelFetch(depth_slopes, pixel, 0).x, coverage = 0.0;
  int radius = int(ceil(outline));
  for (int dy = -radius; dy <= radius; ++dy) {
    for (int dx = -radius; dx <= radius; ++dx) {
      ivec2 neighbor = pixel + ivec2(dx, dy);
      float distance_pixels = length(vec2(dx, dy));
      bool inside = is_inside(neighbor);
      if (!inside || outline - distance_pixels <= coverage) {
        continue;
      }
      vec4 other = texelFetch(field_values, neighbor, 0), slope = texelFetch(depth_slopes, neighbor, 0);
      float tolerance = DEPTH_JUMP * slope.w * max(distance_pixels, 1.0);
      if (other.w == value.w && inverse_depth >= slope.x - tolerance) {
        float width = edge_width(neighbor, other, slope);
        if (width > 0.0) {
          coverage = max(coverage, clamp(width - distance_pixels, 0.0, 1.0));
        }
      }
    }
  }
  return coverage;
}
