// The fraction of a light that reaches a pixel, by percentage-closer filtering of a shadow map, as in
// `shadow_maps`. If a light has several shadow maps, their results are multiplied.

uniform sampler2D normals, shadow_map, previous_visibility;
uniform float normal_bias;
uniform int is_perspective, light_is_perspective, is_first;
uniform ivec2 box_origin;
uniform vec2 lens_shift;
uniform vec4 clip_to_camera, light_view_x, light_view_y, light_view_z, light_projection_x;
uniform vec4 light_projection_y;
layout(rgba16f) uniform writeonly image2D shadow_visibility;

void main()
{
  ivec2 pixel = ivec2(gl_GlobalInvocationID.xy) + box_origin;
  ivec2 frame = imageSize(shadow_visibility);
  if (any(greaterThanEqual(pixel, frame))) {
    return;
  }
  vec4 normal = texelFetch(normals, pixel, 0);
  vec2 ray = pixel_ray(pixel, vec2(frame), clip_to_camera, lens_shift);
  float depth = abs(normal.w);
  vec4 position = vec4(ray * (is_perspective != 0 ? depth : 1.0), -depth, 1.0);
  vec3 light_position = vec3(dot(light_view_x, position), dot(light_view_y, position),
                             dot(light_view_z, position));
  vec3 light_normal = vec3(dot(light_view_x.xyz, normal.xyz), dot(light_view_y.xyz, normal.xyz),
                           dot(light_view_z.xyz, normal.xyz));
  light_position += normal_bias * (light_is_perspective != 0 ? abs(light_position.z) : 1.0) * light_normal;
  float depth_in_light = -light_position.z;
  float divisor = light_is_perspective != 0 && depth_in_light > 0.0 ? depth_in_light : 1.0;
  vec4 point = vec4(light_position, 1.0);
  vec2 map_position = vec2(dot(light_projection_x, point), dot(light_projection_y, point)) / divisor;
  float visible = is_first != 0 ? 1.0 : texelFetch(previous_visibility, pixel, 0).x;
  if (depth_in_light > 0.0 && all(lessThanEqual(abs(map_position), vec2(1.0)))) {
    ivec2 size = textureSize(shadow_map, 0);
    vec2 low = (map_position * 0.5 + 0.5) * vec2(size) - 0.5 * float(PCF_WIDTH);
    vec2 first = floor(low);
    vec2 fraction = low - first;
    float hidden = 0.0;
    for (int row = 0; row <= PCF_WIDTH; ++row) {
      float row_weight = row == 0 ? 1.0 - fraction.y : (row == PCF_WIDTH ? fraction.y : 1.0);
      for (int column = 0; column <= PCF_WIDTH; ++column) {
        // The window covers the first and the last texel partly; together they weigh as much as one texel.
        float column_weight = column == 0 ? 1.0 - fraction.x : (column == PCF_WIDTH ? fraction.x : 1.0);
        ivec2 texel = clamp(ivec2(first) + ivec2(column, row), ivec2(0), size - 1);
        float occluder_depth = texelFetch(shadow_map, texel, 0).x;
        bool is_hidden = occluder_depth > 0.0 && occluder_depth < depth_in_light;
        hidden += is_hidden ? row_weight * column_weight : 0.0;
      }
    }
    visible *= max(1.0 - hidden / float(PCF_WIDTH * PCF_WIDTH), 0.0);
  }
  imageStore(shadow_visibility, pixel, vec4(visible, 0.0, 0.0, 1.0));
}
