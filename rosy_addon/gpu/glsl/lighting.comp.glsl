// Add the diffuse light of one light source (Lambert), as `shading.diffuse`. `light_vector` is the
// position of a point light or the direction to a sun. A headlight is at the eye.

uniform sampler2D normals, shadow_visibility, previous_lighting;
uniform int is_perspective, light_kind, is_shadowed, is_first;
uniform ivec2 box_origin;
uniform vec2 lens_shift;
uniform vec4 clip_to_camera, light_vector, light_color;
layout(rgba32f) uniform writeonly image2D lighting;
#pragma constant(light_kind, is_shadowed, is_first)

void main()
{
  ivec2 pixel = ivec2(gl_GlobalInvocationID.xy) + box_origin;
  ivec2 frame = imageSize(lighting);
  if (any(greaterThanEqual(pixel, frame))) {
    return;
  }
  vec4 normal = texelFetch(normals, pixel, 0);
  vec2 ray = pixel_ray(pixel, vec2(frame), clip_to_camera, lens_shift);
  float depth = abs(normal.w);
  vec3 position = vec3(ray * (is_perspective != 0 ? depth : 1.0), -depth);
  vec3 to_light = light_kind == HEADLIGHT ? direction_to_eye(ray, is_perspective != 0) :
             light_kind == POINT_LIGHT ? light_vector.xyz - position :
                         light_vector.xyz;
  float distance_squared = light_kind == POINT_LIGHT ? max(dot(to_light, to_light), 1e-12) : 1.0;
  vec3 light = light_color.xyz * max(dot(normal.xyz, unit_or_zero(to_light)), 0.0) / distance_squared;
  light *= is_shadowed != 0 ? texelFetch(shadow_visibility, pixel, 0).x : 1.0;
  vec3 previous = is_first != 0 ? vec3(0.0) : texelFetch(previous_lighting, pixel, 0).xyz;
  imageStore(lighting, pixel, vec4(previous + light, 1.0));
}
