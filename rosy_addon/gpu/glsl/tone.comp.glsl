// How light the pixels of one body are to be: `tone.tone_of`.

// A value of an image between the centres of its pixels. It lies with its smaller ones in one: the
// halves are on its right, on top of each other.
float shown_at(vec2 place, int level)
{
  ivec2 size = image_size, start = ivec2(0);
  for (int step = 0; step < level; ++step) {
    start = step == 0 ? ivec2(size.x, 0) : start + ivec2(0, size.y);
    size = max((size + 1) / 2, ivec2(1));
  }
  bool repeated = origin_of_tone == 2;
  place = (repeated ? fract(place) : clamp(place, 0.0, 1.0)) * vec2(size) - 0.5;
  vec2 first = floor(place);
  vec2 part = place - first;
  ivec2 low = ivec2(first), high = low + 1;
  if (repeated) {
    low = ivec2(low.x < 0 ? size.x - 1 : low.x, low.y < 0 ? size.y - 1 : low.y);
    high = ivec2(high.x >= size.x ? 0 : high.x, high.y >= size.y ? 0 : high.y);
  }
  low = clamp(low, ivec2(0), size - 1);
  high = clamp(high, ivec2(0), size - 1);
  float left_low = texelFetch(shown, start + low, 0).x;
  float right_low = texelFetch(shown, start + ivec2(high.x, low.y), 0).x;
  float left_high = texelFetch(shown, start + ivec2(low.x, high.y), 0).x;
  float right_high = texelFetch(shown, start + high, 0).x;
  return mix(mix(left_low, right_low, part.x), mix(left_high, right_high, part.x), part.y);
}

vec3 curved(vec3 tone)
{
  vec3 stretched = max((tone - curve_black) * curve_scale, 0.0);
  return curve_power == 1.0 ? stretched : pow(stretched, vec3(curve_power));
}

void main()
{
  ivec2 pixel = ivec2(gl_GlobalInvocationID.xy) + corner;
  ivec2 frame = imageSize(tones);
  if (any(greaterThanEqual(pixel, frame))) {
    return;
  }
  vec2 which = texelFetch(seen, pixel, 0).xy;
  if (which.x != body + 1.0) {
    return;
  }
  vec3 light = 1.0 - shading + shading * texelFetch(lit, pixel, 0).xyz;
  if (origin_of_tone == 0) {
    imageStore(tones, pixel, vec4(tone_bends_light != 0 ? curved(light) : light, 1.0));
    return;
  }
  vec4 normal = texelFetch(normals, pixel, 0);
  vec2 ray = pixel_ray(pixel, vec2(frame), across, shift);
  float depth = abs(normal.w);
  float tone = 0.0;
  if (origin_of_tone == 3) {
    vec4 position = vec4(ray * (perspective != 0 ? depth : 1.0), -depth, 1.0);
    vec2 at = vec2(dot(taken_x, position), dot(taken_y, position));
    at = at / max(dot(taken_w, position), 1e-12) * 0.5 + 0.5;
    tone = shown_at(at, image_level);
  }
  else {
    int number = int(which.y);
    vec4 two = record(number, texels - 3), third = record(number, texels - 2);
    vec3 p = record(number, 0).xyz, q = record(number, 1).xyz, r = record(number, 2).xyz;
    vec3 a = placed(p), b = placed(q), c = placed(r);
    vec3 edges = edges_at(a, b, c, ray);
    float total = edges.x + edges.y + edges.z;
    vec3 weights = total == 0.0 ? vec3(1.0 / 3.0) : max(edges / total, 0.0);
    weights /= weights.x + weights.y + weights.z;
    vec2 at = weights.x * two.xy + weights.y * two.zw + weights.z * third.xy;
    tone = at.x;
    if (origin_of_tone == 2) {
      // How many pixels of the image one of the picture covers (`projection.tone`).
      vec2 ahead = two.zw - two.xy, aside = third.xy - two.xy;
      float mapped = abs(ahead.x * aside.y - aside.x * ahead.y);
      vec3 across_plane = cross(b - a, c - a);
      float area = length(across_plane);
      float facing = abs(dot(unit_or_zero(across_plane), direction_to_eye(ray, perspective != 0)));
      float wide = (perspective != 0 ? depth : 1.0) / pixels_per_unit;
      float covered = wide * wide / max(facing, EDGEWISE);
      float texels_covered = mapped * float(image_size.x) * float(image_size.y) * covered;
      float level = 0.5 * log2(texels_covered / max(area, 1e-30) + 1e-12);
      tone = shown_at(at, int(clamp(floor(level + 0.5), 0.0, float(image_level))));
    }
  }
  vec3 own = curved(vec3(tone));
  imageStore(tones, pixel, vec4(tone_lit != 0 ? own * light : own, 1.0));
}
