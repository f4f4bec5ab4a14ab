// Noise that moves with the surface, before the high pass: `surface_noise.surface_noise`.

#include "triangle_record.glsl"

uniform sampler2D feature_curvature;
uniform float pixel_size, cell_size, min_cell_scale, feature_cells, max_bend, amplitude, density;
uniform int density_threshold, noise_channels, seed, instance_hash;
uniform ivec2 box_origin;
uniform vec2 lens_shift;
uniform vec4 clip_to_camera, lattice_x, lattice_y, lattice_z;
layout(rgba32f) uniform writeonly image2D raw_noise;

// The random bit of a cell, as `image_noise.hash_bits`.
float random_bit(ivec3 cell, int octave, int channel)
{
  uint h = uint(cell.x) * HASH_X;
  h ^= uint(cell.y) * HASH_Y;
  h ^= uint(cell.z) * HASH_Z;
  h ^= uint(octave) * HASH_OCTAVE;
  h ^= uint(instance_hash) * HASH_INSTANCE;
  h += uint(seed) * HASH_SEED + uint(channel) * HASH_CHANNEL;
  h ^= h >> 16;
  h *= HASH_FINALIZER_0;
  h ^= h >> 15;
  h *= HASH_FINALIZER_1;
  return (h >> 8) < uint(density_threshold) ? 1.0 : 0.0;
}

void main()
{
  ivec2 pixel = ivec2(gl_GlobalInvocationID.xy) + box_origin;
  ivec2 frame = imageSize(raw_noise);
  if (any(greaterThanEqual(pixel, frame))) {
    return;
  }
  int triangle = visible_triangle(pixel);
  if (!is_of_instance(triangle)) {
    return;
  }
  Corners rest_corners = rest_positions(triangle);
  Corners corners = corners_to_camera(corner_positions(triangle));
  vec2 ray = pixel_ray(pixel, vec2(frame), clip_to_camera, lens_shift);
  vec3 center_edges = edge_functions(corners, ray);
  float edge_sum = center_edges.x + center_edges.y + center_edges.z;
  vec3 corner_z = vec3(corners.first.z, corners.second.z, corners.third.z);
  float depth = -dot(center_edges / (edge_sum == 0.0 ? 1.0 : edge_sum), corner_z);
  float size = (is_perspective != 0 ? depth : 1.0) * pixel_size;
  float scale = cell_size > 0.0 ? max(cell_size / max(size, 1e-30), min_cell_scale) : 1.0;
  if (max_bend > 1.0) {
    ivec2 texel = ivec2(triangle & ((1 << ROW_BITS) - 1), triangle >> ROW_BITS);
    vec3 corner_curvature = texelFetch(feature_curvature, texel, 0).xyz;
    vec3 weights = center_edges / (edge_sum == 0.0 ? 1.0 : edge_sum);
    // As `surface_noise.feature_scale`.
    scale /= clamp(dot(corner_curvature, weights) * size * feature_cells, 1.0, max_bend);
  }
  float level = log2(max(size * scale, 1e-30));
  float first_octave = floor(level - (0.5 * float(OCTAVES) - 1.0));
  vec3 total = vec3(0.0);
  for (int tap = 0; tap < SUBPIXEL_COUNT; ++tap) {
    // A rotated grid: no two samples share a row or a column.
    vec2 tap_offset = tap == 0 ? SUBPIXEL_OFFSET_0 :
                 tap == 1 ? SUBPIXEL_OFFSET_1 :
                 tap == 2 ? SUBPIXEL_OFFSET_2 :
                            SUBPIXEL_OFFSET_3;
    vec2 clip = tap_offset * 2.0 / vec2(frame);
    vec2 ray_offset = vec2(dot(clip_to_camera.xy, clip), dot(clip_to_camera.zw, clip));
    vec3 weights = edge_functions(corners, ray + ray_offset);
    float sum = weights.x + weights.y + weights.z;
    // For a plane seen edge-on, a pixel can reach far beyond the triangle.
    weights = clamp(weights / (sum == 0.0 ? 1.0 : sum), MIN_BARYCENTRIC, MAX_BARYCENTRIC);
    vec3 rest = interpolated(rest_corners, weights);
    vec3 lattice_position =
        vec3(dot(lattice_x.xyz, rest), dot(lattice_y.xyz, rest), dot(lattice_z.xyz, rest));
    for (int index = 0; index < OCTAVES; ++index) {
      float octave = first_octave + float(index);
      ivec3 cell = ivec3(floor(lattice_position * exp2(-octave)));
      int octave_hash = int(octave) + OCTAVE_OFFSET;
      float weight = cos((octave - level) * 0.5 * TAU / float(OCTAVES)) * sqrt(2.0 / float(OCTAVES));
      for (int channel = 0; channel < noise_channels; ++channel) {
        float value = weight * (random_bit(cell, octave_hash, channel) - density);
        total += channel == 0 ? vec3(value, 0.0, 0.0) :
                 channel == 1 ? vec3(0.0, value, 0.0) :
                                vec3(0.0, 0.0, value);
      }
    }
  }
  float contrast = inversesqrt(clamp(scale, MIN_CONTRAST_SCALE, MAX_CONTRAST_SCALE));
  imageStore(raw_noise, pixel, vec4(total * amplitude * contrast, 1.0));
}
