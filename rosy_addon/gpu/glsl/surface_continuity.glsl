// Whether a surface continues between two pixels, as in `pixel_neighbors`.

// `slope` and `other_slope` are texels of depth_slopes. `same_side` says whether both pixels see the
// same side of the surface.
bool depth_continues(vec4 slope, vec4 other_slope, bool same_side, ivec2 offset)
{
  float jump = other_slope.x - slope.x;
  float predicted = dot(slope.yz, vec2(offset)), predicted_back = dot(other_slope.yz, vec2(offset));
  float tolerance = min(slope.w, other_slope.w);
  if (offset.x != 0 && offset.y != 0) {
    tolerance *= 1.41421356;
  }
  if (jump > max(predicted, predicted_back) + tolerance ||
      jump < min(predicted, predicted_back) - tolerance) {
    return false;
  }
  bool both_agree = abs(jump - predicted) <= tolerance && abs(jump - predicted_back) <= tolerance;
  return both_agree || same_side;
}
