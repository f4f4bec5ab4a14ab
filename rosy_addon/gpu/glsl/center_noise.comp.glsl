// Noise around its mean, with the low frequencies subtracted.

uniform sampler2D raw_noise, blurred_noise;
uniform int high_passed;
layout(rgba32f) uniform writeonly image2D noise;

void main()
{
  ivec2 pixel = ivec2(gl_GlobalInvocationID.xy);
  if (any(greaterThanEqual(pixel, imageSize(noise)))) {
    return;
  }
  vec3 value = texelFetch(raw_noise, pixel, 0).xyz;
  if (high_passed != 0) {
    vec4 mean = texelFetch(blurred_noise, pixel, 0);
    value -= mean.xyz / max(mean.w, 1e-3);
  }
  imageStore(noise, pixel, vec4(value + 0.5, 0.0));
}
