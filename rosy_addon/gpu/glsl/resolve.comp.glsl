// Interpolate the record of the visible triangle into the G-buffer, for one instance: as `project` and
// `pixel_neighbors`, in the same order.

#include "triangle_record.glsl"

uniform float pixels_per_unit, instance_id, model_scale;
uniform int channel_count;
uniform ivec2 box_origin;
uniform vec2 lens_shift;
uniform vec4 clip_to_camera;
layout(rgba32f) uniform writeonly image2D normals, field_values, depth_slopes;
layout(rgba32f) uniform writeonly image2DArray field_channels;
#pragma constant(channel_count)

vec3 normal_to_camera(vec3 vector)
{
  return vec3(dot(model_view_x.xyz, vector), dot(model_view_y.xyz, vector),
              dot(model_view_z.xyz, vector)) / model_scale;
}

// The first axis of the frame of a normal (Duff et al. 2017), as `field.frames.tangent_frame`. If z is
// 0, the sign of the zero chooses one of two frames.
vec3 first_axis(vec3 n)
{
  float sign_ = (floatBitsToUint(n.z) >> 31) == 1u ? -1.0 : 1.0;
  float a = -1.0 / (sign_ + n.z);
  return vec3(1.0 + sign_ * n.x * n.x * a, sign_ * n.x * n.y * a, -sign_ * n.x);
}

vec2 squared_phase(vec2 a)
{
  return times(a, a) / max(dot(a, a), 1e-30);
}

// Barycentric coordinates; w is 1 if the triangle is front-facing.
vec4 barycentrics(Corners corners, vec2 ray)
{
  vec3 edges = edge_functions(corners, ray);
  float total = edges.x + edges.y + edges.z;
  float is_front = total >= 0.0 ? 1.0 : 0.0;
  // The rasterizer rounds corners, so the center of the pixel can be slightly outside the triangle.
  // Then the closest point of its border is used, instead of an extrapolation.
  vec3 weights = max(edges / total, 0.0);
  weights /= weights.x + weights.y + weights.z;
  return total == 0.0 ? vec4(vec3(1.0 / 3.0), is_front) : vec4(weights, is_front);
}

void main()
{
  ivec2 pixel = ivec2(gl_GlobalInvocationID.xy) + box_origin;
  ivec2 frame = imageSize(normals);
  if (any(greaterThanEqual(pixel, frame))) {
    return;
  }
  int triangle = visible_triangle(pixel);
  if (!is_of_instance(triangle)) {
    return;
  }
  Corners model_corners = corner_positions(triangle), model_normals = corner_normals(triangle);
  vec3 n0 = model_normals.first, n1 = model_normals.second, n2 = model_normals.third;
  vec2 ray = pixel_ray(pixel, vec2(frame), clip_to_camera, lens_shift);
  Corners corners = corners_to_camera(model_corners);
  vec4 weights = barycentrics(corners, ray);
  bool is_front = weights.w > 0.0;
  vec3 to_eye = direction_to_eye(ray, is_perspective != 0);

  vec3 edge1 = model_corners.second - model_corners.first;
  vec3 edge2 = model_corners.third - model_corners.first;
  vec3 plane_normal = unit_or_zero(cross(edge1, edge2));
  vec3 mean = weights.x * n0 + weights.y * n1 + weights.z * n2;
  float size = length(mean);
  bool is_degenerate = size < 1e-6;
  vec3 normal = is_degenerate ? plane_normal : mean / size;
  size = is_degenerate ? 0.0 : size;
  vec3 axis = normal_to_camera(parallel_transport(first_axis(n0), n0, normal));
  normal = normal_to_camera(normal);
  plane_normal = normal_to_camera(plane_normal);
  if (!is_front) {
    normal = -normal;
    plane_normal = -plane_normal;
  }

  // Parallel transport of the values at corners 1 and 2: a rotation by the signed area of a spherical
  // triangle (Van Oosterom and Strackee 1983).
  float d01 = dot(n0, n1), d02 = dot(n0, n2), d12 = dot(n1, n2);
  float triple_product = dot(n0, cross(n1, n2));
  float along0 = weights.x + weights.y * d01 + weights.z * d02;
  float along1 = weights.x * d01 + weights.y + weights.z * d12;
  float along2 = weights.x * d02 + weights.y * d12 + weights.z;
  vec2 transport1 = squared_phase(vec2(size * (1.0 + d01) + along0 + along1, weights.z * triple_product));
  vec2 transport2 = squared_phase(vec2(size * (1.0 + d02) + along0 + along2, -weights.y * triple_product));

  vec3 view_axis = parallel_transport(axis, normal, to_eye);
  float share = view_axis.z / (1.0 + to_eye.z);
  vec2 frame_phase = unit_or_zero(view_axis.xy - share * to_eye.xy);

  for (int channel = 0; channel <= channel_count; ++channel) {
    // Channel 0 is the representation. The record contains the order of rotation, and the layer.
    vec4 values = record_texel(triangle, VALUE_TEXEL + 2 * channel);
    vec4 values_2 = record_texel(triangle, VALUE_TEXEL + 2 * channel + 1);
    int order = int(values_2.z);
    vec2 z = weights.x * values.xy + weights.y * times(values.zw, signed_power(transport1, order)) +
             weights.z * times(values_2.xy, signed_power(transport2, order));
    // Seen from the back, angles have the opposite sense.
    z = times(is_front ? z : conjugate(z), signed_power(frame_phase, order));
    if (channel == 0) {
      // Its modulus is the magnitude, which is interpolated on its own.
      z = unit_or_zero(z) * dot(weights.xyz, record_texel(triangle, MAGNITUDE_TEXEL).xyz);
      imageStore(field_values, pixel, vec4(z, float(order), instance_id + 1.0));
    }
    else {
      imageStore(field_channels, ivec3(pixel, int(values_2.w)), vec4(z, 0.0, 0.0));
    }
  }

  float depth = -(weights.x * corners.first.z + weights.y * corners.second.z +
                  weights.z * corners.third.z);
  imageStore(normals, pixel, vec4(normal, is_front ? depth : -depth));

  // Inverse depth (depth if orthographic), which is linear on screen for planes, and its slopes.
  vec2 ray_dx = clip_to_camera.xz * 2.0 / float(frame.x);
  vec2 ray_dy = clip_to_camera.yw * 2.0 / float(frame.y);
  vec2 slope = vec2(dot(plane_normal.xy, ray_dx), dot(plane_normal.xy, ray_dy));
  vec3 position = vec3(ray * (is_perspective != 0 ? depth : 1.0), -depth);
  float divisor = is_perspective != 0 ? dot(plane_normal, position) : -plane_normal.z;
  slope /= abs(divisor) < 1e-12 ? -1e-12 : divisor;
  float unit = pixels_per_unit * (is_perspective != 0 ? depth : 1.0);
  float steepness = length(slope) * unit;
  float limit = min(1.0, MAX_SLOPE / max(steepness, 1e-12));
  float tolerance = (steepness * limit * SLOPE_TOLERANCE + DEPTH_TOLERANCE) / unit;
  float linear_depth = is_perspective != 0 ? 1.0 / depth : -depth;
  imageStore(depth_slopes, pixel, vec4(linear_depth, slope * limit, tolerance));
}
