uniform sampler2DArray field_channels;
uniform float guiding_angle;
uniform int degree, sheet_count, family_count, family_channel;

// The families of labeled directions at a pixel: the angle of the channel that stores them, and the number of
// families, which is 1 at a pixel without labels.
struct Families {
  float angle;
  int count;
};

Families families_at(ivec2 pixel)
{
  if (family_count == 1) {
    return Families(0.0, 1);
  }
  vec2 value = texelFetch(field_channels, ivec3(pixel, family_channel), 0).xy;
  return Families(angle_of(value), value == vec2(0.0) ? 1 : family_count);
}

// The index of the family of a line, as in `family_hues`. `line_angle` is the angle of line 0.
int line_family(int line, float line_angle, Families families)
{
  // For odd N, every other line is the opposite half of a member.
  float opposite = (sheet_count > degree && (degree & line & 1) == 1) ? 0.5 * TAU : 0.0;
  float angle = line_angle + guiding_angle + opposite + TAU * float(line) / float(sheet_count);
  float forward = (angle * float(degree) - families.angle * float(family_count)) / TAU;
  return modulo(int(round(forward)), families.count);
}
