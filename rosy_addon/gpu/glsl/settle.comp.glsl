// Noise around its mean, without what is broad in it: `anchored._broad`.

void main()
{
  ivec2 pixel = ivec2(gl_GlobalInvocationID.xy);
  if (any(greaterThanEqual(pixel, imageSize(noise)))) {
    return;
  }
  vec3 found = texelFetch(raw_noise, pixel, 0).xyz;
  if (high_passed != 0) {
    vec4 broad = texelFetch(smooth_noise, pixel, 0);
    found -= broad.xyz / max(broad.w, 1e-3);
  }
  imageStore(noise, pixel, vec4(found + 0.5, 0.0));
}
