// The angle from the guiding angle to line 0 of a pixel, in the view plane, with wobble. `z` is its
// representation.
float line_angle_of(ivec2 pixel, vec2 z)
{
  // Without wobble, the texture has another size.
  float wobble = wobble_strength > 0.0 ?
                     wobble_strength * texelFetch(wobble_angles, pixel, 0).x :
                     0.0;
  float frame_angle = float(degree) * (guiding_angle - wobble);
  return angle_of(times(z, vec2(cos(frame_angle), -sin(frame_angle)))) / float(degree);
}

// The family of a line, as `family_hues`, from the angle of line 0 and the stored angle of the
// families. `known_families` is the number of families, or 1 at a pixel without families.
int line_family(int line, float first_angle, float family_angle, int known_families)
{
  // For odd N, every other line is the opposite half of a member.
  float opposite = (sheet_count > degree && (degree & line & 1) == 1) ? 0.5 * TAU : 0.0;
  float angle = first_angle + opposite + TAU * float(line) / float(sheet_count);
  float forward = (angle * float(degree) - family_angle * float(family_count)) / TAU;
  return modulo(int(round(forward)), known_families);
}
