// The derivatives of the noise along x and y on screen, as differences between connected neighbors. Each
// layer of the image has the derivatives of two channels.

uniform sampler2D cells;
uniform int noise_layers;
uniform ivec2 box_origin;
layout(rgba16f) uniform writeonly image2DArray noise_gradients;

vec3 noise_at(ivec2 pixel, ivec2 offset, vec4 cell)
{
  int bit = offset.x + 3 * offset.y + 4;
  return ((neighbor_mask(cell.x) >> bit) & 1) == 0 ? cell.yzw : texelFetch(cells, pixel + offset, 0).yzw;
}

void main()
{
  ivec2 pixel = ivec2(gl_GlobalInvocationID.xy) + box_origin;
  if (any(greaterThanEqual(pixel, imageSize(noise_gradients).xy))) {
    return;
  }
  vec4 cell = texelFetch(cells, pixel, 0);
  if (cell.x == 0.0) {
    return;
  }
  vec3 right = 0.5 * (noise_at(pixel, ivec2(1, 0), cell) - noise_at(pixel, ivec2(-1, 0), cell));
  vec3 up = 0.5 * (noise_at(pixel, ivec2(0, 1), cell) - noise_at(pixel, ivec2(0, -1), cell));
  imageStore(noise_gradients, ivec3(pixel, 0), vec4(right.x, up.x, right.y, up.y));
  if (noise_layers > 1) {
    imageStore(noise_gradients, ivec3(pixel, 1), vec4(right.z, up.z, 0.0, 0.0));
  }
}
