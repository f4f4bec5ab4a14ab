// From the triangle that a pixel sees to its entry in the G-buffer, for one body: `project._fill`
// and `steps._slopes`, on the same data in the same order.

vec3 rotated(vec3 vector)
{
  return vec3(dot(place_x.xyz, vector), dot(place_y.xyz, vector), dot(place_z.xyz, vector)) / scale;
}

// The first axis of the frame of a normal (Duff et al. 2017), as `field.frames.tangent_frame`: there
// are two frames where z is 0, and the sign of that 0 tells which.
vec3 first_axis(vec3 n)
{
  float way = (floatBitsToUint(n.z) >> 31) == 1u ? -1.0 : 1.0;
  float a = -1.0 / (way + n.z);
  return vec3(1.0 + way * n.x * n.x * a, way * n.x * n.y * a, -way * n.x);
}

vec2 squared_phase(vec2 a)
{
  return times(a, a) / max(dot(a, a), 1e-30);
}

// Barycentrics; w is 1 if the triangle is seen from its front.
vec4 barycentrics(vec3 a, vec3 b, vec3 c, vec2 ray)
{
  vec3 edges = edges_at(a, b, c, ray);
  float total = edges.x + edges.y + edges.z;
  float front = total >= 0.0 ? 1.0 : 0.0;
  // The rasteriser rounds corners, so that the pixel may be a little beside the triangle: what is
  // taken then is of its border, not a sum of more than 1, which lies nearer or farther away.
  vec3 weights = max(edges / total, 0.0);
  weights /= weights.x + weights.y + weights.z;
  return total == 0.0 ? vec4(vec3(1.0 / 3.0), front) : vec4(weights, front);
}

void main()
{
  ivec2 pixel = ivec2(gl_GlobalInvocationID.xy) + corner;
  ivec2 frame = imageSize(normals);
  if (any(greaterThanEqual(pixel, frame))) {
    return;
  }
  vec2 which = texelFetch(seen, pixel, 0).xy;
  if (which.x != body + 1.0) {
    return;
  }
  int number = int(which.y);
  vec4 first = record(number, 0), second = record(number, 1), third = record(number, 2);
  vec3 n0 = record(number, 3).xyz, n1 = record(number, 4).xyz, n2 = record(number, 5).xyz;
  vec2 ray = pixel_ray(pixel, vec2(frame), across, shift);
  vec3 a = placed(first.xyz), b = placed(second.xyz), c = placed(third.xyz);
  vec4 weights = barycentrics(a, b, c, ray);
  bool front = weights.w > 0.0;
  vec3 toward_eye = direction_to_eye(ray, perspective != 0);

  vec3 plane_normal = unit_or_zero(cross(second.xyz - first.xyz, third.xyz - first.xyz));
  vec3 mean = weights.x * n0 + weights.y * n1 + weights.z * n2;
  float size = length(mean);
  bool lost = size < 1e-6;
  vec3 normal = lost ? plane_normal : mean / size;
  size = lost ? 0.0 : size;
  vec3 axis = rotated(carry(first_axis(n0), n0, normal));
  normal = rotated(normal);
  plane_normal = rotated(plane_normal);
  if (!front) {
    normal = -normal;
    plane_normal = -plane_normal;
  }

  // The rotation through the signed area of the spherical triangle that a corner's value has come
  // around (Van Oosterom and Strackee 1983).
  float d01 = dot(n0, n1), d02 = dot(n0, n2), d12 = dot(n1, n2);
  float volume = dot(n0, cross(n1, n2));
  float along0 = weights.x + weights.y * d01 + weights.z * d02;
  float along1 = weights.x * d01 + weights.y + weights.z * d12;
  float along2 = weights.x * d02 + weights.y * d12 + weights.z;
  vec2 slip1 = squared_phase(vec2(size * (1.0 + d01) + along0 + along1, weights.z * volume));
  vec2 slip2 = squared_phase(vec2(size * (1.0 + d02) + along0 + along2, -weights.y * volume));

  vec3 turned = carry(axis, normal, toward_eye);
  float share = turned.z / (1.0 + toward_eye.z);
  vec2 turn = unit_or_zero(turned.xy - share * toward_eye.xy);

  for (int kind = 0; kind <= traits; ++kind) {
    // The representation first, then what the field has besides; the order is with the record.
    vec4 values = record(number, 6 + 2 * kind), more = record(number, 7 + 2 * kind);
    int order = int(more.z);
    vec2 z = weights.x * values.xy + weights.y * times(values.zw, signed_power(slip1, order)) +
             weights.z * times(more.xy, signed_power(slip2, order));
    // The members stay where they are in space; seen from behind, angles run the other way.
    z = times(front ? z : conjugate(z), signed_power(turn, order));
    if (kind == 0) {
      imageStore(values_seen, pixel, vec4(z, float(order), body + 1.0));
    }
    else {
      imageStore(traits_seen, ivec3(pixel, int(more.w)), vec4(z, 0.0, 0.0));
    }
  }

  float depth = -(weights.x * a.z + weights.y * b.z + weights.z * c.z);
  imageStore(normals, pixel, vec4(normal, front ? depth : -depth));

  // A quantity of which planes are linear functions on screen, and how it goes on: `steps._slopes`.
  vec2 per_column = across.xz * 2.0 / float(frame.x), per_row = across.yw * 2.0 / float(frame.y);
  vec2 slope = vec2(dot(plane_normal.xy, per_column), dot(plane_normal.xy, per_row));
  vec3 position = vec3(ray * (perspective != 0 ? depth : 1.0), -depth);
  float divisor = perspective != 0 ? dot(plane_normal, position) : -plane_normal.z;
  slope /= abs(divisor) < 1e-12 ? -1e-12 : divisor;
  float unit = pixels_per_unit * (perspective != 0 ? depth : 1.0);
  float steep = length(slope) * unit;
  float limit = min(1.0, STEEPEST / max(steep, 1e-12));
  float tolerance = (steep * limit * OBLIQUE_TOLERANCE + TOLERANCE) / unit;
  imageStore(slopes, pixel, vec4(perspective != 0 ? 1.0 / depth : -depth, slope * limit, tolerance));
}
