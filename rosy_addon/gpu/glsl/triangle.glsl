// What is known of the triangle that a pixel sees, for passes that are told of one body.

// The part of a triangle's record that a texel holds. Rows are powers of two, as division is slow.
vec4 record(int number, int part)
{
  int at = number * texels + part;
  return texelFetch(triangles, ivec2(at & ((1 << row_bits) - 1), at >> row_bits), 0);
}

vec3 placed(vec3 point)
{
  vec4 p = vec4(point, 1.0);
  return vec3(dot(place_x, p), dot(place_y, p), dot(place_z, p));
}

// How far a corner is from a ray through the picture, times its depth.
vec2 beside(vec3 point, vec2 ray)
{
  return perspective != 0 ? point.xy + ray * point.z : point.xy - ray;
}

// Homogeneous edge functions relative to the pixel (Olano and Greer 1997).
vec3 edges_at(vec3 a, vec3 b, vec3 c, vec2 ray)
{
  vec2 p = beside(a, ray), q = beside(b, ray), r = beside(c, ray);
  return vec3(q.x * r.y - r.x * q.y, r.x * p.y - p.x * r.y, p.x * q.y - q.x * p.y);
}
