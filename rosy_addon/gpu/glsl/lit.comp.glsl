// What one light adds to those before, by Lambert's law (`shading.diffuse`). A light is where it is
// (kind 1), the direction to it (0), or the eye (2).

void main()
{
  ivec2 pixel = ivec2(gl_GlobalInvocationID.xy) + corner;
  ivec2 frame = imageSize(lit);
  if (any(greaterThanEqual(pixel, frame))) {
    return;
  }
  vec4 normal = texelFetch(normals, pixel, 0);
  vec2 ray = pixel_ray(pixel, vec2(frame), across, shift);
  float depth = abs(normal.w);
  vec3 position = vec3(ray * (perspective != 0 ? depth : 1.0), -depth);
  vec3 way = kind == 2 ? direction_to_eye(ray, perspective != 0) :
             kind == 1 ? source.xyz - position :
                         source.xyz;
  float squared = kind == 1 ? max(dot(way, way), 1e-12) : 1.0;
  vec3 given = colour.xyz * max(dot(normal.xyz, unit_or_zero(way)), 0.0) / squared;
  given *= shadowed != 0 ? texelFetch(reach, pixel, 0).x : 1.0;
  vec3 before = first_time != 0 ? vec3(0.0) : texelFetch(lit_before, pixel, 0).xyz;
  imageStore(lit, pixel, vec4(before + given, 1.0));
}
