uniform sampler2D cells;
uniform sampler2DArray directions;
uniform int line_count, sheet_count;

// The sheet at a neighboring pixel that continues the sheet of a line; -1 where the surface does not
// continue.
int neighbor_sheet(ivec2 pixel, int line, ivec2 offset, float phase)
{
  int bit = offset.x + 3 * offset.y + 4;
  if (((neighbor_mask(phase) >> bit) & 1) == 0) {
    return -1;
  }
  float neighbor_phase = texelFetch(cells, pixel + offset, 0).x;
  return wrap_once(line + int(round(phase - neighbor_phase)), sheet_count);
}

// The texel of that sheet in an array with a layer for each line. Where the surface does not continue, it is
// the texel of the line itself.
ivec3 neighbor_line(ivec2 pixel, int line, ivec2 offset, float phase)
{
  int sheet = neighbor_sheet(pixel, line, offset, phase);
  return sheet < 0 ? ivec3(pixel, line) :
                     ivec3(pixel + offset, sheet >= line_count ? sheet - line_count : sheet);
}

// The offset to the neighboring pixel in the direction of a line.
ivec2 next_along(ivec2 pixel, int line)
{
  return ivec2(round(unit_or_zero(texelFetch(directions, ivec3(pixel, line), 0).xy)));
}
