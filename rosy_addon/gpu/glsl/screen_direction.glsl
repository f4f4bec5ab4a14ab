// Directions on screen, for passes over the pixels of a field.

uniform sampler2DArray field_channels;
uniform int is_perspective, harmonic_count, first_harmonic;
uniform vec4 camera_to_pixels;

// A tangent of the view plane, transported to the surface and projected to the screen, in pixels.
vec2 screen_direction(vec3 tangent, vec3 toward_eye, vec3 normal, vec2 ray)
{
  vec3 tangent_on_surface = parallel_transport(tangent, toward_eye, normal);
  vec2 in_plane = is_perspective != 0 ?
                      tangent_on_surface.xy + tangent_on_surface.z * ray :
                      tangent_on_surface.xy;
  return vec2(dot(camera_to_pixels.xy, in_plane), dot(camera_to_pixels.zw, in_plane));
}

// The unit direction of the field that belongs to a member. For evenly spaced directions it is the member
// itself. Otherwise it deviates from the member, by a function of the member without `wobble`.
vec2 member_direction(vec2 member, float wobble, ivec2 pixel)
{
  if (harmonic_count == 0) {
    return member;
  }
  vec2 unwobbled = times(member, vec2(cos(wobble), -sin(wobble)));
  vec2 total = vec2(0.0);
  for (int layer = 0; layer < harmonic_count; ++layer) {
    vec4 harmonic = texelFetch(field_channels, ivec3(pixel, layer), 0);
    total += times(harmonic.xy, signed_power(unwobbled, first_harmonic + layer));
  }
  return unit_or_zero(times(member, total));
}
