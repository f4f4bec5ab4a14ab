// Set an image to 0. Framebuffer clears are slow on some cards.

uniform ivec2 box_origin;
layout(rgba32f) uniform writeonly image2D cleared;

void main()
{
  ivec2 pixel = ivec2(gl_GlobalInvocationID.xy) + box_origin;
  if (all(lessThan(pixel, imageSize(cleared)))) {
    imageStore(cleared, pixel, vec4(0.0));
  }
}
