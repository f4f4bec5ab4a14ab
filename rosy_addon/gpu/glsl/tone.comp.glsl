// The target tone of the pixels of one instance: `target_tone`.

#include "triangle_record.glsl"

uniform sampler2D normals, lighting, tone_image;
uniform float pixels_per_unit, shading, curve_black, curve_scale, curve_power, values_bottom;
uniform float values_scale;
uniform int tone_lit, tone_source, colors_values, curve_light, image_level, values_texel;
uniform ivec2 box_origin, image_size;
uniform vec2 lens_shift;
uniform vec4 clip_to_camera, to_reference_x, to_reference_y, to_reference_w;
layout(rgba32f) uniform writeonly image2D tones;
#pragma constant(tone_source, curve_light, tone_lit, colors_values)

// Bilinear sample of a level of the tone image. The smaller levels of the atlas are on the right of
// level 0, on top of each other.
float sample_image(vec2 position, int level)
{
  ivec2 size = image_size, origin = ivec2(0);
  for (int step = 0; step < level; ++step) {
    origin = step == 0 ? ivec2(size.x, 0) : origin + ivec2(0, size.y);
    size = max((size + 1) / 2, ivec2(1));
  }
  bool repeats = tone_source == TONE_IMAGE;
  position = (repeats ? fract(position) : clamp(position, 0.0, 1.0)) * vec2(size) - 0.5;
  vec2 low_corner = floor(position);
  vec2 fraction = position - low_corner;
  ivec2 low = ivec2(low_corner), high = low + 1;
  if (repeats) {
    low = ivec2(low.x < 0 ? size.x - 1 : low.x, low.y < 0 ? size.y - 1 : low.y);
    high = ivec2(high.x >= size.x ? 0 : high.x, high.y >= size.y ? 0 : high.y);
  }
  low = clamp(low, ivec2(0), size - 1);
  high = clamp(high, ivec2(0), size - 1);
  float left_low = texelFetch(tone_image, origin + low, 0).x;
  float right_low = texelFetch(tone_image, origin + ivec2(high.x, low.y), 0).x;
  float left_high = texelFetch(tone_image, origin + ivec2(low.x, high.y), 0).x;
  float right_high = texelFetch(tone_image, origin + high, 0).x;
  return mix(mix(left_low, right_low, fraction.x), mix(left_high, right_high, fraction.x), fraction.y);
}

vec3 apply_curve(vec3 tone)
{
  vec3 stretched = max((tone - curve_black) * curve_scale, 0.0);
  return curve_power == 1.0 ? stretched : pow(stretched, vec3(curve_power));
}

// The position of the surface's value in the color map, from 0 to 1; -1 where the surface has no value.
float map_position(int triangle, vec2 ray)
{
  if (values_texel < 0) {
    return -1.0;
  }
  vec4 numbers = record_texel(triangle, values_texel);
  if (numbers.w == 0.0) {
    return -1.0;
  }
  vec3 weights = weights_at(corners_to_camera(corner_positions(triangle)), ray);
  float number = numbers.x + weights.y * (numbers.y - numbers.x) + weights.z * (numbers.z - numbers.x);
  return clamp((number - values_bottom) * values_scale, 0.0, 1.0);
}

void main()
{
  ivec2 pixel = ivec2(gl_GlobalInvocationID.xy) + box_origin;
  ivec2 frame = imageSize(tones);
  if (any(greaterThanEqual(pixel, frame))) {
    return;
  }
  int triangle = visible_triangle(pixel);
  if (!is_of_instance(triangle)) {
    return;
  }
  float position_in_map = 1.0;
  if (colors_values != 0) {
    position_in_map =
        map_position(triangle, pixel_ray(pixel, vec2(frame), clip_to_camera, lens_shift));
  }
  vec3 light = 1.0 - shading + shading * texelFetch(lighting, pixel, 0).xyz;
  if (tone_source == TONE_LIGHT) {
    imageStore(tones, pixel, vec4(curve_light != 0 ? apply_curve(light) : light, position_in_map));
    return;
  }
  vec4 normal = texelFetch(normals, pixel, 0);
  vec2 ray = pixel_ray(pixel, vec2(frame), clip_to_camera, lens_shift);
  float depth = abs(normal.w);
  float tone = 0.0;
  if (tone_source == TONE_PICTURE) {
    vec4 position = vec4(ray * (is_perspective != 0 ? depth : 1.0), -depth, 1.0);
    vec2 uv = vec2(dot(to_reference_x, position), dot(to_reference_y, position));
    uv = uv / max(dot(to_reference_w, position), 1e-12) * 0.5 + 0.5;
    tone = sample_image(uv, image_level);
  }
  else {
    vec4 uv01 = record_texel(triangle, texels_per_record - 3);
    vec4 uv2 = record_texel(triangle, texels_per_record - 2);
    Corners corners = corners_to_camera(corner_positions(triangle));
    vec3 weights = weights_at(corners, ray);
    vec2 uv = weights.x * uv01.xy + weights.y * uv01.zw + weights.z * uv2.xy;
    tone = uv.x;
    if (tone_source == TONE_IMAGE) {
      // The mip level at which a pixel covers one texel, as `surface_tone`.
      vec2 edge1 = uv01.zw - uv01.xy, edge2 = uv2.xy - uv01.xy;
      float uv_area = abs(edge1.x * edge2.y - edge2.x * edge1.y);
      vec3 plane_cross = cross(corners.second - corners.first, corners.third - corners.first);
      float area = length(plane_cross);
      float facing = abs(dot(unit_or_zero(plane_cross), direction_to_eye(ray, is_perspective != 0)));
      float pixel_width = (is_perspective != 0 ? depth : 1.0) / pixels_per_unit;
      float pixel_area = pixel_width * pixel_width / max(facing, MIN_FACING_COSINE);
      float texels_covered = uv_area * float(image_size.x) * float(image_size.y) * pixel_area;
      float level = 0.5 * log2(texels_covered / max(area, 1e-30) + 1e-12);
      tone = sample_image(uv, int(clamp(floor(level + 0.5), 0.0, float(image_level))));
    }
  }
  vec3 result = apply_curve(vec3(tone));
  imageStore(tones, pixel, vec4(tone_lit != 0 ? result * light : result, position_in_map));
}
