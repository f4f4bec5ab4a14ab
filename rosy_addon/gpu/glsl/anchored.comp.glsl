// Noise that stays where it is on a surface: `anchored.surface_noise`, before the high pass.

// Whether the cell with these indices is bright (`noise.random_bits`).
float bright(ivec3 cell, int octave, int channel)
{
  uint h = uint(cell.x) * 0x8DA6B343u;
  h ^= uint(cell.y) * 0xD8163841u;
  h ^= uint(cell.z) * 0xCB1AB31Fu;
  h ^= uint(octave) * 0x165667B1u;
  h ^= uint(identity) * 0x9E3779B1u;
  h += uint(seed) * 0x9E3779B9u + uint(channel) * 0x85EBCA6Bu;
  h ^= h >> 16;
  h *= 0x7FEB352Du;
  h ^= h >> 15;
  h *= 0x846CA68Bu;
  return (h >> 8) < uint(bright_below) ? 1.0 : 0.0;
}

void main()
{
  ivec2 pixel = ivec2(gl_GlobalInvocationID.xy) + corner;
  ivec2 frame = imageSize(raw_noise);
  if (any(greaterThanEqual(pixel, frame))) {
    return;
  }
  vec2 which = texelFetch(seen, pixel, 0).xy;
  if (which.x != body + 1.0) {
    return;
  }
  int number = int(which.y);
  vec4 first = record(number, 0), second = record(number, 1), third = record(number, 2);
  vec3 height = record(number, texels - 1).xyz;
  vec3 rest0 = vec3(first.w, record(number, 3).w, height.x);
  vec3 rest1 = vec3(second.w, record(number, 4).w, height.y);
  vec3 rest2 = vec3(third.w, record(number, 5).w, height.z);
  vec3 a = placed(first.xyz), b = placed(second.xyz), c = placed(third.xyz);
  vec2 ray = pixel_ray(pixel, vec2(frame), across, shift);
  vec3 middle = edges_at(a, b, c, ray);
  float whole = middle.x + middle.y + middle.z;
  float depth = -dot(middle / (whole == 0.0 ? 1.0 : whole), vec3(a.z, b.z, c.z));
  float size = (perspective != 0 ? depth : 1.0) * unit_of_pixel;
  float larger = unit_of_cell > 0.0 ? max(unit_of_cell / max(size, 1e-30), least_growth) : 1.0;
  float level = log2(max(size * larger, 1e-30));
  float finest = floor(level - (0.5 * float(OCTAVES) - 1.0));
  vec3 total = vec3(0.0);
  for (int tap = 0; tap < 4; ++tap) {
    // No two in a row or a column.
    vec2 place = tap == 0 ? vec2(-0.375, -0.125) :
                 tap == 1 ? vec2(0.125, -0.375) :
                 tap == 2 ? vec2(0.375, 0.125) :
                            vec2(-0.125, 0.375);
    vec2 clip = place * 2.0 / vec2(frame);
    vec3 weights = edges_at(a, b, c, ray + vec2(dot(across.xy, clip), dot(across.zw, clip)));
    float sum = weights.x + weights.y + weights.z;
    // Where a plane is seen from its edge a pixel may reach far beyond the triangle.
    weights = clamp(weights / (sum == 0.0 ? 1.0 : sum), -4.0, 5.0);
    vec3 rest = weights.x * rest0 + weights.y * rest1 + weights.z * rest2;
    vec3 askew = vec3(dot(lattice_x.xyz, rest), dot(lattice_y.xyz, rest), dot(lattice_z.xyz, rest));
    for (int rung = 0; rung < OCTAVES; ++rung) {
      float at = finest + float(rung);
      ivec3 cell = ivec3(floor(askew * exp2(-at)));
      int turn = int(at) + LOWEST;
      float part = cos((at - level) * 0.5 * TAU / float(OCTAVES)) * sqrt(2.0 / float(OCTAVES));
      for (int channel = 0; channel < channels; ++channel) {
        float bit = part * (bright(cell, turn, channel) - density);
        total += channel == 0 ? vec3(bit, 0.0, 0.0) :
                 channel == 1 ? vec3(0.0, bit, 0.0) :
                                vec3(0.0, 0.0, bit);
      }
    }
  }
  // `anchored.EVENED`
  float even = inversesqrt(clamp(larger, 0.25, 4.0));
  imageStore(raw_noise, pixel, vec4(total * amplitude * even, 1.0));
}
