// Mean along rows or columns. Pixels outside the image count as 0.

uniform sampler2D source_image;
uniform int radius;
uniform ivec2 blur_axis;
layout(rgba32f) uniform writeonly image2D blurred_image;

void main()
{
  ivec2 pixel = ivec2(gl_GlobalInvocationID.xy);
  ivec2 frame = imageSize(blurred_image);
  if (any(greaterThanEqual(pixel, frame))) {
    return;
  }
  vec4 total = vec4(0.0);
  for (int step_ = -radius; step_ <= radius; ++step_) {
    ivec2 neighbor = pixel + step_ * blur_axis;
    if (all(greaterThanEqual(neighbor, ivec2(0))) && all(lessThan(neighbor, frame))) {
      total += texelFetch(source_image, neighbor, 0);
    }
  }
  imageStore(blurred_image, pixel, total / float(2 * radius + 1));
}
