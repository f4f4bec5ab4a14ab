// What several passes share. Complex numbers are vec2; images have pixels, counted from the lower
// left, as the numpy rooms do, and vectors are in camera space unless a comment says otherwise.

#define TAU 6.28318530718

vec2 times(vec2 a, vec2 b)
{
  return vec2(a.x * b.x - a.y * b.y, a.x * b.y + a.y * b.x);
}

// Modulo a positive number. Halves make sure of the quotient: cards divide inexactly, and whole
// numbers slowly.
int modulo(int number, int divisor)
{
  return number - divisor * int(floor((float(number) + 0.5) / float(divisor)));
}

// Modulo a positive number, of one that is less than that number out of range.
int wrapped(int number, int divisor)
{
  return number < 0 ? number + divisor : (number >= divisor ? number - divisor : number);
}

vec2 conjugate(vec2 a)
{
  return vec2(a.x, -a.y);
}

// A number of modulus 1 to a whole power, to a negative one by its conjugate.
vec2 signed_power(vec2 number, int order)
{
  vec2 result = vec2(1.0, 0.0);
  vec2 square = order < 0 ? conjugate(number) : number;
  for (int left = abs(order); left > 0; left >>= 1) {
    if ((left & 1) == 1) {
      result = times(result, square);
    }
    square = times(square, square);
  }
  return result;
}

// That of 0 is 0; GLSL leaves it open.
float angle_of(vec2 a)
{
  return a == vec2(0.0) ? 0.0 : atan(a.y, a.x);
}

vec2 unit_or_zero(vec2 a)
{
  float size = length(a);
  return size > 0.0 ? a / size : vec2(0.0);
}

vec3 unit_or_zero(vec3 a)
{
  float size = length(a);
  return size > 0.0 ? a / size : vec3(0.0);
}

// Rotate a tangent along the shortest arc between two normals: v - (v.t) / (1 + s.t) (s + t).
vec3 carry(vec3 tangent, vec3 from, vec3 to)
{
  float divisor = max(1.0 + dot(from, to), 1.2e-7);
  return tangent - dot(tangent, to) / divisor * (from + to);
}

// Where the ray through the centre of a pixel meets the plane at depth 1; any if orthographic.
vec2 pixel_ray(ivec2 pixel, vec2 size, vec4 inverse_, vec2 lens_shift)
{
  vec2 clip = (vec2(pixel) + 0.5) * 2.0 / size - 1.0 + lens_shift;
  return vec2(dot(inverse_.xy, clip), dot(inverse_.zw, clip));
}

vec3 direction_to_eye(vec2 ray, bool from_a_point)
{
  return from_a_point ? normalize(vec3(-ray, 1.0)) : vec3(0.0, 0.0, 1.0);
}

// sRGB display values to linear light (IEC 61966-2-1).
vec3 to_linear(vec3 display)
{
  display = clamp(display, 0.0, 1.0);
  vec3 curve = pow((display + 0.055) / 1.055, vec3(2.4));
  return mix(curve, display / 12.92, lessThanEqual(display, vec3(0.04045)));
}

// The bits of a float, and which of its 3 x 3 neighbours a pixel is joined to in the last nine.
#define OPEN 511u

int joined_to(float turn)
{
  return int(floatBitsToUint(turn) & OPEN);
}

float with_joined(float turn, int bits)
{
  return uintBitsToFloat((floatBitsToUint(turn) & ~OPEN) | uint(bits));
}
