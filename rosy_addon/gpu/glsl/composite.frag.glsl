// The color of the picture at a fragment, for drawing over the 3D view.

uniform sampler2D picture;
uniform float opacity;
uniform vec2 view_origin, pixel_scale;
in vec4 clip_distances;
in vec2 more_clip_distances;
out vec4 view_color;

vec4 sample_picture(vec2 position)
{
  ivec2 max_texel = textureSize(picture, 0) - 1;
  vec2 low = floor(position - 0.5), fraction = position - 0.5 - low;
  vec4 total = vec4(0.0);
  for (int corner_index = 0; corner_index < 4; ++corner_index) {
    ivec2 offset = ivec2(corner_index & 1, corner_index >> 1);
    vec2 weight = mix(1.0 - fraction, fraction, vec2(offset));
    vec4 color = texelFetch(picture, clamp(ivec2(low) + offset, ivec2(0), max_texel), 0);
    total += weight.x * weight.y * vec4(color.xyz * color.w, color.w);
  }
  return total.w > 0.0 ? vec4(total.xyz / total.w, total.w) : vec4(0.0);
}

void main()
{
  if (any(lessThan(clip_distances, vec4(0.0))) || any(lessThan(more_clip_distances, vec2(0.0)))) {
    discard;
  }
  vec2 position = (gl_FragCoord.xy - view_origin) * pixel_scale;
  vec4 color = pixel_scale == vec2(1.0) ?
                   texelFetch(picture, ivec2(position), 0) :
                   sample_picture(position);
  if (color.w == 0.0) {
    discard;
  }
  // Linear: Blender's frame buffer encodes the display color.
  view_color = vec4(clamp(color.xyz, 0.0, 1.0), color.w * opacity);
}
