// Included by all passes. Complex numbers are vec2. Pixels are counted from the lower left, as in the
// numpy rooms. Vectors are in camera space unless a comment says otherwise.

#define TAU 6.28318530718

vec2 times(vec2 a, vec2 b)
{
  return vec2(a.x * b.x - a.y * b.y, a.x * b.y + a.y * b.x);
}

// Floored modulo. The half makes the quotient safe: float division is inexact on graphics cards, and
// integer division is slow.
int modulo(int value, int divisor)
{
  return value - divisor * int(floor((float(value) + 0.5) / float(divisor)));
}

// Modulo of a value in [-divisor, 2 divisor).
int wrap_once(int value, int divisor)
{
  return value < 0 ? value + divisor : (value >= divisor ? value - divisor : value);
}

vec2 conjugate(vec2 a)
{
  return vec2(a.x, -a.y);
}

// An integer power of a number of modulus 1. For negative orders, its conjugate is used.
vec2 signed_power(vec2 value, int order)
{
  vec2 result = vec2(1.0, 0.0);
  vec2 square = order < 0 ? conjugate(value) : value;
  for (int remaining = abs(order); remaining > 0; remaining >>= 1) {
    if ((remaining & 1) == 1) {
      result = times(result, square);
    }
    square = times(square, square);
  }
  return result;
}

float smooth_unit_step(float x)
{
  x = clamp(x, 0.0, 1.0);
  return x * x * (3.0 - 2.0 * x);
}

// The angle of 0 is 0; GLSL leaves it undefined.
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
vec3 parallel_transport(vec3 tangent, vec3 from, vec3 to)
{
  float divisor = max(1.0 + dot(from, to), 1.2e-7);
  return tangent - dot(tangent, to) / divisor * (from + to);
}

// Where the ray through the center of a pixel meets the plane at depth 1 (at any depth if
// orthographic).
vec2 pixel_ray(ivec2 pixel, vec2 size, vec4 clip_to_ray, vec2 offset)
{
  vec2 clip = (vec2(pixel) + 0.5) * 2.0 / size - 1.0 + offset;
  return vec2(dot(clip_to_ray.xy, clip), dot(clip_to_ray.zw, clip));
}

// The unit vector towards the eye.
vec3 direction_to_eye(vec2 ray, bool perspective)
{
  return perspective ? normalize(vec3(-ray, 1.0)) : vec3(0.0, 0.0, 1.0);
}

// sRGB display values to linear light (IEC 61966-2-1).
vec3 to_linear(vec3 display)
{
  display = clamp(display, 0.0, 1.0);
  vec3 curve = pow((display + 0.055) / 1.055, vec3(2.4));
  return mix(curve, display / 12.92, lessThanEqual(display, vec3(0.04045)));
}

// The last nine bits of a phase are a mask of the 3 x 3 neighbors on which the surface continues.
int neighbor_mask(float phase)
{
  return int(floatBitsToUint(phase) & uint(ALL_NEIGHBORS));
}

float with_neighbor_mask(float phase, int bits)
{
  return uintBitsToFloat((floatBitsToUint(phase) & ~uint(ALL_NEIGHBORS)) | uint(bits));
}
