// Blocks of subpixels averaged; those that see nothing are black and of alpha 0.

void main()
{
  ivec2 pixel = ivec2(gl_GlobalInvocationID.xy);
  if (any(greaterThanEqual(pixel, imageSize(picture)))) {
    return;
  }
  vec4 total = vec4(0.0);
  for (int y = 0; y < side; ++y) {
    for (int x = 0; x < side; ++x) {
      vec4 colour = texelFetch(fine, pixel * side + ivec2(x, y), 0);
      total += vec4(colour.xyz * colour.w, colour.w);
    }
  }
  total.xyz = total.w > 0.0 ? total.xyz / total.w : vec3(0.0);
  total.w /= float(side * side);
  imageStore(picture, pixel, total);
}
