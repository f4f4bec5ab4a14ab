// Streaks before they are carried: the noise of each state, with the weight 1 in the last component, and
// the origin of each state, a step upstream by the midpoint method. Each layer is a sheet.

// The step along a state, in pixels: at most one row and one column.
vec2 state_step(ivec3 state)
{
  int sheet = modulo(state.z * (sheet_count / degree) + first_sheet, 2 * line_count);
  bool opposite = sheet >= line_count;
  vec2 direction =
      texelFetch(directions, ivec3(state.xy, opposite ? sheet - line_count : sheet), 0).xy;
  vec2 size = abs(direction);
  direction *= step_length / max(max(size.x, size.y), 1.0);
  return opposite ? -direction : direction;
}

void main()
{
  ivec3 state = ivec3(gl_GlobalInvocationID) + ivec3(box_origin, 0);
  if (any(greaterThanEqual(state.xy, imageSize(next_sums).xy))) {
    return;
  }
  vec4 cell = texelFetch(cells, state.xy, 0);
  if (cell.x == 0.0) {
    return;
  }
  uint pixel_links = links_at(state.xy);
  vec2 own_step = state_step(state);
  vec2 middle = 0.5 * own_step;
  ivec2 side = side_of(middle);
  vec4 weights = bilinear_weights(middle);
  vec2 total = weights.x * own_step;
  for (int corner = 1; corner < 4; ++corner) {
    ivec2 move = side * ivec2(corner & 1, corner >> 1);
    int link = link_of(pixel_links, move);
    total += weights[corner] *
             (link > 0 ? state_step(neighbor_state(state, link, move)) : own_step);
  }
  Origin origin = moved_origin(state, pixel_links, total);
  imageStore(next_origins, state, vec4(packed_origin(origin), 0.0, 0.0));
  imageStore(next_sums, state, vec4(sharpened_source(state.xy, cell), 1.0));
}
