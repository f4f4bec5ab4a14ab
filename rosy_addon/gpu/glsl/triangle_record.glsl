// The triangles of one instance, and their records (`mesh_buffers`).

uniform sampler2D visibility, triangle_records;
uniform int is_perspective, first_triangle_id, triangle_count, texels_per_record;
uniform vec4 model_view_x, model_view_y, model_view_z;

// The index of the triangle that is visible at a pixel; outside of [0, triangle_count) if the triangle
// belongs to another instance.
int visible_triangle(ivec2 pixel)
{
  return floatBitsToInt(texelFetch(visibility, pixel, 0).x) - first_triangle_id;
}

bool is_of_instance(int triangle)
{
  return triangle >= 0 && triangle < triangle_count;
}

// A texel of a record. Row lengths are powers of two because integer division is slow.
vec4 record_texel(int triangle, int texel)
{
  int index = triangle * texels_per_record + texel;
  return texelFetch(triangle_records, ivec2(index & ((1 << ROW_BITS) - 1), index >> ROW_BITS), 0);
}

// Transform a point from model space to camera space.
vec3 to_camera(vec3 point)
{
  vec4 p = vec4(point, 1.0);
  return vec3(dot(model_view_x, p), dot(model_view_y, p), dot(model_view_z, p));
}

// A vector at each corner of a triangle.
struct Corners {
  vec3 first;
  vec3 second;
  vec3 third;
};

Corners corner_positions(int triangle)
{
  return Corners(record_texel(triangle, POSITION_TEXEL).xyz, record_texel(triangle, POSITION_TEXEL + 1).xyz,
                 record_texel(triangle, POSITION_TEXEL + 2).xyz);
}

Corners corner_normals(int triangle)
{
  return Corners(record_texel(triangle, NORMAL_TEXEL).xyz, record_texel(triangle, NORMAL_TEXEL + 1).xyz,
                 record_texel(triangle, NORMAL_TEXEL + 2).xyz);
}

// The rest positions of the corners. In a record, x is in the fourth components of the positions, y in the
// fourth components of the normals, and z in the last texel.
Corners rest_positions(int triangle)
{
  vec3 z = record_texel(triangle, texels_per_record - 1).xyz;
  return Corners(
      vec3(record_texel(triangle, POSITION_TEXEL).w, record_texel(triangle, NORMAL_TEXEL).w, z.x),
      vec3(record_texel(triangle, POSITION_TEXEL + 1).w, record_texel(triangle, NORMAL_TEXEL + 1).w, z.y),
      vec3(record_texel(triangle, POSITION_TEXEL + 2).w, record_texel(triangle, NORMAL_TEXEL + 2).w, z.z));
}

Corners corners_to_camera(Corners points)
{
  return Corners(to_camera(points.first), to_camera(points.second), to_camera(points.third));
}

vec3 interpolated(Corners values, vec3 weights)
{
  return weights.x * values.first + weights.y * values.second + weights.z * values.third;
}

// The offset of a point from a ray, times the depth of the point if perspective.
vec2 relative_to_ray(vec3 point, vec2 ray)
{
  return is_perspective != 0 ? point.xy + ray * point.z : point.xy - ray;
}

// Homogeneous edge functions relative to the pixel (Olano and Greer 1997).
vec3 edge_functions(Corners corners, vec2 ray)
{
  vec2 p = relative_to_ray(corners.first, ray);
  vec2 q = relative_to_ray(corners.second, ray);
  vec2 r = relative_to_ray(corners.third, ray);
  return vec3(q.x * r.y - r.x * q.y, r.x * p.y - p.x * r.y, p.x * q.y - q.x * p.y);
}

// Barycentric coordinates of the point of a triangle that is visible at a pixel.
vec3 weights_at(Corners corners, vec2 ray)
{
  vec3 edges = edge_functions(corners, ray);
  float total = edges.x + edges.y + edges.z;
  vec3 weights = total == 0.0 ? vec3(1.0 / 3.0) : max(edges / total, 0.0);
  return weights / (weights.x + weights.y + weights.z);
}
