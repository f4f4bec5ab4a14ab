// The states that streaks are carried from (`ibfv`): a pixel, and one of the sheets that streaks come
// along, of which there are as many as directions. Streaks come to a state from its *origin*, some steps
// upstream. Included by passes over all states.

// A state, and the offset from the center of its pixel. The sheet is -1 where the streamline has ended.
struct Origin {
  ivec3 state;
  vec2 offset;
};

Origin origin_at(ivec3 state, vec2 offset)
{
  Origin origin;
  origin.state = state;
  origin.offset = offset;
  return origin;
}

Origin no_origin()
{
  return origin_at(ivec3(0, 0, -1), vec2(0.0));
}

// Two normal floats, the bits of which hold a pixel, an offset and a sheet. 0 where the streamline has
// ended.
vec2 packed_origin(Origin origin)
{
  if (origin.state.z < 0) {
    return vec2(0.0);
  }
  float half_pixel = 0.5 * float(ORIGIN_UNITS);
  vec2 within = clamp(round(origin.offset * float(ORIGIN_UNITS)), -half_pixel, half_pixel - 1.0);
  uvec2 place = uvec2(origin.state.xy * ORIGIN_UNITS + ivec2(within + half_pixel));
  uvec2 sheet_bits = uvec2(origin.state.z & 3, origin.state.z >> 2);
  uvec2 words = place << 2 | sheet_bits | uvec2(WORD_EXPONENT);
  return vec2(uintBitsToFloat(words.x), uintBitsToFloat(words.y));
}

Origin unpacked_origin(vec2 texel)
{
  if (texel.x == 0.0) {
    return no_origin();
  }
  uvec2 words = uvec2(floatBitsToUint(texel.x), floatBitsToUint(texel.y));
  words &= uvec2(~WORD_EXPONENT);
  ivec2 sheet_bits = ivec2(words & uvec2(3u)), place = ivec2(words >> 2);
  ivec2 pixel = place / ORIGIN_UNITS;
  vec2 offset = vec2(place - pixel * ORIGIN_UNITS) / float(ORIGIN_UNITS) - 0.5;
  return origin_at(ivec3(pixel, sheet_bits.x | sheet_bits.y << 2), offset);
}

// What a step to a neighbor adds to the number of the sheet, and 2. It is 0 where streamlines cannot step.
int link_of(uint pixel_links, ivec2 move)
{
  return int(pixel_links >> (2 * (move.x + 3 * move.y + 4)) & 3u);
}

uint links_at(ivec2 pixel)
{
  return floatBitsToUint(texelFetch(links, pixel, 0).x) & ~WORD_EXPONENT;
}

// The state of a neighbor, on the sheet that matches that of a state.
ivec3 neighbor_state(ivec3 state, int link, ivec2 move)
{
  return ivec3(state.xy + move, wrap_once(state.z + link - 2, degree));
}

// The origin at an offset from the center of a pixel, at most in an adjacent one. The streamline ends if
// it cannot step there.
Origin moved_origin(ivec3 state, uint pixel_links, vec2 offset)
{
  ivec2 move = ivec2(clamp(round(offset), -1.0, 1.0));
  int link = link_of(pixel_links, move);
  if (link == 0) {
    return no_origin();
  }
  return origin_at(neighbor_state(state, link, move), offset - vec2(move));
}

// The steps from a pixel to the next ones in x and y, on the side of an offset.
ivec2 side_of(vec2 offset)
{
  return ivec2(offset.x < 0.0 ? -1 : 1, offset.y < 0.0 ? -1 : 1);
}

// The weights of bilinear interpolation of the pixel, the next ones in x and y, and that in both.
vec4 bilinear_weights(vec2 offset)
{
  vec2 far_share = abs(offset);
  float both = far_share.x * far_share.y;
  return vec4(1.0 - far_share.x - far_share.y + both, far_share - both, both);
}
