"""Thresholds of hatching: the lowest target coverage at which each point is covered by ink.

Hatching draws ink where a streak exceeds the threshold of a target coverage (`hatching`). The inverse does
not depend on the tone: the target coverage above which a given streak has ink. In this module, this
coverage is called the *threshold* of the point. Thresholds are evenly distributed from 0 to 1, like the
values of a halftone screen. Once they are known, hatching of any tone is a comparison: there is ink where the
threshold is below the target coverage.

M lines (pairs of opposite directions of the field) cross at a point. The first covers the light tones, and
further lines join in darker tones. Their thresholds are stored in that order, in *layers*. A tone with the
transmittance T has the *density* -log(T). A line with the threshold t and the share s of the ink has ink
where the density of the tone exceeds -log(1 - t) / s. Where two lines swap their places in the order, each
has a share between those of the two places. Both are merged into the first of the two layers, which has ink
where the density of the tone exceeds the smaller of both bounds. Such thresholds depend on the shares.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from .even_lines import COARSE_RATIO, EvenLines, resolved_share, uneven_width
from .hatching import HatchedLines, line_ranks, onset_shares, soft_rank_of, standard_streak
from .lic_images import LicImages
from .look import Look
from .look_units import PixelLook
from .pixel_field import PixelField
from .streak_statistics import COVERAGES, break_amount, look_streak_statistics

#: Number of lines whose thresholds are stored.
MAX_LAYERS = 3

#: Sample positions across an antialiased pixel, in half pixels from its center, and their weights: Gauss
#: quadrature with three nodes.
PIXEL_NODES = ((-(0.6**0.5), 5 / 18), (0.0, 8 / 18), (0.6**0.5, 5 / 18))

#: Crowding of even lines from which coarser lines replace them, at each of these sample positions. The
#: values are the middles of thirds of 0 to 1, so the share of coarser lines rises with the crowding.
PIXEL_LEVELS = (1 / 6, 1 / 2, 5 / 6)

#: Half the width w over which the streaks of a pixel are averaged, in pixels. Its variance w^2 / 3 is 1/5, as
#: for the soft edges of `hatching`.
STREAK_REACH = 0.6**0.5

#: Steps of the bisection that finds the thresholds of uneven lines, with an error of at most 1 / 1024.
BISECTION_STEPS = 10

#: Number of elements of the table of densities, a power of two, and the largest density in it.
DENSITY_STEPS, MAX_DENSITY = 1024, 16.0
DENSITIES = np.linspace(0, MAX_DENSITY, DENSITY_STEPS, dtype=np.float32)

#: Least share of a layer in the table, so that the thresholds of layers without ink are defined.
LEAST_SHARE = 0.003

#: Lower bound of densities that are divided by.
LEAST_DENSITY = np.float32(1e-6)

#: Two lines do not swap where their weights at each place differ by less than this from 0 or 1.
MAX_ROUNDING = 1e-3

#: Where two lines swap, one moves to the later place. It joins the later layer while its weight at that place
#: rises from 0.5 to this, and leaves the earlier layer while the weight rises from this to 1.
LAYER_CHANGE = 0.75


def sharp_look(look: Look) -> Look:
    """Return the look with the greatest crispness, so that statistics of streaks are for sharp edges."""
    return replace(look, crispness=1.0)


def unlit_look(look: Look) -> Look:
    """Return the look with plain settings of light, tone and color, which thresholds do not depend on."""
    hue = "families" if look.hue == "families" else "one"
    return replace(look, tone="light", light="headlight", shadows=False, overshoot=0.0, hue=hue)


def line_thresholds(line: int, lines: HatchedLines) -> np.ndarray:
    """Compute for each pixel the target coverage above which the lines along one direction cover it with ink.

    Parameters
    ----------
    line : int
        Index of the direction, as in `HatchedLines.images.members`.
    lines : HatchedLines
        Its look must be a `sharp_look`. Its `line_tones` and `outline` have no effect.

    Returns
    -------
    (P,) float32 ndarray
        0 to 1, evenly distributed.
    """
    statistics = look_streak_statistics(lines.look)
    break_streak = lines.break_streak(line)
    if lines.even_lines is not None:
        result = _even_line_thresholds(line, break_streak, lines)
    else:
        relief = lines.relief(line)
        streak = standard_streak(lines.images, line, statistics.std)[0] + relief
        if break_streak is not None:
            break_streak += relief
        result = _streak_thresholds(streak, break_streak, lines.look, statistics.threshold)
    if lines.undirected is not None:
        undefined, spots = lines.spots(line)
        result[undefined] = _coverage_from(spots, statistics.disc_threshold)
    return result


def _streak_thresholds(
    streak: np.ndarray, break_streak: np.ndarray | None, look: PixelLook, table: np.ndarray
) -> np.ndarray:
    """Return the (P,) thresholds of lines drawn from a LIC image with mean 0 and standard deviation 1.

    `streak` is the LIC image. `break_streak` is a LIC image of short streamlines, with the same mean and
    deviation; None if lines are not broken. `table`, (COVERAGE_STEPS,), is the streak above which there is
    ink, for each coverage.
    """
    if break_streak is None:
        return _coverage_from(streak, table)
    difference = break_streak - streak

    def excess(coverage: np.ndarray) -> np.ndarray:
        amount = break_amount(coverage, look.breaks, look.wobble)
        return streak + amount * difference - np.interp(coverage, COVERAGES, table)

    return _bisect(excess, len(streak))


def _even_line_thresholds(
    line: int, break_streak: np.ndarray | None, lines: HatchedLines
) -> np.ndarray:
    """Return the (P,) thresholds of evenly spaced lines along the direction with the index `line`.

    `break_streak` is from `HatchedLines.break_streak`: short streaks that break lines; None if they are not
    broken.
    """
    # 0 in the middle of a line, 1 between two lines.
    position = 1 - lines.even_lines.streaks[line]
    if break_streak is None and lines.paper_grain is None:
        return position
    grain = None if lines.paper_grain is None else lines.paper_grain[line]

    def excess(coverage: np.ndarray) -> np.ndarray:
        return uneven_width(coverage, lines.look, break_streak, grain) - position

    return _bisect(excess, len(position))


def _coverage_from(streak: np.ndarray, table: np.ndarray) -> np.ndarray:
    """Return the (P,) float32 coverages at which streaks have ink, by inverting a table of thresholds.

    `table`, (COVERAGE_STEPS,), is the streak above which there is ink, for each coverage from 0 to 1. It
    falls.
    """
    return np.interp(streak, table[::-1], COVERAGES[::-1]).astype(np.float32)


def _bisect(excess: Callable[[np.ndarray], np.ndarray], count: int) -> np.ndarray:
    """Find the (count,) float32 coverages, 0 to 1, at which `excess` becomes positive.

    `excess` takes (count,) coverages and returns (count,) numbers, which increase with the coverage.
    """
    low, high = np.zeros((2, count), dtype=np.float32)
    high += 1
    for _ in range(BISECTION_STEPS):
        middle = np.float32(0.5) * (low + high)
        is_covered = excess(middle) > 0
        high[is_covered], low[~is_covered] = middle[is_covered], middle[~is_covered]
    return np.float32(0.5) * (low + high)


def cyclic_places(first: np.ndarray) -> np.ndarray:
    """Return the weight of each line at each place in the order, if line m + 1 always follows line m.

    Line 0 follows the last line. The result is (min(M, MAX_LAYERS), M, P) float32: the `places` of
    `ordered_thresholds`.

    Parameters
    ----------
    first : (M, P) float32 ndarray
        Weight of each line at the first place, 0 to 1. The sum over the lines is 1.
    """
    return np.stack([np.roll(first, place, axis=0) for place in range(min(len(first), MAX_LAYERS))])


def ordered_thresholds(
    thresholds: np.ndarray, places: np.ndarray, undefined: np.ndarray, look: PixelLook
) -> np.ndarray:
    """Sort the thresholds of lines into layers, by the places of the lines in the order of hatching.

    Parameters
    ----------
    thresholds : (M, P) float32 ndarray
        Thresholds of each line, from `line_thresholds`.
    places : (L, M, P) float32 ndarray
        Weight of each line at each of the first L = min(M, MAX_LAYERS) places in the order: 1 for the line
        that has the place, between 0 and 1 where two lines swap. The sum over the lines is 1.
    undefined : (P,) bool ndarray
        Where the field is undefined. The thresholds of the first line hold for all ink together there.
    look : PixelLook
        Its `layers` and `layering` are used where lines swap and where the field is undefined.

    Returns
    -------
    (L, P) float32 ndarray
        Thresholds of each layer, 0 to 1. If the layers have the shares of `layer_shares`, all layers together
        have the transmittance of the tone.
    """
    if len(thresholds) == 1:
        return thresholds
    density = -np.log1p(-np.minimum(thresholds, np.float32(1 - np.exp(-MAX_DENSITY))))
    densest = np.float32(MAX_DENSITY)
    ordered = (density / np.maximum(places, np.float32(1e-6))).min(axis=1)
    drawn = min(look.layers, len(places))
    table = _layer_densities(drawn, look.layering)
    swap = np.flatnonzero((places[:drawn].max(axis=1) < 1 - MAX_ROUNDING).any(axis=0))
    ordered[:drawn, swap] = _merged_densities(density[:, swap], places[:drawn, :, swap], table)
    ordered[0, undefined] = _layer_density(table[0], density[0, undefined])
    ordered[1:, undefined] = densest
    return -np.expm1(-np.minimum(ordered, densest))


def _layer_densities(layers: int, layering: float) -> np.ndarray:
    """Return the (layers, DENSITY_STEPS) float32 density of each layer, for each total density `DENSITIES`.

    Density is -log(transmittance). Each row increases strictly. Beyond the table it continues linearly.
    `layers` is the number of layers, `layering` the difference in darkness between the tones at which they
    join.
    """
    shares = np.stack(layer_shares(-np.expm1(-DENSITIES), layers, layering))
    return (DENSITIES * np.maximum(shares, LEAST_SHARE)).astype(np.float32)


def _layer_density(table: np.ndarray, total: np.ndarray) -> np.ndarray:
    """Return the optical density of a layer for total densities of all layers.

    `table` is the row of the layer in `_layer_densities`, which is interpolated.
    """
    position = total / DENSITIES[1]
    index = np.minimum(position, DENSITY_STEPS - 2).astype(np.intp)
    return table[index] + (position - index) * (table[index + 1] - table[index])


def _merged_densities(density: np.ndarray, places: np.ndarray, table: np.ndarray) -> np.ndarray:
    """Return the thresholds of layers, as densities, where lines swap their places in the order.

    Lines that swap are merged into the first of the two layers. Density is -log(transmittance). A layer has
    ink where its own density, its share of the density of the tone, exceeds its threshold.

    Parameters
    ----------
    density : (M, P) float32 ndarray
        -log(1 - threshold) of each line.
    places : (L, M, P) float32 ndarray
        Weight of each line at each of the L places that are drawn, as in `ordered_thresholds`.
    table : (L, DENSITY_STEPS) float32 ndarray
        From `_layer_densities`.

    Returns
    -------
    (L, P) float32 ndarray
        Threshold of each layer as a density of this layer.
    """

    def line_density(index: np.ndarray) -> np.ndarray:
        return np.einsum("klp,klp->lp", places, table[:, index])

    # The density of the tone above which each line has ink.
    index = np.zeros(density.shape, dtype=np.intp)
    for exponent in reversed(range(int(np.log2(DENSITY_STEPS)))):
        middle = index + 2**exponent
        np.copyto(index, middle, where=line_density(middle) <= density)
    index = np.minimum(index, DENSITY_STEPS - 2)
    low, high = line_density(index), line_density(index + 1)
    begin = DENSITIES[1] * (index + (density - low) / np.maximum(high - low, np.float32(1e-7)))
    # Weight of each line at this place and all later ones, as a fraction of its weight at all places.
    total = np.maximum(places.sum(axis=0), np.float32(1e-6))
    onward = np.cumsum(places[::-1], axis=0)[::-1] / total
    onward[0] = 1
    merged = np.empty((len(places), density.shape[1]), dtype=np.float32)
    for layer, layer_table in enumerate(table):
        # A line joins the next layer before it leaves the earlier one. It leaves the earlier layer only for
        # tones at which the next one has ink. So its ink always is in one of both layers.
        joining = (onward[layer] - 0.5) / (LAYER_CHANGE - 0.5)
        delay = 1 / np.clip(joining, np.float32(1e-6), 1) - 1
        if layer + 1 < len(table):
            leaving = (onward[layer + 1] - LAYER_CHANGE) / (1 - LAYER_CHANGE)
            next_share = _layer_density(table[layer + 1], begin) / np.maximum(begin, LEAST_DENSITY)
            is_replaced = np.maximum(next_share - LEAST_SHARE, 0)
            delay += is_replaced * (1 / np.clip(1 - leaving, np.float32(1e-6), 1) - 1)
        merged[layer] = _layer_density(layer_table, (begin + delay).min(axis=0))
    return merged


def layer_shares(darkness: np.ndarray, layers: int, layering: float) -> list[np.ndarray]:
    """Return the share of the ink of each layer, in order, 0 to 1. The shares sum to 1.

    A layer with the share s transmits T^s of the light, where T is the transmittance of all layers.

    Parameters
    ----------
    darkness : ndarray
        1 - transmittance.
    layers : int
        Number of layers.
    layering : float
        The setting of the look: difference in darkness between the tones at which successive layers join.
    """
    return onset_shares(darkness, [layer * layering for layer in range(layers)])


def threshold_pixels(ordered: np.ndarray, resolved: np.ndarray | float = 1.0) -> np.ndarray:
    """Store ordered thresholds as the channels of pixels.

    Parameters
    ----------
    ordered : (L, P) float32 ndarray
        From `ordered_thresholds`.
    resolved : (L, P) or (P,) ndarray, or float
        How much of the contrast of the lines is drawn, 0 to 1. Where it is 0, lines become an even tone.

    Returns
    -------
    (P, 4) float32 ndarray
        The thresholds of three layers in red, green and blue, rounded to multiples of 1 / 255. If there are
        fewer layers, the first one is repeated. Alpha is the mean of (2 t - 1)^2 over the three thresholds t.
        After pixels are averaged, alpha minus the mean of (2 t - 1)^2 of the averaged thresholds is their
        variance. With it, details finer than a pixel can be drawn as their mean.
    """
    resolved = np.broadcast_to(resolved, ordered.shape)
    rgba = np.empty((ordered.shape[1], 4), dtype=np.float32)
    for channel in range(3):
        layer = channel if channel < len(ordered) else 0
        value = 0.5 + resolved[layer] * (ordered[layer] - np.float32(0.5))
        rgba[:, channel] = np.rint(255 * value) / np.float32(255)
    centered = 2 * rgba[:, :3] - 1
    rgba[:, 3] = (centered * centered).mean(axis=1)
    # Contrast that is not drawn has the spread of thresholds from 0 to 1.
    rgba[:, 3] += (1 - np.square(resolved).mean(axis=0)) / 3
    return rgba


def picture_thresholds(
    field: PixelField, lines: HatchedLines, samples_per_side: int = 1
) -> np.ndarray:
    """Compute the thresholds of the pixels of a picture.

    The layers are in the order in which lines join in a picture, by rank (`hatching.line_ranks`). Pixels of
    the outline have ink in any tone but the lightest. Antialiased pixels store the mean and the spread
    of a few thresholds, sampled across the lines.

    Parameters
    ----------
    field : PixelField
    lines : HatchedLines
        Its look must be a `sharp_look`. Its `line_tones` have no effect.
    samples_per_side : int
        Samples of the frame along each side of a pixel.

    Returns
    -------
    (P, 4) float32 ndarray
        Channels as from `threshold_pixels`.
    """
    look, images, even_lines = lines.look, lines.images, lines.even_lines
    rank = np.stack([soft_rank_of(rank, field.line_count) for rank in line_ranks(field, look)])
    crowding = None
    if even_lines is not None:
        # Crowded lines come last, as in `line_shares`.
        crowding = np.stack([even_lines.crowding(line, look) for line in range(len(rank))])
        rank += field.line_count * crowding
        rank -= rank.min(axis=0)
    layers = range(min(field.line_count, MAX_LAYERS))
    places = np.stack([np.clip(1 - np.abs(rank - layer), 0, 1) for layer in layers])
    places /= np.maximum(places.sum(axis=1, keepdims=True), np.float32(1e-6))
    pixels = np.zeros((len(field.pixel), 4), dtype=np.float32)
    is_sampled = even_lines is not None or images.slopes is not None
    for (node, weight), level in zip(PIXEL_NODES, PIXEL_LEVELS, strict=True):
        if not is_sampled and node:
            continue
        part = lines
        resolved: np.ndarray | float = 1.0
        if even_lines is not None:
            sample, period = _even_sample(even_lines, crowding > level, node)
            part = part._replace(even_lines=sample)
            resolved = np.einsum("klp,lp->kp", places, resolved_share(period, samples_per_side))
        sampled, broken = (_streak_sample(each, node) for each in (images, lines.break_images))
        part = part._replace(images=sampled, break_images=broken)
        thresholds = np.stack([line_thresholds(line, part) for line in range(len(rank))])
        ordered = ordered_thresholds(thresholds, places, field.representation == 0, look)
        if lines.outline is not None:
            ordered *= 1 - lines.outline
        pixels += np.float32(weight if is_sampled else 1) * threshold_pixels(ordered, resolved)
    # The spread is the one about the rounded values, which are stored.
    mean = pixels[:, :3]
    rounded = np.rint(255 * mean) / np.float32(255)
    pixels[:, 3] += (np.square(2 * rounded - 1) - np.square(2 * mean - 1)).mean(axis=1)
    pixels[:, :3] = rounded
    return pixels


def _streak_sample(images: LicImages | None, node: float) -> LicImages | None:
    """Return LIC images at points beside the centers of pixels, or None for None.

    The points are `node` times `STREAK_REACH` pixels to the left of the lines. `node` is a position of
    `PIXEL_NODES`, from -1 to 1.
    """
    if images is None or images.slopes is None or not node:
        return images
    shift = np.float32(STREAK_REACH * node) * images.slopes
    return replace(images, members=images.members + shift[..., None])


def _even_sample(
    lines: EvenLines, is_coarse: np.ndarray, node: float
) -> tuple[EvenLines, np.ndarray]:
    """Sample even lines beside the centers of pixels; also return the (M, P) distances between lines.

    The samples are `node` half pixels from the centers, across the lines. `node` is a position of
    `PIXEL_NODES`, from -1 to 1. Where `is_coarse`, (M, P) bool, is true, the coarse lines, which are
    farther apart, are sampled instead.
    """
    streaks, period = lines.streaks, lines.period
    if lines.coarse_streaks is not None:
        streaks = np.where(is_coarse, lines.coarse_streaks, streaks)
        period = np.where(is_coarse, np.float32(COARSE_RATIO) * period, period)
    position = np.abs(1 - streaks + np.float32(node) / np.maximum(period, np.float32(1)))
    position = np.minimum(position, 2 - position)
    if lines.growth is not None:
        # Ink spreads from the lines, and from the further lines that grow between them.
        between = 0.5 * lines.growth
        spread_between = (1 - position) / np.maximum(between, np.float32(1e-6))
        position = np.minimum(position / (1 - between), spread_between)
    return EvenLines(1 - position, lines.period, growth=None), period
