// The cells of the covering, and the direction of each line on screen: `pixel_neighbors` and
// `covering` in one pass. A cell holds its phase with the neighbor mask, and the noise.

#include "surface_continuity.glsl"
#include "screen_direction.glsl"

uniform sampler2D normals, field_values, depth_slopes, noise, wobble_angles;
uniform float guiding_angle, min_normal_cosine, wobble_strength;
uniform int degree, line_count, sheet_count;
uniform ivec2 box_origin;
uniform vec2 lens_shift;
uniform vec4 clip_to_camera;
layout(rg32f) uniform writeonly image2D cells;
layout(rgba16f) uniform writeonly image2DArray directions;
#pragma constant(degree, line_count, sheet_count, harmonic_count, first_harmonic)

// Whether the surface continues from a pixel to a neighbor, as in `pixel_neighbors`.
bool is_continuous(ivec2 pixel, ivec2 offset, vec4 value, vec4 normal, vec4 slope)
{
  ivec2 neighbor = pixel + offset;
  if (any(lessThan(neighbor, ivec2(0))) || any(greaterThanEqual(neighbor, imageSize(cells)))) {
    return false;
  }
  vec4 other = texelFetch(field_values, neighbor, 0);
  if (other.w != value.w || other.xy == vec2(0.0)) {
    return false;
  }
  vec4 other_slope = texelFetch(depth_slopes, neighbor, 0);
  vec4 other_normal = texelFetch(normals, neighbor, 0);
  if (!depth_continues(slope, other_slope, (normal.w > 0.0) == (other_normal.w > 0.0), offset)) {
    return false;
  }
  return dot(normal.xyz, other_normal.xyz) >= min_normal_cosine;
}

void main()
{
  ivec2 pixel = ivec2(gl_GlobalInvocationID.xy) + box_origin;
  if (any(greaterThanEqual(pixel, imageSize(cells)))) {
    return;
  }
  vec4 value = texelFetch(field_values, pixel, 0);
  if (value.w == 0.0 || value.z != float(degree)) {
    imageStore(cells, pixel, vec4(0.0));
    return;
  }
  vec4 noise_value = texelFetch(noise, pixel, 0);
  if (value.xy == vec2(0.0)) {
    imageStore(cells, pixel, vec4(with_neighbor_mask(2.0, 0), noise_value.xyz));
    for (int line = 0; line < line_count; ++line) {
      imageStore(directions, ivec3(pixel, line), vec4(0.0));
    }
    return;
  }
  vec4 normal = texelFetch(normals, pixel, 0), slope = texelFetch(depth_slopes, pixel, 0);
  int neighbors = 16;
  for (int bit = 0; bit < 9; ++bit) {
    if (bit != 4 && is_continuous(pixel, ivec2(bit % 3 - 1, bit / 3 - 1), value, normal, slope)) {
      neighbors |= 1 << bit;
    }
  }
  float wobble = wobble_strength > 0.0 ?
                     wobble_strength * texelFetch(wobble_angles, pixel, 0).x :
                     0.0;
  float frame_angle = float(degree) * (guiding_angle - wobble);
  vec2 z = times(value.xy, vec2(cos(frame_angle), -sin(frame_angle)));
  float angle = atan(z.y, z.x) / float(degree);
  float phase = angle * float(sheet_count) / TAU + 2.0;
  imageStore(cells, pixel, vec4(with_neighbor_mask(phase, neighbors), noise_value.xyz));

  vec2 ray = pixel_ray(pixel, vec2(imageSize(cells)), clip_to_camera, lens_shift);
  vec3 eye = direction_to_eye(ray, is_perspective != 0);
  // The camera's axes, transported to the plane perpendicular to the ray, as in `frames`.
  float a = 1.0 / (1.0 + eye.z);
  vec3 x = vec3(1.0 - eye.x * eye.x * a, -eye.x * eye.y * a, -eye.x);
  vec3 y = vec3(-eye.x * eye.y * a, 1.0 - eye.y * eye.y * a, -eye.y);
  vec2 screen_x = screen_direction(x, eye, normal.xyz, ray);
  vec2 screen_y = screen_direction(y, eye, normal.xyz, ray);
  for (int line = 0; line < line_count; ++line) {
    float member_angle = angle + guiding_angle + TAU * float(line) / float(sheet_count);
    vec2 member = member_direction(vec2(cos(member_angle), sin(member_angle)), wobble, pixel);
    vec2 direction = screen_x * member.x + screen_y * member.y;
    direction = unit_or_zero(direction);
    imageStore(directions, ivec3(pixel, line), vec4(direction, 0.0, 0.0));
  }
}
