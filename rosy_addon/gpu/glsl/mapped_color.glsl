uniform sampler2D color_map;

// A color of the map, at a position from 0 to 1: a display value.
vec3 mapped_color(float value)
{
  int last_texel = textureSize(color_map, 0).x - 1;
  float position = clamp(value, 0.0, 1.0) * float(last_texel);
  int low_texel = min(int(position), last_texel - 1);
  vec3 low = texelFetch(color_map, ivec2(low_texel, 0), 0).xyz;
  vec3 high = texelFetch(color_map, ivec2(low_texel + 1, 0), 0).xyz;
  return mix(low, high, position - float(low_texel));
}
