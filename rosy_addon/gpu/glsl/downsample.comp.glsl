// The average of each block of subpixels, weighted by alpha. Empty blocks are transparent black.

void main()
{
  ivec2 pixel = ivec2(gl_GlobalInvocationID.xy);
  if (any(greaterThanEqual(pixel, imageSize(picture)))) {
    return;
  }
  vec4 total = vec4(0.0);
  for (int y = 0; y < block_side; ++y) {
    for (int x = 0; x < block_side; ++x) {
      vec4 color = texelFetch(fine_picture, pixel * block_side + ivec2(x, y), 0);
      total += vec4(color.xyz * color.w, color.w);
    }
  }
  total.xyz = total.w > 0.0 ? total.xyz / total.w : vec3(0.0);
  total.w /= float(block_side * block_side);
  imageStore(picture, pixel, total);
}
