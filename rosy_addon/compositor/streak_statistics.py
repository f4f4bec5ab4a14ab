"""Statistics of streaks: their standard deviation, and the ink threshold for each coverage.

The streaks of an LIC image are means of noise along streamlines. Their distribution does not depend
on the picture, so it is measured once for a look, in a sample of noise that is averaged along
straight lines.
"""

from typing import NamedTuple

import numpy as np

from ..core.cache import Cache
from ..core.progress import report
from .filter_kernel import Kernel
from .image_noise import NoiseSettings, image_noise
from .look_units import PixelLook
from .paper_grain import PAPER_GRAIN_STRENGTH, picture_paper_grain, surface_paper_grain_settings
from .surface_noise import OCTAVES, octave_weights
from .undirected import disc_means

#: Half the width of the step from paper to ink, in standard deviations of the streaks, for the
#: crispness 0 and 1.
MAX_SOFTNESS, MIN_SOFTNESS = 1.6, 0.2

#: Number that is subtracted from streaks (standard deviation 1), which puts them below all thresholds.
NO_INK = 1e6

#: `break_amount` that a wobble of 1 adds everywhere.
WOBBLE_BREAKS = 0.5

#: Half the length of the pieces of broken lines, in line widths, and its upper bound, as a fraction of
#: the length of the streamlines.
BREAK_LENGTH_WIDTHS, MAX_BREAK_FRACTION = 4.0, 0.4

#: Number of coverages in tables of thresholds, and number of break amounts that are sampled.
COVERAGE_STEPS, BREAK_LEVELS = 256, 17

#: The coverages in tables of thresholds.
COVERAGES = np.linspace(0, 1, COVERAGE_STEPS)

#: Side of the sample of noise: in line widths, and its least value in pixels.
SAMPLE_WIDTHS, MIN_SAMPLE_PIXELS = 64, 320

#: Largest line width of the sample in pixels. Coarser noise is measured at a smaller scale.
MAX_SAMPLE_WIDTH = 12.0

#: Bins of the histogram of a sample.
HISTOGRAM_BINS = 1600

#: Cache of the statistics of the latest looks. The statistics of a look take about 4 KB.
STATISTICS_CACHE = Cache(max_bytes=1 << 16)


#: The settings of a look that the statistics depend on.
STATISTICS_SETTINGS = (
    *("length", "line_width", "density", "high_pass", "kernel", "anchor"),
    *("crispness", "breaks", "wobble", "paper_grain", "supersampling"),
)


class StreakStatistics(NamedTuple):
    """Statistics of streaks.

    Attributes
    ----------
    threshold : (COVERAGE_STEPS,) float64 ndarray
        Threshold for each coverage from 0 to 1, in even steps: streaks exceed the threshold on that fraction
        of the paper. The unit is the standard deviation of the streaks; 0 is their mean.
    std : float
        Standard deviation of the streaks.
    break_std : float
        Standard deviation of short streaks, which are as long as the pieces of broken lines.
    disc_threshold : (COVERAGE_STEPS,) float64 ndarray
        The same as `threshold` for means of noise over discs (see `undirected`), in standard deviations
        of these means.
    disc_std : float
        Standard deviation of means over discs.
    paper_grain_std : float
        Standard deviation of the noise of a paper grain that is anchored to surfaces. 1 if there
        is none.
    """

    threshold: np.ndarray
    std: float
    break_std: float
    disc_threshold: np.ndarray
    disc_std: float
    paper_grain_std: float = 1.0


def look_streak_statistics(look: PixelLook) -> StreakStatistics:
    """Return the statistics of streaks, from the cache if they are there.

    Parameters
    ----------
    look : PixelLook
    """
    key = tuple(getattr(look, name) for name in STATISTICS_SETTINGS)
    statistics = STATISTICS_CACHE.get(key)
    if statistics is None:
        statistics = STATISTICS_CACHE.put(key, _measured(look))
        STATISTICS_CACHE.evict_over_limit()
    return statistics


def _measured(look: PixelLook) -> StreakStatistics:
    """Measure the statistics of streaks in a sample of noise."""
    report(0.0, "measuring streaks")
    scale = min(MAX_SAMPLE_WIDTH / look.line_width, 1.0)
    line_width, kernel = scale * look.line_width, look.kernel
    side = max(int(SAMPLE_WIDTHS * line_width), MIN_SAMPLE_PIXELS)
    lengths = look.length, break_steps(look)
    length_pixels, break_pixels = (max(round(scale * (2 * steps + 1)), 1) for steps in lengths)
    width = side + length_pixels
    anchored = look.anchor == "surface"
    settings = NoiseSettings(line_width, 1, density=look.density, high_pass=scale * look.high_pass)
    noise = _noise_sample((side, width), settings, anchored)
    streaks, streak_std = _standardized(_line_means(noise, length_pixels, side, kernel))
    break_means = _line_means(noise, min(break_pixels, length_pixels), side, kernel)
    break_streaks, break_std = _standardized(break_means)
    spots, disc_std = _standardized(disc_means(noise[:, :side], line_width))
    paper_relief, paper_grain_std = 0.0, 1.0
    amplitude = PAPER_GRAIN_STRENGTH * look.paper_grain
    if amplitude and anchored:
        grain = surface_paper_grain_settings(look)
        lengths = {"cell": scale * grain.cell, "high_pass": scale * grain.high_pass}
        heights = _noise_sample(streaks.shape, grain._replace(**lengths), True)
        paper_grain_std = float(heights.std())
        paper_relief = amplitude / paper_grain_std * (heights - heights.mean())
    elif amplitude:
        pixel = np.arange(streaks.size, dtype=np.int32)
        heights = picture_paper_grain(pixel, len(streaks[0]), line_width, 1)
        paper_relief = amplitude * heights[0].reshape(streaks.shape)
    break_amounts = break_amount(COVERAGES, look.breaks, look.wobble)
    levels = BREAK_LEVELS if look.breaks else 1
    break_levels = np.linspace(break_amounts.min(), break_amounts.max(), levels)
    change = break_streaks - streaks
    samples = [streaks + amount * change + paper_relief for amount in break_levels]
    half_width = softness(look.crispness)
    threshold_tables = _threshold_tables(samples, half_width)
    (disc_threshold,) = _threshold_tables([spots + paper_relief], half_width)
    columns = zip(break_amounts, threshold_tables.T, strict=True)
    thresholds = [np.interp(amount, break_levels, column) for amount, column in columns]
    stds = streak_std, break_std, disc_threshold, disc_std, paper_grain_std
    return StreakStatistics(np.array(thresholds), *stds)


def break_amount(target_coverage: np.ndarray, breaks: float, wobble: float) -> np.ndarray:
    """Compute the weight of the short streaks that break lines into pieces, for each target coverage.

    Lines break first where the coverage is low. Wobble adds the same amount everywhere, which makes
    lines vary in width.

    Parameters
    ----------
    target_coverage : ndarray
        0 to 1.
    breaks, wobble : float
        Settings of the look, 0 to 1.

    Returns
    -------
    ndarray
        Weight w, 0 to 1, of the shape of `target_coverage`. The other streaks have the weight 1 - w.
    """
    min_amount = WOBBLE_BREAKS * wobble
    return min_amount + (1 - min_amount) * breaks * (1 - target_coverage) ** 2


def break_steps(look: PixelLook) -> int:
    """Return the length of the short streaks that break lines into pieces, as steps in each direction."""
    steps = min(BREAK_LENGTH_WIDTHS * look.line_width, MAX_BREAK_FRACTION * look.length)
    return max(round(steps), 1)


def softness(crispness: float) -> float:
    """Return half the width of the step from paper to ink, in standard deviations of the streaks."""
    return MAX_SOFTNESS * (MIN_SOFTNESS / MAX_SOFTNESS) ** crispness


def _threshold_tables(samples: list[np.ndarray], half_width: float) -> np.ndarray:
    """Return (S, COVERAGE_STEPS) thresholds: for each of S images of streaks, a threshold for each coverage.

    Coverages are from 0 to 1, in even steps. Ink above the threshold covers that fraction of the image.
    `half_width` is half the width of the step from paper to ink, in the unit of the images, `samples`.
    """
    lowest, highest = min(map(np.min, samples)), max(map(np.max, samples))
    edges = np.linspace(lowest, highest, HISTOGRAM_BINS + 1)
    thresholds = np.linspace(highest + half_width, lowest - half_width, 4 * COVERAGE_STEPS)
    middles = (edges[:-1] + edges[1:]) / 2
    ink_fraction = smoothstep((middles - thresholds[:, None]) / (2 * half_width) + 0.5)
    tables = []
    for sample in samples:
        histogram = np.histogram(sample, edges)[0] / sample.size
        tables.append(np.interp(COVERAGES, ink_fraction @ histogram, thresholds))
    return np.array(tables)


def _noise_sample(shape: tuple[int, int], settings: NoiseSettings, anchored: bool) -> np.ndarray:
    """Make a (H, W) image of `image_noise` or, if `anchored`, of `surface_noise` on a flat surface.

    It has one channel, and always the same seed. Noise on the surface is the blend of the octave with the
    given cells, and of the octaves with cells of half and of twice the size.
    """
    pixel = np.arange(shape[0] * shape[1], dtype=np.int32)
    octave_offsets = np.arange(OCTAVES) - OCTAVES // 2 if anchored else np.zeros(1)
    weights = octave_weights(octave_offsets) if anchored else (1.0,)
    noise = np.zeros(shape, dtype=np.float32)
    for octave_offset, weight in zip(octave_offsets, weights, strict=True):
        octave = settings._replace(cell=settings.cell * 2.0**octave_offset, seed=1, channels=1)
        noise += np.float32(weight) * image_noise(pixel, shape[1], octave).reshape(shape)
    return noise


def _line_means(noise: np.ndarray, length: int, side: int, kernel: Kernel) -> np.ndarray:
    """Return the (n, side) weighted means of `length` successive pixels in the rows of (n, width) noise.

    They are centered at the middle `side` columns. `kernel` gives the weights.
    """
    if kernel == "ramp":
        # The weights of a window from column a on are 1 - 2 (j - middle) / length, for the column j.
        column = np.arange(noise.shape[1])
        means, moments = _window_means(noise, length), _window_means(noise * column, length)
        middle = column[: means.shape[1]] + (length - 1) / 2
        noise = means - (2 / length) * (moments - middle * means)
    else:
        # Tapered weights are a box filter of half the length, applied twice.
        for window in [max(length // 2, 1)] * 2 if kernel == "taper" else [length]:
            noise = _window_means(noise, window)
    start = (noise.shape[1] - side) // 2
    return noise[:, start : start + side]


def _window_means(rows: np.ndarray, window: int) -> np.ndarray:
    """Return the (n, width - window + 1) float64 means of `window` successive values in (n, width) rows."""
    sums = np.cumsum(np.pad(rows, ((0, 0), (1, 0))), axis=1, dtype=np.float64)
    return (sums[:, window:] - sums[:, :-window]) / window


def _standardized(means: np.ndarray) -> tuple[np.ndarray, float]:
    """Return values minus their mean, divided by their standard deviation; and that standard deviation."""
    std = float(means.std())
    return (means - means.mean()) / std, std


def smoothstep(x: np.ndarray) -> np.ndarray:
    """Return the smooth step: 0 below 0, 1 above 1, and 3 x^2 - 2 x^3 between."""
    x = np.clip(x, 0, 1)
    return x * x * (3 - 2 * x)
