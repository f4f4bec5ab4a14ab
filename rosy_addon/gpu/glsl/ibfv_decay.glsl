// The ratio q of the weights of successive steps, as `ibfv.decay_of_samples`.

// The decay of streaks with the effective samples of a streamline of some steps in each direction. For
// r = (1 + q) / (1 - q), these are r^3 / (r^2 - r + 1), or 2 r^3 / (r^2 + 1) of streaks on both sides. Both
// are solved by Newton's method, from above.
float decay_of_steps(int half_steps)
{
  float samples = samples_at_rest(half_steps);
  bool two_sided = degree != line_count && flow_mode == FLOW_NONE;
  float r = two_sided ? 0.5 * samples + 1.0 : samples;
  for (int iteration = 0; iteration < 6; ++iteration) {
    if (two_sided) {
      r -= (r * r * (2.0 * r - samples) - samples) / (2.0 * r * (3.0 * r - samples));
    }
    else {
      r -= (r * r * (r - samples) + samples * (r - 1.0)) /
           (r * (3.0 * r - 2.0 * samples) + samples);
    }
  }
  return max(r - 1.0, 0.0) / (r + 1.0);
}
