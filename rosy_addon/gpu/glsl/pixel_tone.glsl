uniform sampler2D tones;

// The target tone of a pixel.
float tone_at(ivec2 pixel)
{
  vec3 light = texelFetch(tones, pixel, 0).xyz;
  return clamp((light.x + light.y + light.z) / 3.0, 0.0, 1.0);
}
