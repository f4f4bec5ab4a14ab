// The triangle that is visible at the center of each pixel. If there is none, it is the triangle at the
// sample that is nearest to the center and shows one, as in `rasterized_samples.SampledTriangles`. Ids from
// occluder_id on belong to triangles that only occlude.

uniform sampler2D center_visibility, sample_visibility;
uniform int samples_per_side, occluder_id;
uniform ivec2 box_origin;
layout(r32f) uniform writeonly image2D visibility;

bool is_drawn(float id)
{
  int bits = floatBitsToInt(id);
  return bits != 0 && bits < occluder_id;
}

void main()
{
  ivec2 pixel = ivec2(gl_GlobalInvocationID.xy) + box_origin;
  if (any(greaterThanEqual(pixel, imageSize(visibility)))) {
    return;
  }
  float id = texelFetch(center_visibility, pixel, 0).x;
  if (!is_drawn(id)) {
    float nearest = 1e9;
    id = 0.0;
    for (int y = 0; y < samples_per_side; ++y) {
      for (int x = 0; x < samples_per_side; ++x) {
        float sample_id = texelFetch(sample_visibility, pixel * samples_per_side + ivec2(x, y), 0).x;
        vec2 offset = vec2(x, y) - 0.5 * float(samples_per_side - 1);
        if (is_drawn(sample_id) && dot(offset, offset) < nearest) {
          nearest = dot(offset, offset);
          id = sample_id;
        }
      }
    }
  }
  imageStore(visibility, pixel, vec4(id, 0.0, 0.0, 0.0));
}
