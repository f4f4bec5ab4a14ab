// The effective samples of a streamline of full length, by a kernel at rest (`filter_kernel`).
float samples_at_rest(int half_steps)
{
  float width = float(half_steps + 1), count = 2.0 * width - 1.0;
  return kernel == KERNEL_TAPER ? 3.0 * width * width * width / (2.0 * width * width + 1.0) :
         kernel == KERNEL_RAMP  ? 3.0 * width * count / (4.0 * width - 1.0) :
                                  count;
}
