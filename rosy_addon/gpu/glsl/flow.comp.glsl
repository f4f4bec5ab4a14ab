// Where a streamline may go next from a pixel, and along what: `steps.links`, `steps.screen_axes`
// and `covering.unfold` in one.

// Whether the surface goes on to a neighbour, as `steps._goes_on`.
bool goes_on(ivec2 pixel, ivec2 step_, vec4 value, vec4 normal, vec4 slope)
{
  ivec2 there = pixel + step_;
  if (any(lessThan(there, ivec2(0))) || any(greaterThanEqual(there, imageSize(cells)))) {
    return false;
  }
  vec4 other = texelFetch(values_seen, there, 0);
  if (other.w != value.w || other.xy == vec2(0.0)) {
    return false;
  }
  vec4 other_slope = texelFetch(slopes, there, 0), other_normal = texelFetch(normals, there, 0);
  float jump = other_slope.x - slope.x;
  float from_here = dot(slope.yz, vec2(step_)), from_there = dot(other_slope.yz, vec2(step_));
  float allowed = min(slope.w, other_slope.w);
  if (step_.x != 0 && step_.y != 0) {
    allowed *= 1.41421356;
  }
  if (jump > max(from_here, from_there) + allowed || jump < min(from_here, from_there) - allowed) {
    return false;
  }
  bool straight = abs(jump - from_here) <= allowed && abs(jump - from_there) <= allowed;
  if (!straight && (normal.w > 0.0) != (other_normal.w > 0.0)) {
    return false;
  }
  return dot(normal.xyz, other_normal.xyz) >= aligned;
}

// A tangent in the view plane as it runs on screen, along the surface, in pixels.
vec2 on_screen(vec3 tangent, vec3 toward_eye, vec3 normal, vec2 ray)
{
  vec3 along = carry(tangent, toward_eye, normal);
  vec2 flat_ = perspective != 0 ? along.xy + along.z * ray : along.xy;
  return vec2(dot(to_pixels.xy, flat_), dot(to_pixels.zw, flat_));
}

// The direction that belongs to a member: of a RoSy the member itself (`Flow.direction`). Deviations
// are functions of the member as it was before the hand wavered (`waver.swayed`).
vec2 direction_of(vec2 member, float wavered, ivec2 pixel)
{
  if (harmonics == 0) {
    return member;
  }
  vec2 before = times(member, vec2(cos(wavered), -sin(wavered)));
  vec2 total = vec2(0.0);
  for (int layer = 0; layer < harmonics; ++layer) {
    vec4 found = texelFetch(traits_seen, ivec3(pixel, layer), 0);
    total += times(found.xy, signed_power(before, lowest + layer));
  }
  return unit_or_zero(times(member, total));
}

void main()
{
  ivec2 pixel = ivec2(gl_GlobalInvocationID.xy) + corner;
  if (any(greaterThanEqual(pixel, imageSize(cells)))) {
    return;
  }
  vec4 value = texelFetch(values_seen, pixel, 0);
  if (value.w == 0.0 || value.z != float(degree)) {
    imageStore(cells, pixel, vec4(0.0));
    return;
  }
  vec4 noise_here = texelFetch(noise, pixel, 0);
  if (value.xy == vec2(0.0)) {
    imageStore(cells, pixel, vec4(with_joined(2.0, 0), noise_here.xyz));
    for (int line = 0; line < lines; ++line) {
      imageStore(ways, ivec3(pixel, line), vec4(0.0));
    }
    return;
  }
  vec4 normal = texelFetch(normals, pixel, 0), slope = texelFetch(slopes, pixel, 0);
  int bits = 16;
  for (int bit = 0; bit < 9; ++bit) {
    if (bit != 4 && goes_on(pixel, ivec2(bit % 3 - 1, bit / 3 - 1), value, normal, slope)) {
      bits |= 1 << bit;
    }
  }
  float wavered = wobble > 0.0 ? wobble * texelFetch(wavering, pixel, 0).x : 0.0;
  float toward = float(degree) * (guiding_angle - wavered);
  vec2 z = times(value.xy, vec2(cos(toward), -sin(toward)));
  float angle = atan(z.y, z.x) / float(degree);
  float turn = angle * float(around) / TAU + 2.0;
  imageStore(cells, pixel, vec4(with_joined(turn, bits), noise_here.xyz));

  vec2 ray = pixel_ray(pixel, vec2(imageSize(cells)), across, shift);
  vec3 eye = direction_to_eye(ray, perspective != 0);
  // The camera's axes carried to the plane across the pixel's ray: `frames.view_frame`.
  float a = 1.0 / (1.0 + eye.z);
  vec3 x = vec3(1.0 - eye.x * eye.x * a, -eye.x * eye.y * a, -eye.x);
  vec3 y = vec3(-eye.x * eye.y * a, 1.0 - eye.y * eye.y * a, -eye.y);
  vec2 axis_x = on_screen(x, eye, normal.xyz, ray), axis_y = on_screen(y, eye, normal.xyz, ray);
  for (int line = 0; line < lines; ++line) {
    float at = angle + guiding_angle + TAU * float(line) / float(around);
    vec2 member = direction_of(vec2(cos(at), sin(at)), wavered, pixel);
    vec2 way = axis_x * member.x + axis_y * member.y;
    imageStore(ways, ivec3(pixel, line), vec4(foreshorten != 0 ? way : unit_or_zero(way), 0.0, 0.0));
  }
}
