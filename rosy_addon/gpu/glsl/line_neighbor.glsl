// The texel of the line of a neighbor that continues a line, in arrays with a layer for each line; the line
// itself where the surface does not continue.
ivec3 neighbor_line(ivec2 pixel, int line, ivec2 offset, float phase)
{
  int bit = offset.x + 3 * offset.y + 4;
  if (((neighbor_mask(phase) >> bit) & 1) == 0) {
    return ivec3(pixel, line);
  }
  float neighbor_phase = texelFetch(cells, pixel + offset, 0).x;
  int sheet = wrap_once(line + int(round(phase - neighbor_phase)), sheet_count);
  return ivec3(pixel + offset, sheet >= line_count ? sheet - line_count : sheet);
}

// The neighbor in the direction of a line.
ivec2 next_along(ivec2 pixel, int line)
{
  return ivec2(round(unit_or_zero(texelFetch(directions, ivec3(pixel, line), 0).xy)));
}
