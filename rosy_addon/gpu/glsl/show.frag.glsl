// The picture where the surface is seen.

vec4 picture_at(vec2 place)
{
  ivec2 last = textureSize(picture, 0) - 1;
  vec2 low = floor(place - 0.5), part = place - 0.5 - low;
  vec4 total = vec4(0.0);
  for (int corner_ = 0; corner_ < 4; ++corner_) {
    ivec2 step_ = ivec2(corner_ & 1, corner_ >> 1);
    vec2 share = mix(1.0 - part, part, vec2(step_));
    vec4 colour = texelFetch(picture, clamp(ivec2(low) + step_, ivec2(0), last), 0);
    total += share.x * share.y * vec4(colour.xyz * colour.w, colour.w);
  }
  return total.w > 0.0 ? vec4(total.xyz / total.w, total.w) : vec4(0.0);
}

void main()
{
  if (any(lessThan(beyond, vec4(0.0))) || any(lessThan(beyond_too, vec2(0.0)))) {
    discard;
  }
  vec2 place = (gl_FragCoord.xy - origin) * pixels;
  vec4 colour = pixels == vec2(1.0) ? texelFetch(picture, ivec2(place), 0) : picture_at(place);
  if (colour.w == 0.0) {
    discard;
  }
  // Linear light: what Blender draws its views into encodes it.
  shown = vec4(clamp(colour.xyz, 0.0, 1.0), colour.w * opacity);
}
