uniform sampler2D sample_entries;

// Find the pixel whose surface a sample shows, as an offset from the pixel that contains the sample. Return
// false if the sample shows no surface with a field.
bool entry_of_sample(ivec2 sample_, out ivec2 offset)
{
  int entry = int(texelFetch(sample_entries, sample_, 0).x) - 1;
  offset = ivec2(entry % 3 - 1, entry / 3 - 1);
  return entry >= 0;
}
