// Mean along rows or columns; what is beyond the image counts as nothing.

void main()
{
  ivec2 pixel = ivec2(gl_GlobalInvocationID.xy);
  ivec2 frame = imageSize(smoother);
  if (any(greaterThanEqual(pixel, frame))) {
    return;
  }
  vec4 total = vec4(0.0);
  for (int number = -reach; number <= reach; ++number) {
    ivec2 there = pixel + number * along;
    if (all(greaterThanEqual(there, ivec2(0))) && all(lessThan(there, frame))) {
      total += texelFetch(rough, there, 0);
    }
  }
  imageStore(smoother, pixel, total / float(2 * reach + 1));
}
