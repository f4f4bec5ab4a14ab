// The share of a light's rays that nothing stops on their way to a pixel: `shadows.open_to`, for one
// of the views that a light has. What earlier views have found is multiplied with it.

void main()
{
  ivec2 pixel = ivec2(gl_GlobalInvocationID.xy) + corner;
  ivec2 frame = imageSize(reach);
  if (any(greaterThanEqual(pixel, frame))) {
    return;
  }
  vec4 normal = texelFetch(normals, pixel, 0);
  vec2 ray = pixel_ray(pixel, vec2(frame), across, shift);
  float depth = abs(normal.w);
  vec4 position = vec4(ray * (perspective != 0 ? depth : 1.0), -depth, 1.0);
  vec3 place = vec3(dot(lamp_x, position), dot(lamp_y, position), dot(lamp_z, position));
  vec3 turned = vec3(dot(lamp_x.xyz, normal.xyz), dot(lamp_y.xyz, normal.xyz), dot(lamp_z.xyz, normal.xyz));
  place += offset_of_pixel * (lamp_perspective != 0 ? abs(place.z) : 1.0) * turned;
  float ahead = -place.z;
  float divisor = lamp_perspective != 0 && ahead > 0.0 ? ahead : 1.0;
  vec2 at = vec2(dot(lens_x, vec4(place, 1.0)), dot(lens_y, vec4(place, 1.0))) / divisor;
  float share = first_time != 0 ? 1.0 : texelFetch(reach_before, pixel, 0).x;
  if (ahead > 0.0 && all(lessThanEqual(abs(at), vec2(1.0)))) {
    ivec2 size = textureSize(shadow, 0);
    vec2 low = (at * 0.5 + 0.5) * vec2(size) - 0.5 * float(WIDTH);
    vec2 first = floor(low);
    vec2 part = low - first;
    float hidden = 0.0;
    for (int row = 0; row <= WIDTH; ++row) {
      float up = row == 0 ? 1.0 - part.y : (row == WIDTH ? part.y : 1.0);
      for (int column = 0; column <= WIDTH; ++column) {
        // The first and the last are covered in part, and together as much as one.
        float own = column == 0 ? 1.0 - part.x : (column == WIDTH ? part.x : 1.0);
        ivec2 texel = clamp(ivec2(first) + ivec2(column, row), ivec2(0), size - 1);
        float nearer = texelFetch(shadow, texel, 0).x;
        hidden += nearer > 0.0 && nearer < ahead ? up * own : 0.0;
      }
    }
    share *= max(1.0 - hidden / float(WIDTH * WIDTH), 0.0);
  }
  imageStore(reach, pixel, vec4(share, 0.0, 0.0, 1.0));
}
