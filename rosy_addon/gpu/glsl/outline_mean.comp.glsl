// The fraction that outlines cover of the surface at each pixel: the mean of all samples that show this
// surface. These samples are in the pixel and in the pixels around it.

#include "sample_entry.glsl"

uniform sampler2D sample_coverage;
uniform int samples_per_side;
uniform ivec2 box_origin;
layout(r32f) uniform writeonly image2D outline_coverage;

void main()
{
  ivec2 pixel = ivec2(gl_GlobalInvocationID.xy) + box_origin;
  ivec2 frame = imageSize(outline_coverage);
  if (any(greaterThanEqual(pixel, frame))) {
    return;
  }
  float total = 0.0, count = 0.0;
  for (int bit = 0; bit < 9; ++bit) {
    ivec2 home = pixel + ivec2(bit % 3 - 1, bit / 3 - 1);
    if (any(lessThan(home, ivec2(0))) || any(greaterThanEqual(home, frame))) {
      continue;
    }
    for (int index = 0; index < samples_per_side * samples_per_side; ++index) {
      ivec2 sample_ =
          home * samples_per_side + ivec2(index % samples_per_side, index / samples_per_side);
      ivec2 offset;
      if (entry_of_sample(sample_, offset) && home + offset == pixel) {
        total += texelFetch(sample_coverage, sample_, 0).x;
        count += 1.0;
      }
    }
  }
  imageStore(outline_coverage, pixel, vec4(total / max(count, 1.0)));
}
