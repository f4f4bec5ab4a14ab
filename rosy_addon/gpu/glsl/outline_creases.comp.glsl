// Mark the pixels next to the visible edges of creases, as `crease_pixels` does. Each thread tests every
// CREASE_SLICES-th crossing of one edge with the rows and columns of pixels.

uniform sampler2D crease_points, field_values, depth_slopes;
uniform float instance_id;
uniform int is_perspective, crease_count;
uniform vec4 clip_x, clip_y, clip_w, model_view_z;
layout(r32f) uniform writeonly image2D crease_marks;

vec3 crease_end(int index)
{
  return texelFetch(crease_points, ivec2(index & ((1 << ROW_BITS) - 1), index >> ROW_BITS), 0).xyz;
}

// A point on screen: x and y in pixels, and the depth in the units of depth_slopes.
vec3 on_screen(vec3 point, float depth)
{
  vec4 p = vec4(point, 1.0);
  vec2 clip = vec2(dot(clip_x, p), dot(clip_y, p)) / dot(clip_w, p);
  return vec3((0.5 * clip + 0.5) * vec2(imageSize(crease_marks)),
              is_perspective != 0 ? 1.0 / depth : -depth);
}

void mark_if_visible(ivec2 pixel, float line_depth, vec2 offset)
{
  if (any(lessThan(pixel, ivec2(0))) || any(greaterThanEqual(pixel, imageSize(crease_marks))) ||
      texelFetch(field_values, pixel, 0).w != instance_id + 1.0) {
    return;
  }
  vec4 slope = texelFetch(depth_slopes, pixel, 0);
  if (abs(line_depth - (slope.x + dot(slope.yz, offset))) <= LINE_TOLERANCE * slope.w) {
    imageStore(crease_marks, pixel, vec4(1.0));
  }
}

// Test the crossings of an edge with the rows of pixels, or with the columns if x and y are swapped.
void mark_crossings(vec3 low, vec3 high, bool swapped, int slice)
{
  if (low.y > high.y) {
    vec3 end = low;
    low = high;
    high = end;
  }
  ivec2 frame = imageSize(crease_marks);
  float row_count = float(swapped ? frame.x : frame.y);
  int first = int(clamp(ceil(low.y - 0.5), 0.0, row_count));
  int stop = int(clamp(ceil(high.y - 0.5), 0.0, row_count));
  vec3 slope = (high - low) / max(high.y - low.y, 1e-30);
  for (int row = first + slice; row < stop; row += CREASE_SLICES) {
    vec3 point = low + slope * (float(row) + 0.5 - low.y);
    float place = floor(clamp(point.x, -2.0, float(frame.x + frame.y)) - 0.5);
    for (float side = 0.0; side < 2.0; ++side) {
      float offset = point.x - (place + side + 0.5);
      ivec2 pixel = ivec2(int(place + side), row);
      mark_if_visible(swapped ? pixel.yx : pixel, point.z,
                      swapped ? vec2(0.0, offset) : vec2(offset, 0.0));
    }
  }
}

void main()
{
  int edge = int(gl_GlobalInvocationID.y) * CREASES_PER_ROW + int(gl_GlobalInvocationID.x);
  if (int(gl_GlobalInvocationID.x) >= CREASES_PER_ROW || edge >= crease_count) {
    return;
  }
  vec3 a = crease_end(2 * edge), b = crease_end(2 * edge + 1);
  float depth_a = -dot(model_view_z, vec4(a, 1.0)), depth_b = -dot(model_view_z, vec4(b, 1.0));
  if (is_perspective != 0) {
    float least = MIN_RELATIVE_DEPTH * max(depth_a, depth_b);
    if (least <= 0.0) {
      return;
    }
    if (depth_a < least) {
      a = mix(a, b, (least - depth_a) / (depth_b - depth_a));
      depth_a = least;
    }
    else if (depth_b < least) {
      b = mix(b, a, (least - depth_b) / (depth_a - depth_b));
      depth_b = least;
    }
  }
  vec3 low = on_screen(a, depth_a), high = on_screen(b, depth_b);
  int slice = int(gl_GlobalInvocationID.z);
  mark_crossings(low, high, false, slice);
  mark_crossings(low.yxz, high.yxz, true, slice);
}
