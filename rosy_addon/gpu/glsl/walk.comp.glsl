// The picture: along each line through a pixel, both ways, the mean of the noise; the mean of these
// with the contrast of one; ink and light. A streamline's state is a pixel and a sheet of the
// covering surface (`covering`), and each step is of Adams and Bashforth's second order.

#define MEAN 0.5

struct Half {
  vec3 total;
  float count;
};

// The noise along one half of the streamline that leaves a pixel on a sheet, without the start.
Half followed(ivec2 pixel, int sheet, float sign_, vec4 cell, int steps)
{
  Half found;
  found.total = vec3(0.0);
  found.count = 0.0;
  vec2 offset = vec2(0.0), before = vec2(0.0);
  for (int count = 0; count < steps; ++count) {
    bool opposite = sheet >= lines;
    vec4 way = texelFetch(turning, ivec3(pixel, opposite ? sheet - lines : sheet), 0);
    vec2 ahead = way.xy + dot(way.zw, offset) * vec2(-way.y, way.x);
    ahead *= opposite ? -sign_ : sign_;
    offset += step_length * (count == 0 ? ahead : 1.5 * ahead - 0.5 * before);
    before = ahead;
    // No further than a neighbour, however sharply the direction turned.
    vec2 whole = clamp(round(offset), -1.0, 1.0);
    offset -= whole;
    ivec2 move = ivec2(whole);
    int bit = move.x + 3 * move.y + 4;
    if (((joined_to(cell.x) >> bit) & 1) == 0) {
      break;
    }
    if (bit != 4) {
      pixel += move;
      float turn = cell.x;
      cell = texelFetch(cells, pixel, 0);
      // k' = k + round((t(p) - t(q)) S / 2 pi) mod S
      sheet = wrapped(sheet + int(round(turn - cell.x)), around);
    }
    found.total += cell.yzw;
    found.count += 1.0;
  }
  return found;
}

vec3 mapped_colour(float value)
{
  int last = textureSize(colours, 0).x - 1;
  float place = clamp(value, 0.0, 1.0) * float(last);
  int below = min(int(place), last - 1);
  vec3 low = texelFetch(colours, ivec2(below, 0), 0).xyz;
  vec3 high = texelFetch(colours, ivec2(below + 1, 0), 0).xyz;
  return mix(low, high, place - float(below));
}

// The hue of a line: that of the family it belongs to (`hues.family_hues`), from the angle of line 0
// and of what the field stores. Of `told` families: 1 where nothing is stored, as of fields beside
// this one of which no lines are told apart.
vec3 hue_of_line(int line, float first, float stored, int told)
{
  // Of odd degree every other line is a member's opposite half.
  float opposite = (around > degree && (degree & line & 1) == 1) ? 0.5 * TAU : 0.0;
  float at = first + opposite + TAU * float(line) / float(around);
  float ahead = (at * float(degree) - stored * float(families)) / TAU;
  int family = modulo(int(round(ahead)), told);
  return texelFetch(palette, ivec2(modulo(family, textureSize(palette, 0).x), 0), 0).xyz;
}

float smooth_step(float x)
{
  x = clamp(x, 0.0, 1.0);
  return x * x * (3.0 - 2.0 * x);
}

// The darkness at which a line joins in (`hatching._onset`), by how many others are nearer to the
// guiding angle; `first` is the angle from there of the nearest.
float onset_of(int line, float first)
{
  float at = first + TAU * float(line) / float(around);
  float rank = atan(abs(sin(at)), abs(cos(at))) * 4.0 * float(lines) / TAU;
  float onset = 0.0;
  for (int layer = 1; layer < layers; ++layer) {
    onset += smooth_step((rank - float(layer) + 0.4) / 0.8);
  }
  return onset * layering + 2.0 * smooth_step((rank - float(layers) + 0.4) / 0.8);
}

float threshold_of(float covered)
{
  int last = textureSize(thresholds, 0).x - 1;
  float place = clamp(covered, 0.0, 1.0) * float(last);
  int below = min(int(place), last - 1);
  float low = texelFetch(thresholds, ivec2(below, 0), 0).x;
  return mix(low, texelFetch(thresholds, ivec2(below + 1, 0), 0).x, place - float(below));
}

void main()
{
  ivec2 pixel = ivec2(gl_GlobalInvocationID.xy) + corner;
  ivec2 frame = imageSize(picture);
  if (any(greaterThanEqual(pixel, frame))) {
    return;
  }
  vec4 cell = texelFetch(cells, pixel, 0);
  if (cell.x == 0.0) {
    return;
  }
  vec4 value = texelFetch(values_seen, pixel, 0);
  float relative = 1.0;
  if (magnitude_drives != 0) {
    float top = largest_known > 0.0 ? largest_known : texelFetch(largest, ivec2(0), 0).x;
    relative = min(length(value.xy) / (top > 0.0 ? top : 1.0), 1.0);
  }
  int steps = magnitude_drives >= 2 ? int(round(float(walk_length) * relative)) : walk_length;
  float full = float(2 * walk_length + 1);

  float toward = float(degree) * guiding_angle;
  vec2 z = times(value.xy, vec2(cos(toward), -sin(toward)));
  float first = 0.0, stored = 0.0;
  int told = 1;
  if (families > 1) {
    first = angle_of(z) / float(degree) + guiding_angle;
    vec2 known = texelFetch(traits_seen, ivec3(pixel, family_layer), 0).xy;
    stored = angle_of(known);
    told = known == vec2(0.0) ? 1 : families;
  }
  vec3 light = texelFetch(tones, pixel, 0).xyz;
  // What light the ink is to leave, and between how many lines that is shared.
  float left = clamp((light.x + light.y + light.z) / 3.0, 0.0, 1.0);
  left = light_ink != 0 ? 1.0 - left : left;
  float nearest = angle_of(z) / float(degree), soonest = 10.0, sharers = 0.0, paper = 1.0;
  if (hatch != 0) {
    for (int line = 0; line < lines; ++line) {
      soonest = min(soonest, onset_of(line, nearest));
    }
    for (int line = 0; line < lines; ++line) {
      float later = onset_of(line, nearest) - soonest;
      sharers += smooth_step((1.0 - left - later + EARLY) / (JOINING + EARLY));
    }
  }
  vec3 blend = vec3(0.0), hue = vec3(0.0);
  float samples = 0.0, weights = 0.0;
  for (int line = 0; line < lines; ++line) {
    bool paired = around == 2 * lines;
    Half ahead = followed(pixel, line, 1.0, cell, steps);
    Half behind = followed(pixel, paired ? line + lines : line, paired ? 1.0 : -1.0, cell, steps);
    float count = 1.0 + ahead.count + behind.count;
    vec3 mean = (cell.yzw + ahead.total + behind.total) / count;
    // Streamlines that ended early get the spread of whole ones (`contrast.even_out`).
    mean = (mean - MEAN) * sqrt(count / full) * min(0.5 * count * step_length / grain, 1.0);
    if (hatch != 0) {
      float later = onset_of(line, nearest) - soonest;
      float own = smooth_step((1.0 - left - later + EARLY) / (JOINING + EARLY)) / sharers;
      float streak = channels == 1 ? mean.x : (mean.x + mean.y + mean.z) / 3.0;
      float above = streak / deviation - threshold_of(1.0 - pow(left, own));
      paper *= 1.0 - smooth_step(above / (2.0 * softness) + 0.5);
    }
    blend += mean;
    samples += count;
    if (families > 1) {
      float weight = exp(sharpness * (channels == 1 ? mean.x : (mean.x + mean.y + mean.z) / 3.0));
      hue += weight * hue_of_line(line, first, stored, told);
      weights += weight;
    }
  }
  blend /= float(lines);
  samples /= float(lines);
  // The mean of M images has the contrast of one (equation 6, `contrast.blend_gain`).
  float shared_ = clamp(crossing * full / samples, 0.0, float(lines - 1));
  blend *= gain * sqrt(float(lines) / (1.0 + shared_));
  vec3 tone = channels == 1 ? blend.xxx : blend;
  vec3 ink = tone + MEAN;
  if (magnitude_drives == 1 || magnitude_drives == 3) {
    ink = mapped_colour(relative) * (1.0 + 1.5 * tone);
  }
  else if (families > 1) {
    ink = hue / weights * (1.0 + 1.5 * tone);
  }
  vec4 colour = vec4(to_linear(ink) * light, 1.0);
  if (hatch != 0) {
    colour = clear_paper != 0 ? vec4(ink_light.xyz, 1.0 - paper) :
                                vec4(mix(ink_light.xyz, paper_light.xyz, paper), 1.0);
  }
  imageStore(picture, pixel, colour);
}
