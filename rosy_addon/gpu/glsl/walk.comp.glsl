// The picture: along each line through a pixel, both ways, the mean of the noise; the mean of these
// with the contrast of one; ink and light. A streamline's state is a pixel and a sheet of the
// covering surface (`covering`), and each step is of Adams and Bashforth's second order.

#define MEAN 0.5

// Of the noise along a streamline times its weights, of these, and of their squares.
struct Sums {
  vec3 total;
  float weight;
  float square;
};

// Of one half of a streamline, and of its first steps alone, with weights of their own; and the tones
// of as many as lines run on.
struct Half {
  Sums all;
  Sums near;
  vec2 tones;
};

void add(inout Sums sums, vec3 noise_there, float weight)
{
  sums.total += weight * noise_there;
  sums.weight += weight;
  sums.square += weight * weight;
}

Sums none()
{
  Sums sums;
  sums.total = vec3(0.0);
  sums.weight = sums.square = 0.0;
  return sums;
}

Sums whole_of(vec3 start, Sums ahead, Sums behind)
{
  Sums sums = ahead;
  sums.total += behind.total + start;
  sums.weight += behind.weight + 1.0;
  sums.square += behind.square + 1.0;
  return sums;
}

// So many samples that all count the same would vary as much (`kernel.Weights`).
float samples_of(Sums sums)
{
  return sums.weight * sums.weight / sums.square;
}

// The tone of a pixel.
float tone_at(ivec2 pixel)
{
  vec3 light = texelFetch(tones, pixel, 0).xyz;
  return clamp((light.x + light.y + light.z) / 3.0, 0.0, 1.0);
}

// What lies along one half of the streamline that leaves a pixel on a sheet, without the start.
Half followed(ivec2 pixel, int sheet, float sign_, vec4 cell, int steps, int near_steps, int beyond)
{
  Half found;
  found.all = found.near = none();
  found.tones = vec2(0.0);
  float fall = taper != 0 ? 1.0 / float(steps + 1) : 0.0;
  float near_fall = taper != 0 ? 1.0 / float(near_steps + 1) : 0.0;
  vec2 offset = vec2(0.0), before = vec2(0.0);
  for (int count = 0; count < max(steps, beyond); ++count) {
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
    float away = float(count + 1);
    if (count < steps) {
      add(found.all, cell.yzw, 1.0 - away * fall);
    }
    if (count < beyond) {
      found.tones += vec2(tone_at(pixel), 1.0);
    }
    if (count < near_steps) {
      add(found.near, cell.yzw, 1.0 - away * near_fall);
    }
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

// The family that a line belongs to (`hues.families_of_lines`), from the angle of line 0 and of what
// the field stores. Of `told` families: 1 where nothing is stored, as of fields beside this one of
// which no lines are told apart.
int family_of_line(int line, float first, float stored, int told)
{
  // Of odd degree every other line is a member's opposite half.
  float opposite = (around > degree && (degree & line & 1) == 1) ? 0.5 * TAU : 0.0;
  float at = first + opposite + TAU * float(line) / float(around);
  float ahead = (at * float(degree) - stored * float(families)) / TAU;
  return modulo(int(round(ahead)), told);
}

// The member whose line this is. Of odd degree every other line is a member's opposite half.
int member_of_line(int line)
{
  bool halves = around > degree && (degree & 1) == 1;
  return halves ? ((line & 1) == 0 ? line / 2 : (line + degree) / 2) : line;
}

// The mean of the noise along a streamline, around 0: those that ended early get the spread of whole
// ones (`contrast.even_out`).
vec3 evened_out(Sums sums, float of_whole_ones)
{
  float count = samples_of(sums);
  float cells_met = count * step_length / grain;
  return (sums.total / sums.weight - MEAN) * sqrt(count / of_whole_ones) * min(0.5 * cells_met, 1.0);
}

float grey(vec3 mean)
{
  return channels == 1 ? mean.x : (mean.x + mean.y + mean.z) / 3.0;
}

float smooth_step(float x)
{
  x = clamp(x, 0.0, 1.0);
  return x * x * (3.0 - 2.0 * x);
}

// How many lines are nearer to the guiding angle than this one (`hatching._ranks`); `first` is the
// angle from there of the nearest.
float rank_of(int line, float first)
{
  float at = first + TAU * float(line) / float(around);
  return atan(abs(sin(at)), abs(cos(at))) * 4.0 * float(lines) / TAU;
}

// `hatching._places`
float place_of(float rank, int count)
{
  float place = 0.0;
  for (int layer = 1; layer < count; ++layer) {
    place += smooth_step((rank - float(layer) + 0.4) / 0.8);
  }
  return place;
}

// The darkness at which a line joins in (`hatching._onset`).
float onset_of(int line, float first)
{
  float rank = rank_of(line, first);
  float too_many = smooth_step((rank - float(layers) + 0.4) / 0.8);
  return place_of(rank, layers) * layering + 2.0 * too_many;
}

// How far a line has joined in that does so later than the first one, where all leave so much light.
float joined_in(float later, float left)
{
  return smooth_step((1.0 - left - later + EARLY) / (JOINING + EARLY));
}

// An ink by its number, or between two, where the table of the shadows, or another one, begins.
vec3 ink_of(float number, int start)
{
  int below = min(int(number), ink_count - 1);
  int above = min(below + 1, ink_count - 1);
  vec3 low = texelFetch(inks, ivec2(start + below, 0), 0).xyz;
  return mix(low, texelFetch(inks, ivec2(start + above, 0), 0).xyz, number - float(below));
}

// The same at a tone (`inks.Inks.at`).
vec3 ink_at(float number, float tone)
{
  vec3 middle = ink_of(number, ink_count);
  float lighter = clamp((tone - ink_turn) / (1.0 - ink_turn), 0.0, 1.0);
  float darker = clamp(1.0 - tone / ink_turn, 0.0, 1.0);
  return middle + lighter * (ink_of(number, 2 * ink_count) - middle) + darker * (ink_of(number, 0) - middle);
}

vec3 inverted(vec3 light)
{
  return light_ink != 0 ? 1.0 - light : light;
}

float covering(float wanted, vec3 ink)
{
  vec3 luminance = vec3(0.2126, 0.7152, 0.0722);
  float left_by = dot(inverted(ink), luminance) / max(dot(inverted(paper_light.xyz), luminance), 1e-3);
  return clamp((1.0 - wanted) / max(1.0 - left_by, 1e-3), 0.0, 1.0);
}

// How well the paper takes the ink of a member: on a stretch of its own of one sheet, or on one of the
// `teeth` of the surface (`compose._tooth`).
float tooth_of(int member, ivec2 pixel)
{
  if (teeth == 0) {
    return texelFetch(tooth, pixel / subpixels + ivec2(member * tooth_stretch, 0), 0).x;
  }
  vec3 heights = texelFetch(tooth, pixel, 0).xyz - MEAN;
  int which = modulo(member, teeth);
  return which == 0 ? heights.x : which == 1 ? heights.y : heights.z;
}

float threshold_of(float covered)
{
  int last = textureSize(thresholds, 0).x - 1;
  float place = clamp(covered, 0.0, 1.0) * float(last);
  int below = min(int(place), last - 1);
  float low = texelFetch(thresholds, ivec2(below, 0), 0).x;
  return mix(low, texelFetch(thresholds, ivec2(below + 1, 0), 0).x, place - float(below));
}

// How wide the line is along a pixel beside which its surface ends and nothing nearer begins
// (`contour._edges`).
float line_at(ivec2 pixel, vec4 value, vec4 slope)
{
  float width = 0.0;
  int bits = joined_to(texelFetch(cells, pixel, 0).x);
  if (bits == 511 || value.xy == vec2(0.0)) {
    return width;
  }
  for (int side = 0; side < 4; ++side) {
    ivec2 move = side == 0 ? ivec2(1, 0) : side == 1 ? ivec2(-1, 0) : side == 2 ? ivec2(0, 1) : ivec2(0, -1);
    ivec2 there = pixel + move;
    bool inside = all(greaterThanEqual(there, ivec2(0))) && all(lessThan(there, imageSize(picture)));
    if (!inside || ((bits >> (move.x + 3 * move.y + 4)) & 1) == 1) {
      continue;
    }
    vec4 other = texelFetch(values_seen, there, 0);
    float jump = (texelFetch(slopes, there, 0).x - slope.x) / (IN_FRONT * slope.w);
    bool goes_on = other.w == value.w && other.xy == vec2(0.0);
    if (other.w == 0.0 || jump < -1.0) {
      width = goes_on ? width : outline;
    }
    else if (jump <= 1.0 && !goes_on) {
      width = max(width, 0.5 * outline);
    }
  }
  return width;
}

// How much of a pixel lines along silhouettes and creases cover (`contour.contour`).
float contour_at(ivec2 pixel, vec4 value)
{
  float near = texelFetch(slopes, pixel, 0).x, covered = 0.0;
  int reach = int(ceil(outline));
  for (int dy = -reach; dy <= reach; ++dy) {
    for (int dx = -reach; dx <= reach; ++dx) {
      ivec2 there = pixel + ivec2(dx, dy);
      float away = length(vec2(dx, dy));
      bool inside = all(greaterThanEqual(there, ivec2(0))) && all(lessThan(there, imageSize(picture)));
      if (!inside || outline - away <= covered) {
        continue;
      }
      vec4 other = texelFetch(values_seen, there, 0), slope = texelFetch(slopes, there, 0);
      float behind = IN_FRONT * slope.w * max(away, 1.0);
      if (other.w == value.w && near >= slope.x - behind) {
        float line_there = line_at(there, other, slope);
        if (line_there > 0.0) {
          covered = max(covered, clamp(line_there - away, 0.0, 1.0));
        }
      }
    }
  }
  return covered;
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

  // Without a hand that wavers there is no such image to look into.
  float wavered = wobble > 0.0 ? wobble * texelFetch(wavering, pixel, 0).x : 0.0;
  float toward = float(degree) * (guiding_angle - wavered);
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
  float tone_here = tone_at(pixel);
  bool by_magnitude = magnitude_drives == 1 || magnitude_drives == 3;
  float nearest = angle_of(z) / float(degree), soonest = 10.0, paper = 1.0;
  vec3 one_ink = vec3(0.0), through = vec3(1.0);
  if (hatch != 0) {
    if (by_magnitude) {
      one_ink = to_linear(mapped_colour(relative));
    }
    else if (ink_count == 1) {
      one_ink = ink_at(0.0, tone_here);
    }
    for (int line = 0; line < lines; ++line) {
      soonest = min(soonest, onset_of(line, nearest));
    }
  }
  int near_steps = piece_length, beyond = run_on;
  if (magnitude_drives >= 2) {
    near_steps = int(round(float(near_steps) * relative));
    beyond = int(round(float(beyond) * relative));
  }
  // What light the ink is to leave, and between how many lines that is shared.
  float wanted = 1.0, left = 1.0, sharers = 1.0;
  vec3 blend = vec3(0.0), hue = vec3(0.0);
  float samples = 0.0, weights = 0.0;
  for (int line = 0; line < lines; ++line) {
    bool paired = around == 2 * lines;
    int back = paired ? line + lines : line;
    Half ahead = followed(pixel, line, 1.0, cell, steps, near_steps, beyond);
    Half behind = followed(pixel, back, paired ? 1.0 : -1.0, cell, steps, near_steps, beyond);
    Sums sums = whole_of(cell.yzw, ahead.all, behind.all);
    vec3 mean = evened_out(sums, whole_samples);
    if (hatch != 0) {
      if (line == 0 || run_on > 0) {
        vec2 along = vec2(tone_here, 1.0) + ahead.tones + behind.tones;
        float light_left = along.x / along.y;
        left = light_ink != 0 ? 1.0 - light_left : light_left;
        wanted = ink_floor + left * (1.0 - ink_floor);
        if (ink_count == 1 && !by_magnitude) {
          left = 1.0 - covering(wanted, one_ink);
        }
        sharers = 0.0;
        for (int other = 0; other < lines; ++other) {
          sharers += joined_in(onset_of(other, nearest) - soonest, left);
        }
      }
      float own = joined_in(onset_of(line, nearest) - soonest, left) / sharers;
      float covered = 1.0 - pow(left, own);
      vec3 ink = one_ink;
      if (ink_count > 1) {
        float number = families > 1 ?
                           float(min(family_of_line(line, first, stored, told), ink_count - 1)) :
                           place_of(rank_of(line, nearest), lines);
        ink = ink_at(number, tone_here);
        covered = covering(pow(wanted, own), ink);
      }
      float streak = grey(mean) / deviation;
      if (piece_length > 0) {
        vec3 near = evened_out(whole_of(cell.yzw, ahead.near, behind.near), piece_samples);
        // `hatching.brokenness`
        float least = SWELL * wobble;
        float broken = least + (1.0 - least) * breaks * (1.0 - covered) * (1.0 - covered);
        streak = mix(streak, grey(near) / piece_deviation, broken);
      }
      if (tooth_depth > 0.0) {
        streak += tooth_depth * tooth_of(member_of_line(line), pixel);
      }
      float above = streak - threshold_of(covered);
      float coverage = smooth_step(above / (2.0 * softness) + 0.5);
      paper *= 1.0 - coverage;
      vec3 passed = inverted(ink) / max(inverted(paper_light.xyz), 1e-3);
      through *= 1.0 - coverage * (1.0 - passed);
    }
    blend += mean;
    samples += samples_of(sums);
    if (families > 1) {
      float shine = exp(sharpness * grey(mean));
      int family = family_of_line(line, first, stored, told);
      family = modulo(family, textureSize(palette, 0).x);
      hue += shine * texelFetch(palette, ivec2(family, 0), 0).xyz;
      weights += shine;
    }
  }
  if (hatch != 0 && outline > 0.0) {
    float coverage = contour_at(pixel, value);
    vec3 ink = ink_count > 1 ? ink_at(0.0, tone_here) : one_ink;
    vec3 passed = inverted(ink) / max(inverted(paper_light.xyz), 1e-3);
    through *= 1.0 - coverage * (1.0 - passed);
    paper *= 1.0 - coverage;
  }
  blend /= float(lines);
  samples /= float(lines);
  // The mean of M images has the contrast of one (equation 6, `contrast.blend_gain`).
  float shared_ = clamp(crossing * whole_samples / samples, 0.0, float(lines - 1));
  blend *= gain * sqrt(float(lines) / (1.0 + shared_));
  vec3 tone = channels == 1 ? blend.xxx : blend;
  vec3 ink = tone + MEAN;
  if (by_magnitude) {
    ink = mapped_colour(relative) * (1.0 + 1.5 * tone);
  }
  else if (families > 1) {
    ink = hue / weights * (1.0 + 1.5 * tone);
  }
  vec4 colour = vec4(to_linear(ink) * light, 1.0);
  if (hatch != 0) {
    vec3 drawn = one_ink;
    if (ink_count > 1) {
      vec3 seen_light = inverted(inverted(paper_light.xyz) * through);
      // What is seen is paper and ink: the ink is what is left without the paper.
      drawn = paper_light.xyz + (seen_light - paper_light.xyz) / max(1.0 - paper, LEAST);
      drawn = clamp(drawn, 0.0, 1.0);
    }
    colour = clear_paper != 0 ? vec4(drawn, 1.0 - paper) :
                                vec4(mix(drawn, paper_light.xyz, paper), 1.0);
  }
  imageStore(picture, pixel, colour);
}
