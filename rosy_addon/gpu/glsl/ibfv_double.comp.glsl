// Twice as many steps (`ibfv`): the sums along the streamlines of all states, and those that arrive from
// their origins. The origins themselves are composed. Each layer is a sheet.

void main()
{
  ivec3 state = ivec3(gl_GlobalInvocationID) + ivec3(box_origin, 0);
  if (any(greaterThanEqual(state.xy, imageSize(next_sums).xy)) ||
      texelFetch(links, state.xy, 0).x == 0.0) {
    return;
  }
  vec4 own_sums = texelFetch(state_sums, state, 0);
  Origin origin = unpacked_origin(texelFetch(state_origins, state, 0).xy);
  if (origin.state.z < 0) {
    imageStore(next_sums, state, own_sums);
    if (is_last == 0) {
      imageStore(next_origins, state, vec4(0.0));
    }
    return;
  }
  uint origin_links = links_at(origin.state.xy);
  ivec2 side = side_of(origin.offset);
  vec4 weights = bilinear_weights(origin.offset);
  vec4 arriving = weights.x * texelFetch(state_sums, origin.state, 0);
  Origin target = no_origin();
  if (is_last == 0) {
    target = unpacked_origin(texelFetch(state_origins, origin.state, 0).xy);
  }
  vec2 change = vec2(0.0);
  for (int corner = 1; corner < 4; ++corner) {
    ivec2 move = side * ivec2(corner & 1, corner >> 1);
    vec2 parting = vec2(move);
    ivec3 around = origin.state;
    int link = link_of(origin_links, move);
    if (link > 0) {
      around = neighbor_state(origin.state, link, move);
      if (is_last == 0) {
        Origin other = unpacked_origin(texelFetch(state_origins, around, 0).xy);
        vec2 apart = vec2(other.state.xy - target.state.xy) + (other.offset - target.offset);
        // Of points that are reached from elsewhere, the distance to the pixel is taken.
        if (other.state.z >= 0 && max(abs(apart.x), abs(apart.y)) <= MAX_PARTING) {
          parting = apart;
        }
      }
    }
    arriving += weights[corner] * texelFetch(state_sums, around, 0);
    change += weights[corner] * parting;
  }
  float own_decay = decay, own_break_decay = break_decay;
  if ((magnitude_mode & MAGNITUDE_LENGTH) != 0) {
    float share = magnitude_share(texelFetch(field_values, state.xy, 0).xy);
    own_decay = decay_of_steps(int(round(float(half_length) * share)));
    own_break_decay = decay_of_steps(int(round(float(break_steps) * share)));
  }
  float steps_weight = pow(own_decay, step_count);
  // The wave turns. Breaks have weights of their own.
  vec2 turn = break_steps > 0 ? vec2(pow(own_break_decay, step_count), 0.0) : steps_weight * wave_turn;
  arriving = vec4(steps_weight * arriving.x, times(arriving.yz, turn), steps_weight * arriving.w);
  imageStore(next_sums, state, own_sums + arriving);
  if (is_last != 0) {
    return;
  }
  if (target.state.z >= 0) {
    target = moved_origin(target.state, links_at(target.state.xy), target.offset + change);
  }
  imageStore(next_origins, state, vec4(packed_origin(target), 0.0, 0.0));
}
