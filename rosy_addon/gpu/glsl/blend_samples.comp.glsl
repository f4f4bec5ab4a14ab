// The picture: the mean of the colors of the surfaces that the samples of a pixel show, weighted by alpha.
// Pixels of which no sample shows a surface are transparent black.

#include "sample_entry.glsl"

uniform sampler2D shaded_picture;
uniform int samples_per_side;
layout(rgba32f) uniform writeonly image2D picture;

void main()
{
  ivec2 pixel = ivec2(gl_GlobalInvocationID.xy);
  if (any(greaterThanEqual(pixel, imageSize(picture)))) {
    return;
  }
  vec4 total = vec4(0.0);
  for (int y = 0; y < samples_per_side; ++y) {
    for (int x = 0; x < samples_per_side; ++x) {
      ivec2 offset;
      if (entry_of_sample(pixel * samples_per_side + ivec2(x, y), offset)) {
        vec4 color = texelFetch(shaded_picture, pixel + offset, 0);
        total += vec4(color.xyz * color.w, color.w);
      }
    }
  }
  total.xyz = total.w > 0.0 ? total.xyz / total.w : vec3(0.0);
  total.w /= float(samples_per_side * samples_per_side);
  imageStore(picture, pixel, total);
}
