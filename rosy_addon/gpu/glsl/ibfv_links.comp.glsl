// How the sheets of a pixel continue to those of its neighbors (`ibfv`): two bits for each, see `link_of`,
// as a normal float. 0 at pixels without the field.

void main()
{
  ivec2 pixel = ivec2(gl_GlobalInvocationID.xy) + box_origin;
  if (any(greaterThanEqual(pixel, imageSize(links)))) {
    return;
  }
  float phase = texelFetch(cells, pixel, 0).x;
  uint word = 0u;
  if (phase != 0.0) {
    word = WORD_EXPONENT;
    for (int bit = 0; bit < 9; ++bit) {
      if (((neighbor_mask(phase) >> bit) & 1) == 1) {
        ivec2 neighbor = pixel + ivec2(bit % 3 - 1, bit / 3 - 1);
        float turned = phase - texelFetch(cells, neighbor, 0).x;
        // Of a RoSy of odd degree, every other sheet is a direction.
        float shift = round(turned * float(degree) / float(sheet_count));
        word |= uint(int(clamp(shift, -1.0, 1.0)) + 2) << (2 * bit);
      }
    }
  }
  imageStore(links, pixel, vec4(uintBitsToFloat(word), 0.0, 0.0, 0.0));
}
