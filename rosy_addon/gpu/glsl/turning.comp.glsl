// How fast the directions turn from pixel to pixel, by differences over linked neighbours, so that
// a streamline beside the centre of a pixel goes where the field goes there: `Flow.turning`.

float sine_of_turn(ivec2 pixel, int line, ivec2 step_, vec2 here, float turn)
{
  int bit = step_.x + 3 * step_.y + 4;
  if (((joined_to(turn) >> bit) & 1) == 0) {
    return 0.0;
  }
  ivec2 there = pixel + step_;
  float other = texelFetch(cells, there, 0).x;
  int sheet = wrapped(line + int(round(turn - other)), around);
  bool opposite = around == 2 * lines && sheet >= lines;
  vec2 way = unit_or_zero(texelFetch(ways, ivec3(there, opposite ? sheet - lines : sheet), 0).xy);
  vec2 turned = times(opposite ? -way : way, conjugate(here));
  return turned.x > 0.0 ? turned.y : 0.0;
}

void main()
{
  ivec2 pixel = ivec2(gl_GlobalInvocationID.xy) + corner;
  int line = int(gl_GlobalInvocationID.z);
  if (any(greaterThanEqual(pixel, imageSize(turning).xy))) {
    return;
  }
  float turn = texelFetch(cells, pixel, 0).x;
  if (turn == 0.0) {
    return;
  }
  vec2 way = texelFetch(ways, ivec3(pixel, line), 0).xy;
  vec2 here = unit_or_zero(way);
  float left = sine_of_turn(pixel, line, ivec2(-1, 0), here, turn);
  float right = sine_of_turn(pixel, line, ivec2(1, 0), here, turn);
  float below = sine_of_turn(pixel, line, ivec2(0, -1), here, turn);
  float above = sine_of_turn(pixel, line, ivec2(0, 1), here, turn);
  imageStore(turning, ivec3(pixel, line), vec4(way, 0.5 * vec2(right - left, above - below)));
}
