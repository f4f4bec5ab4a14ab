// The largest magnitude, tile by tile: of the field the first time, of its own results after that.

void main()
{
  ivec2 tile = ivec2(gl_GlobalInvocationID.xy);
  if (any(greaterThanEqual(tile, imageSize(tiles)))) {
    return;
  }
  ivec2 size = textureSize(magnitudes, 0);
  float found = 0.0;
  for (int y = 0; y < 16; ++y) {
    for (int x = 0; x < 16; ++x) {
      ivec2 pixel = tile * 16 + ivec2(x, y);
      if (all(lessThan(pixel, size))) {
        vec4 value = texelFetch(magnitudes, pixel, 0);
        bool counts = first_time == 0 || value.z == float(degree);
        found = max(found, counts ? length(value.xy) : 0.0);
      }
    }
  }
  imageStore(tiles, tile, vec4(found, 0.0, 0.0, 1.0));
}
