// How a hand wavers at the pixels of one body: `waver.waver`.

// The wavering at a place, of waves so long, as a power of two.
float waves_at(vec3 place, float level)
{
  float octave = floor(level);
  float share = (level - octave) * 0.25 * TAU;
  float total = 0.0;
  for (int finer = 0; finer < 2; ++finer) {
    vec3 at = place * exp2(-(octave + float(finer)));
    float sum = 0.0;
    for (int number = 0; number < wave_count; ++number) {
      vec4 wave = texelFetch(waves, ivec2(number, 0), 0);
      float along = 2.0 * fract(dot(wave.xyz, at) + wave.w) - 1.0;
      sum += 4.0 * along * (1.0 - abs(along));
    }
    total += (finer == 0 ? cos(share) : sin(share)) * sum;
  }
  return total * evened;
}

void main()
{
  ivec2 pixel = ivec2(gl_GlobalInvocationID.xy) + corner;
  ivec2 frame = imageSize(wavering);
  if (any(greaterThanEqual(pixel, frame))) {
    return;
  }
  vec2 which = texelFetch(seen, pixel, 0).xy;
  if (which.x != body + 1.0) {
    return;
  }
  vec3 place = vec3(vec2(pixel), 0.0);
  float size = unit_of_pixel;
  if (on_surface != 0) {
    int number = int(which.y);
    vec4 first = record(number, 0), second = record(number, 1), third = record(number, 2);
    vec3 height = record(number, texels - 1).xyz;
    vec3 rest0 = vec3(first.w, record(number, 3).w, height.x);
    vec3 rest1 = vec3(second.w, record(number, 4).w, height.y);
    vec3 rest2 = vec3(third.w, record(number, 5).w, height.z);
    vec3 a = placed(first.xyz), b = placed(second.xyz), c = placed(third.xyz);
    vec3 weights = edges_at(a, b, c, pixel_ray(pixel, vec2(frame), across, shift));
    float whole = weights.x + weights.y + weights.z;
    weights /= whole == 0.0 ? 1.0 : whole;
    float depth = -dot(weights, vec3(a.z, b.z, c.z));
    size *= perspective != 0 ? depth : 1.0;
    size *= unit_of_cell > 0.0 ? max(unit_of_cell / max(size, 1e-30), least_growth) : 1.0;
    place = weights.x * rest0 + weights.y * rest1 + weights.z * rest2;
  }
  imageStore(wavering, pixel, vec4(waves_at(place, log2(max(size, 1e-30))), 0.0, 0.0, 1.0));
}
