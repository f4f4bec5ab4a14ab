uniform int noise_channels;

float gray(vec3 noise_value)
{
  return noise_channels == 1 ? noise_value.x : (noise_value.x + noise_value.y + noise_value.z) / 3.0;
}
