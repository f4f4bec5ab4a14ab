// The width of the outline at pixels on an edge of their surface, and the bits for what lies beyond the edge,
// as in `outline`. The width is 0 at other pixels, and where a surface in front begins, because the outline
// is then drawn on the surface in front.

#include "surface_continuity.glsl"

uniform sampler2D visibility, normals, field_values, depth_slopes, crease_marks, triangle_parts;
uniform float instance_id, outline, min_normal_cosine;
uniform int first_triangle_id, has_creases, has_parts;
uniform ivec2 box_origin;
layout(rg32f) uniform writeonly image2D outline_edges;

int part_of(ivec2 pixel)
{
  int triangle = floatBitsToInt(texelFetch(visibility, pixel, 0).x) - first_triangle_id;
  int texel = triangle >> 2;
  vec4 parts = texelFetch(triangle_parts, ivec2(texel & ((1 << ROW_BITS) - 1), texel >> ROW_BITS), 0);
  return int(parts[triangle & 3]);
}

// The change of the depth from a pixel to its neighbor; 0 where the neighbor shows no surface.
float depth_change(ivec2 pixel, ivec2 offset, float depth)
{
  ivec2 next = pixel + offset, frame = imageSize(outline_edges);
  if (any(lessThan(next, ivec2(0))) || any(greaterThanEqual(next, frame)) ||
      texelFetch(field_values, next, 0).w == 0.0) {
    return 0.0;
  }
  return abs(texelFetch(depth_slopes, next, 0).x - depth);
}

void main()
{
  ivec2 pixel = ivec2(gl_GlobalInvocationID.xy) + box_origin;
  ivec2 frame = imageSize(outline_edges);
  if (any(greaterThanEqual(pixel, frame))) {
    return;
  }
  vec4 value = texelFetch(field_values, pixel, 0);
  if (value.w != instance_id + 1.0 || value.xy == vec2(0.0)) {
    return;
  }
  vec4 normal = texelFetch(normals, pixel, 0), slope = texelFetch(depth_slopes, pixel, 0);
  bool is_crease = has_creases != 0 && texelFetch(crease_marks, pixel, 0).x > 0.0;
  float width = is_crease ? 0.5 * outline : 0.0;
  int border = 0, part = has_parts != 0 ? part_of(pixel) : 0;
  for (int direction = 0; direction < 4; ++direction) {
    ivec2 offset = direction == 0 ? ivec2(1, 0) :
                   direction == 1 ? ivec2(-1, 0) :
                   direction == 2 ? ivec2(0, 1) :
                                    ivec2(0, -1);
    ivec2 neighbor = pixel + offset;
    if (any(lessThan(neighbor, ivec2(0))) || any(greaterThanEqual(neighbor, frame))) {
      continue;
    }
    vec4 other = texelFetch(field_values, neighbor, 0);
    if (other.w == 0.0) {
      width = outline;
      border |= EMPTY_BORDER;
      continue;
    }
    bool same_instance = other.w == value.w;
    bool is_undefined = same_instance && other.xy == vec2(0.0);
    vec4 other_slope = texelFetch(depth_slopes, neighbor, 0);
    vec4 other_normal = texelFetch(normals, neighbor, 0);
    bool other_part = !same_instance || (has_parts != 0 && part_of(neighbor) != part);
    border |= other_part ? PART_BORDER : 0;
    bool same_side = (normal.w > 0.0) == (other_normal.w > 0.0);
    if (is_undefined) {
      continue;
    }
    if (same_instance && depth_continues(slope, other_slope, same_side, offset)) {
      // Where two connected components intersect, there is a crease.
      if (other_part && dot(normal.xyz, other_normal.xyz) < min_normal_cosine) {
        width = max(width, 0.5 * outline);
      }
      // A surface that is seen edge-on can predict any depth: a silhouette is a change of depth that is much
      // steeper than the changes around it.
      float fall = slope.x - other_slope.x;
      if (fall > MIN_STEP * min(slope.w, other_slope.w) &&
          fall > STEP_RATIO * depth_change(pixel, -offset, slope.x) &&
          fall > STEP_RATIO * depth_change(neighbor, offset, other_slope.x)) {
        width = outline;
      }
      continue;
    }
    float jump = (other_slope.x - slope.x) / (DEPTH_JUMP * slope.w);
    if (jump < -1.0) {
      width = outline;
    }
    else if (jump <= 1.0) {
      width = max(width, 0.5 * outline);
    }
  }
  imageStore(outline_edges, pixel, vec4(width, float(border), 0.0, 0.0));
}
