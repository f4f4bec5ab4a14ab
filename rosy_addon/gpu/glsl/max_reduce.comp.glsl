// The largest magnitude in each block of pixels. The first run reads the field, each later run the
// result of the previous one.

uniform sampler2D source_values;
uniform int degree, is_first;
layout(rgba32f) uniform writeonly image2D tiles;

void main()
{
  ivec2 tile = ivec2(gl_GlobalInvocationID.xy);
  if (any(greaterThanEqual(tile, imageSize(tiles)))) {
    return;
  }
  ivec2 size = textureSize(source_values, 0);
  float result = 0.0;
  for (int y = 0; y < REDUCE_BLOCK; ++y) {
    for (int x = 0; x < REDUCE_BLOCK; ++x) {
      ivec2 pixel = tile * REDUCE_BLOCK + ivec2(x, y);
      if (all(lessThan(pixel, size))) {
        vec4 value = texelFetch(source_values, pixel, 0);
        bool counts = is_first == 0 || value.z == float(degree);
        result = max(result, counts ? length(value.xy) : 0.0);
      }
    }
  }
  imageStore(tiles, tile, vec4(result, 0.0, 0.0, 1.0));
}
