// For each sample of one instance, the pixel whose surface it shows, as in `pixel_coverage`. Mostly it is the
// pixel that contains the sample; at silhouettes and creases it can be a neighbor. Stored is the number of
// the pixel in its 3 x 3 neighborhood, plus one.

#include "triangle_record.glsl"

uniform sampler2D sample_visibility, field_values, depth_slopes;
uniform float instance_id;
uniform int samples_per_side;
uniform ivec2 box_origin;
uniform vec2 lens_shift;
uniform vec4 clip_to_camera;
layout(r32f) uniform writeonly image2D sample_entries;

// A visible point, for comparison: its position in pixels, its depth in the units of depth_slopes, and the
// normal of its triangle.
struct Point {
  vec2 position;
  float depth;
  vec3 normal;
};

vec3 triangle_normal(Corners corners)
{
  return unit_or_zero(cross(corners.second - corners.first, corners.third - corners.first));
}

Point sample_point(int triangle, ivec2 sample_)
{
  Corners corners = corners_to_camera(corner_positions(triangle));
  vec2 ray = pixel_ray(sample_, vec2(imageSize(sample_entries)), clip_to_camera, lens_shift);
  float z = interpolated(corners, weights_at(corners, ray)).z;
  Point point;
  point.position = (vec2(sample_) + 0.5) / float(samples_per_side);
  point.depth = is_perspective != 0 ? -1.0 / z : z;
  point.normal = triangle_normal(corners);
  return point;
}

// Whether a point is on the surface that a pixel sees.
bool shows(ivec2 pixel, Point point)
{
  if (texelFetch(field_values, pixel, 0).w != instance_id + 1.0) {
    return false;
  }
  vec4 slope = texelFetch(depth_slopes, pixel, 0);
  float predicted = slope.x + dot(slope.yz, point.position - (vec2(pixel) + 0.5));
  if (abs(point.depth - predicted) > slope.w) {
    return false;
  }
  vec3 normal = triangle_normal(corners_to_camera(corner_positions(visible_triangle(pixel))));
  return abs(dot(point.normal, normal)) >= MIN_SAMPLE_COSINE;
}

void main()
{
  ivec2 sample_ = ivec2(gl_GlobalInvocationID.xy) + box_origin;
  if (any(greaterThanEqual(sample_, imageSize(sample_entries)))) {
    return;
  }
  int triangle = floatBitsToInt(texelFetch(sample_visibility, sample_, 0).x) - first_triangle_id;
  if (!is_of_instance(triangle)) {
    return;
  }
  ivec2 home = sample_ / samples_per_side, frame = textureSize(visibility, 0);
  int entry = 4;
  if (triangle != visible_triangle(home)) {
    Point point = sample_point(triangle, sample_);
    if (!shows(home, point)) {
      float nearest = 1e9;
      for (int index = 0; index < 8; ++index) {
        // Neighbors beside, above and below come before neighbors at the corners.
        ivec2 offset = index < 2 ? ivec2(1 - 2 * index, 0) :
                       index < 4 ? ivec2(0, 5 - 2 * index) :
                                   ivec2(1 - 2 * (index & 1), index < 6 ? 1 : -1);
        ivec2 pixel = home + offset;
        vec2 away = vec2(pixel) + 0.5 - point.position;
        if (all(greaterThanEqual(pixel, ivec2(0))) && all(lessThan(pixel, frame)) &&
            dot(away, away) < nearest && shows(pixel, point)) {
          nearest = dot(away, away);
          entry = offset.x + 3 * offset.y + 4;
        }
      }
    }
  }
  imageStore(sample_entries, sample_, vec4(float(entry + 1), 0.0, 0.0, 0.0));
}
