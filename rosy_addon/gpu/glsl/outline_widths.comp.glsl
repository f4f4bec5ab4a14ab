// The widths of outlines, without marks (connected runs of edge pixels) that are too short, as in `outline`.
// A mark that is shorter than FULL_MARK_LENGTH fits into a window around any of its pixels, so the length of
// a mark is measured in a window around each pixel. The rows of the window are bit fields.

uniform sampler2D outline_edges, outline_blocks;
uniform float outline;
uniform int supersampling;
uniform ivec2 box_origin;
layout(r32f) uniform writeonly image2D outline_widths;

#define MARK_REACH (FULL_MARK_LENGTH - 1)
#define WINDOW_SIDE (2 * MARK_REACH + 1)

// The connected part of the window that contains its center.
struct Mark {
  int long_side;
  int short_side;
  int part_borders;
  bool is_at_empty;
};

Mark mark_around(ivec2 block)
{
  int edges[WINDOW_SIDE], parts[WINDOW_SIDE], empty[WINDOW_SIDE], filled[WINDOW_SIDE];
  ivec2 size = textureSize(outline_blocks, 0);
  for (int row = 0; row < WINDOW_SIDE; ++row) {
    edges[row] = parts[row] = empty[row] = 0;
    filled[row] = row == MARK_REACH ? 1 << MARK_REACH : 0;
    int y = block.y + row - MARK_REACH;
    for (int column = 0; column < WINDOW_SIDE && y >= 0 && y < size.y; ++column) {
      int x = block.x + column - MARK_REACH;
      int bits = x >= 0 && x < size.x ? int(texelFetch(outline_blocks, ivec2(x, y), 0).x) : 0;
      edges[row] |= (bits & EDGE_BIT) != 0 ? 1 << column : 0;
      parts[row] |= (bits & PART_BORDER) != 0 ? 1 << column : 0;
      empty[row] |= (bits & EMPTY_BORDER) != 0 ? 1 << column : 0;
    }
  }
  Mark mark;
  mark.long_side = 0;
  // Sweep up and down until no pixel is added. Longer marks need not be followed to their ends.
  bool grows = true;
  for (int sweep = 0; grows && sweep < WINDOW_SIDE * WINDOW_SIDE && mark.long_side < FULL_MARK_LENGTH;
       ++sweep) {
    grows = false;
    int columns = 0, first_row = WINDOW_SIDE, last_row = 0;
    for (int index = 0; index < WINDOW_SIDE; ++index) {
      int row = (sweep & 1) == 0 ? index : WINDOW_SIDE - 1 - index;
      int around = filled[row] | (row > 0 ? filled[row - 1] : 0) |
                   (row < WINDOW_SIDE - 1 ? filled[row + 1] : 0);
      int grown = (around | around << 1 | around >> 1) & edges[row];
      grows = grows || grown != filled[row];
      filled[row] = grown;
      columns |= grown;
      first_row = grown != 0 ? min(first_row, row) : first_row;
      last_row = grown != 0 ? max(last_row, row) : last_row;
    }
    ivec2 sides = ivec2(findMSB(columns) - findLSB(columns), last_row - first_row) + 1;
    mark.long_side = max(sides.x, sides.y);
    mark.short_side = min(sides.x, sides.y);
  }
  mark.part_borders = 0;
  mark.is_at_empty = false;
  for (int row = 0; row < WINDOW_SIDE; ++row) {
    mark.part_borders += bitCount(filled[row] & parts[row]);
    mark.is_at_empty = mark.is_at_empty || (filled[row] & empty[row]) != 0;
  }
  return mark;
}

void main()
{
  ivec2 block = ivec2(gl_GlobalInvocationID.xy) + box_origin;
  if (any(greaterThanEqual(block, textureSize(outline_blocks, 0)))) {
    return;
  }
  float max_width = 0.0;
  if (texelFetch(outline_blocks, block, 0).x > 0.0) {
    Mark mark = mark_around(block);
    bool surrounds = mark.part_borders >= mark.long_side + mark.short_side && mark.short_side > 1;
    float hidden = float(MIN_MARK_LENGTH - 1);
    float share = (float(mark.long_side) - hidden) / (float(FULL_MARK_LENGTH) - hidden);
    max_width = outline * (surrounds || mark.is_at_empty ? 1.0 : clamp(share, 0.0, 1.0));
  }
  for (int y = 0; y < supersampling; ++y) {
    for (int x = 0; x < supersampling; ++x) {
      ivec2 pixel = block * supersampling + ivec2(x, y);
      float width = min(texelFetch(outline_edges, pixel, 0).x, max_width);
      imageStore(outline_widths, pixel, vec4(width, 0.0, 0.0, 0.0));
    }
  }
}
