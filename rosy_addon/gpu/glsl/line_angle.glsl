uniform sampler2D wobble_angles;
uniform float guiding_angle, wobble_strength;
uniform int degree;

// The angle from the guiding angle to line 0 of a pixel, in the view plane, with wobble. `z` is the
// representation of the field at the pixel.
float line_angle_of(ivec2 pixel, vec2 z)
{
  // Without wobble, the texture has another size.
  float wobble = wobble_strength > 0.0 ?
                     wobble_strength * texelFetch(wobble_angles, pixel, 0).x :
                     0.0;
  float frame_angle = float(degree) * (guiding_angle - wobble);
  return angle_of(times(z, vec2(cos(frame_angle), -sin(frame_angle)))) / float(degree);
}
