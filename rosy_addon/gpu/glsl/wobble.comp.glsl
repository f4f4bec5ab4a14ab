// The wobble angle at the pixels of one instance: `wobble.wobble_angle`.

#include "triangle_record.glsl"

uniform sampler2D wave_table;
uniform float pixel_size, cell_size, min_cell_scale;
uniform int on_surface;
uniform ivec2 box_origin;
uniform vec2 lens_shift;
uniform vec4 clip_to_camera;
layout(rgba32f) uniform writeonly image2D wobble_angles;

// The sum of the waves of two octaves at a position. `level` is the logarithm (base 2) of the wavelength.
float sum_of_waves(vec3 position, float level)
{
  float octave = floor(level);
  float blend_angle = (level - octave) * 0.25 * TAU;
  float total = 0.0;
  for (int octave_index = 0; octave_index < 2; ++octave_index) {
    vec3 wave_position = position * exp2(-(octave + float(octave_index)));
    float sum = 0.0;
    for (int index = 0; index < WAVE_COUNT; ++index) {
      vec4 wave = texelFetch(wave_table, ivec2(index, 0), 0);
      float triangle_wave = 2.0 * fract(dot(wave.xyz, wave_position) + wave.w) - 1.0;
      sum += 4.0 * triangle_wave * (1.0 - abs(triangle_wave));
    }
    total += (octave_index == 0 ? cos(blend_angle) : sin(blend_angle)) * sum;
  }
  return total * WOBBLE_AMPLITUDE;
}

void main()
{
  ivec2 pixel = ivec2(gl_GlobalInvocationID.xy) + box_origin;
  ivec2 frame = imageSize(wobble_angles);
  if (any(greaterThanEqual(pixel, frame))) {
    return;
  }
  int triangle = visible_triangle(pixel);
  if (!is_of_instance(triangle)) {
    return;
  }
  vec3 position = vec3(vec2(pixel), 0.0);
  float size = pixel_size;
  if (on_surface != 0) {
    Corners rest_corners = rest_positions(triangle);
    Corners corners = corners_to_camera(corner_positions(triangle));
    vec3 weights = edge_functions(corners, pixel_ray(pixel, vec2(frame), clip_to_camera, lens_shift));
    float edge_sum = weights.x + weights.y + weights.z;
    weights /= edge_sum == 0.0 ? 1.0 : edge_sum;
    float depth = -dot(weights, vec3(corners.first.z, corners.second.z, corners.third.z));
    size *= is_perspective != 0 ? depth : 1.0;
    size *= cell_size > 0.0 ? max(cell_size / max(size, 1e-30), min_cell_scale) : 1.0;
    position = interpolated(rest_corners, weights);
  }
  imageStore(wobble_angles, pixel, vec4(sum_of_waves(position, log2(max(size, 1e-30))), 0.0, 0.0, 1.0));
}
