// Evenly spaced lines at the pixels of one instance, as `even_lines._evaluate`: the distance of a pixel from
// the middle of the nearest line, the distance between lines in pixels, and the width of new lines that grow
// between these lines.

#include "triangle_record.glsl"
#include "screen_direction.glsl"
#include "line_member.glsl"

uniform sampler2D line_records, normals, field_values, wobble_angles;
uniform float guiding_angle, wobble_strength, wobble_shift, spacing_pixels, asked_pixels;
uniform int line_count, node_count, first_layer;
uniform ivec2 box_origin;
uniform vec2 lens_shift;
uniform vec4 clip_to_camera;
layout(rgba16f) uniform writeonly image2DArray line_image;

vec4 line_texel(int index)
{
  return texelFetch(line_records, ivec2(index & ((1 << ROW_BITS) - 1), index >> ROW_BITS), 0);
}

// The same function as `stripe_pattern._turn_fraction`.
float turn_fraction(vec3 weights)
{
  float smallest = min(weights.x, min(weights.y, weights.z));
  int opposite = weights.x == smallest ? 0 : (weights.y == smallest ? 1 : 2);
  int tail = opposite == 2 ? 0 : opposite + 1;
  float head_weight = opposite == 0 ? weights.z : (opposite == 1 ? weights.x : weights.y);
  float fraction = (head_weight - smallest) / max(1.0 - 3.0 * smallest, 1e-6);
  return (float(tail) + clamp(fraction, 0.0, 1.0)) / 3.0;
}

void main()
{
  ivec2 pixel = ivec2(gl_GlobalInvocationID.xy) + box_origin;
  ivec2 frame = imageSize(line_image).xy;
  if (any(greaterThanEqual(pixel, frame))) {
    return;
  }
  int triangle = visible_triangle(pixel);
  if (!is_of_instance(triangle)) {
    return;
  }
  vec2 ray = pixel_ray(pixel, vec2(frame), clip_to_camera, lens_shift);
  vec3 eye = direction_to_eye(ray, is_perspective != 0);
  Corners corners = corners_to_camera(corner_positions(triangle));
  vec3 edges = edge_functions(corners, ray);
  float total = edges.x + edges.y + edges.z;
  vec3 weights = total == 0.0 ? vec3(1.0 / 3.0) : max(edges / total, 0.0);
  weights /= weights.x + weights.y + weights.z;
  bool is_front = total >= 0.0;

  // Descend to the leaf that contains the pixel, as `BisectionTree.locate`.
  int leaf = triangle, node = triangle;
  for (int level = 0; level < MAX_TREE_DEPTH && node_count > 0; ++level) {
    vec4 texel = line_texel(node);
    if (texel.x < 0.0) {
      leaf = int(texel.z);
      break;
    }
    vec3 turned = texel.y == 0.0 ? weights : (texel.y == 1.0 ? weights.yzx : weights.zxy);
    bool is_second = turned.y > turned.x;
    weights = is_second ? vec3(2.0 * turned.x, turned.y - turned.x, turned.z) :
                          vec3(turned.x - turned.y, 2.0 * turned.y, turned.z);
    node = int(texel.x) + (is_second ? 1 : 0);
  }
  int record = node_count + leaf * (1 + line_count);

  vec3 side1 = corners.second - corners.first, side2 = corners.third - corners.first;
  vec3 plane_normal = unit_or_zero(cross(side1, side2));
  plane_normal = is_front ? plane_normal : -plane_normal;
  vec2 heading_sides = line_texel(record).xy;
  vec3 tangent = heading_sides.x * side1 + heading_sides.y * side2;
  vec3 heading = parallel_transport(tangent, plane_normal, eye);
  vec2 view_heading = unit_or_zero(heading.xy - heading.z / (1.0 + eye.z) * eye.xy);

  float wobble = wobble_strength > 0.0 ?
                     wobble_strength * texelFetch(wobble_angles, pixel, 0).x :
                     0.0;
  vec4 value = texelFetch(field_values, pixel, 0);
  float frame_angle = float(degree) * (guiding_angle - wobble);
  vec2 z = times(value.xy, vec2(cos(frame_angle), -sin(frame_angle)));
  float angle = angle_of(z) / float(degree) + guiding_angle;
  vec2 relative = times(vec2(cos(angle), sin(angle)), conjugate(view_heading));
  int first_direction = int(round(angle_of(relative) * float(degree) / TAU));

  // The camera's axes, transported to the plane perpendicular to the ray, as in `frames`.
  float a = 1.0 / (1.0 + eye.z);
  vec4 normal = texelFetch(normals, pixel, 0);
  vec3 x = vec3(1.0 - eye.x * eye.x * a, -eye.x * eye.y * a, -eye.x);
  vec3 y = vec3(-eye.x * eye.y * a, 1.0 - eye.y * eye.y * a, -eye.y);
  vec2 screen_x = screen_direction(x, eye, normal.xyz, ray);
  vec2 screen_y = screen_direction(y, eye, normal.xyz, ray);
  float across = abs(screen_x.x * screen_y.y - screen_x.y * screen_y.x);
  float spacing = spacing_pixels / (is_perspective != 0 ? abs(normal.w) : 1.0);
  float octaves = asked_pixels > 0.0 ? max(log2(max(spacing / asked_pixels, 1e-9)), 0.0) : 0.0;
  float doublings = floor(octaves);
  float growth = clamp((octaves - doublings - GROWTH_START) / (GROWTH_STOP - GROWTH_START), 0.0, 1.0);
  growth *= growth * (3.0 - 2.0 * growth);

  for (int line = 0; line < line_count; ++line) {
    int member = line_member(line);
    int direction = (is_front ? 1 : -1) * (first_direction + member);
    int family = modulo(modulo(direction, degree), line_count);
    vec4 phases = line_texel(record + 1 + family);
    float phase = dot(weights, phases.xyz);
    if (phases.w != 0.0) {
      phase += phases.w * turn_fraction(weights);
    }
    phase = (phase + wobble_shift * wobble) * exp2(doublings);
    float member_angle = angle + TAU * float(member) / float(degree);
    vec2 along = member_direction(vec2(cos(member_angle), sin(member_angle)), wobble, pixel);
    float along_length = length(screen_x * along.x + screen_y * along.y);
    float period = value.xy == vec2(0.0) || view_heading == vec2(0.0) ?
                       0.0 :
                       spacing * exp2(-doublings) * across / max(along_length, 1e-6);
    float streak = 1.0 - 2.0 * abs(phase - round(phase));
    imageStore(line_image, ivec3(pixel, first_layer + line), vec4(streak, min(period, 6e4), growth, 0.0));
  }
}
