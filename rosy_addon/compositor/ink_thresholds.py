"""Thresholds of hatching: the coverage from which each point is covered by ink.

Hatching draws ink where a streak exceeds the threshold of a target coverage (`hatching`). Its inverse
does not depend on the tone: the target coverage from which the streak exceeds the threshold. It is
evenly distributed from 0 to 1, as are the values of a halftone screen. With the thresholds of each
line, the hatching of any tone is a comparison: there is ink where the threshold is below the coverage.

Lines share the ink in their order: the first covers the light tones, and further ones join in darker
tones. The thresholds are stored in that order. Where two lines swap, they are merged such that those of
the first and of the second are still independent and evenly distributed. With the density
E = -log(1 - threshold), a line of the share s has ink from the density E / s of the tone on. The first
ink of several lines is the smallest of these; the densities have an exponential distribution, and so do
the smallest, and what is left of the others.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from .even_lines import COARSE_RATIO, EvenLines, resolved_share, uneven_width
from .hatching import (
    LineModulation,
    line_ranks,
    onset_weights,
    soft_rank_of,
    standard_streak,
)
from .inks import Inks, inks_of
from .lic_images import LicImages
from .look import Look
from .paper_grain import PAPER_GRAIN_STRENGTH
from .pixel_field import PixelField
from .streak_statistics import (
    COVERAGE_STEPS,
    break_amount,
    look_streak_statistics,
    softness,
)

#: Number of lines whose thresholds are stored.
MAX_LAYERS = 3

#: The density of normally distributed streaks is about this times c (1 - c) at the threshold of the
#: coverage c.
DENSITY_FACTOR = 1.6

#: Spread of thresholds that is due to their storage with 8 bits.
ROUNDING_SPREAD = 0.001

#: Square of half the width of an even distribution of thresholds t over the variance of 2 t - 1.
EDGE_VARIANCE = 0.75

#: Half the width of the sharpest edges, in thresholds.
MIN_EDGE = 0.002

#: Coverages that differ from 0 or 1 by less than this fade to it.
EXACT_ENDS = 0.02

#: Correction of coverages where a filter averages a few thresholds, which are not evenly distributed about
#: their mean. Fitted to means of 2 to 64 thresholds, and to lines at least 4 pixels apart: the mean coverage is
#: right to 0.02.
FILTER_CORRECTION = 3.0

#: Nodes across an antialiased pixel, in half widths of it, with their weights: Gauss quadrature.
PIXEL_NODES = ((-(0.6**0.5), 5 / 18), (0.0, 8 / 18), (0.6**0.5, 5 / 18))

#: Crowding from which coarser lines replace even ones, at each of these nodes.
PIXEL_LEVELS = (1 / 6, 1 / 2, 5 / 6)

#: Half the width of a pixel for streaks, in pixels. Its variance is that of the edges of `hatching`.
STREAK_REACH = 0.6**0.5

#: Smallest transmittance, and smallest difference to it.
MIN_TRANSMITTANCE = 1e-3

#: Steps of the bisection that finds the thresholds of uneven lines: to 1 / 1024.
BISECTION_STEPS = 10

#: Entries of the table of densities of the first line, and its largest density.
DENSITY_STEPS, MAX_DENSITY = 1024, 16.0


def sharp_look(look: Look) -> Look:
    """Return a look whose streak statistics are those of lines with sharp edges."""
    return replace(look, crispness=1.0)


def unlit_look(look: Look) -> Look:
    """Return a look without what thresholds do not depend on: sources of the tone and lights."""
    return replace(look, tone="light", light="headlight", shadows=False, overshoot=0.0)


def line_thresholds(
    line: int, images: LicImages | None, look: Look, modulation: LineModulation
) -> np.ndarray:
    """Compute the coverage from which each pixel is covered by one line.

    Parameters
    ----------
    line : int
        Index into `images.members`.
    images : LicImages or None
        None if the modulation has even lines.
    look : Look
        A `sharp_look`, in pixels of the frame.
    modulation : LineModulation
        Without `line_tones` and `outline`, which have no effect.

    Returns
    -------
    (P,) float32 ndarray
        0 to 1, evenly distributed.
    """
    statistics = look_streak_statistics(look)
    relief = break_streak = None
    if modulation.paper_grain is not None:
        relief = np.float32(PAPER_GRAIN_STRENGTH * look.paper_grain) * modulation.paper_grain[line]
    if modulation.break_images is not None:
        break_streak, _ = standard_streak(modulation.break_images, line, statistics.break_std)
    if modulation.even_lines is not None:
        grain = None if relief is None else modulation.paper_grain[line]
        position = 1 - modulation.even_lines.streaks[line]
        result = _even_line_thresholds(position, break_streak, grain, look)
    else:
        streak, _ = standard_streak(images, line, statistics.std)
        result = _streak_thresholds(streak, break_streak, relief, look, statistics.threshold)
    if modulation.undirected is not None:
        undefined = np.flatnonzero(~np.isnan(modulation.undirected))
        spots = modulation.undirected[undefined] / np.float32(statistics.disc_std)
        if relief is not None:
            spots += relief[undefined]
        result[undefined] = _coverage_from(spots, statistics.disc_threshold)
    return result


def _streak_thresholds(
    streak: np.ndarray,
    break_streak: np.ndarray | None,
    relief: np.ndarray | None,
    look: Look,
    table: np.ndarray,
) -> np.ndarray:
    """`line_thresholds` of streaks; `table` is `StreakStatistics.threshold`."""
    if relief is not None:
        streak = streak + relief
        break_streak = None if break_streak is None else break_streak + relief
    if break_streak is None:
        return _coverage_from(streak, table)
    difference = break_streak - streak
    coverages = np.linspace(0, 1, COVERAGE_STEPS)

    def excess(coverage: np.ndarray) -> np.ndarray:
        amount = break_amount(coverage, look.breaks, look.wobble)
        return streak + amount * difference - np.interp(coverage, coverages, table)

    return _bisect(excess, len(streak))


def _even_line_thresholds(
    position: np.ndarray,
    break_streak: np.ndarray | None,
    paper_grain: np.ndarray | None,
    look: Look,
) -> np.ndarray:
    """`line_thresholds` of even lines; `position` is 0 in the middle of a line, 1 between two lines."""
    if break_streak is None and paper_grain is None:
        return position
    return _bisect(
        lambda coverage: uneven_width(coverage, look, break_streak, paper_grain) - position,
        len(position),
    )


def _coverage_from(streak: np.ndarray, table: np.ndarray) -> np.ndarray:
    """Coverages whose thresholds, in a table by coverage, are the given streaks; float32."""
    coverages = np.linspace(0, 1, COVERAGE_STEPS)
    return np.interp(streak, table[::-1], coverages[::-1]).astype(np.float32)


def _bisect(excess: Callable[[np.ndarray], np.ndarray], count: int) -> np.ndarray:
    """(count,) float32 coverages, 0 to 1, from which `excess` of the coverage is above 0."""
    low, high = np.zeros((2, count), dtype=np.float32)
    high += 1
    for _ in range(BISECTION_STEPS):
        middle = np.float32(0.5) * (low + high)
        is_covered = excess(middle) > 0
        high[is_covered], low[~is_covered] = middle[is_covered], middle[~is_covered]
    return np.float32(0.5) * (low + high)


def cyclic_weights(first_weights: np.ndarray) -> list[np.ndarray]:
    """Return the weights of `ordered_thresholds` for lines that follow each other in the order of M.

    Parameters
    ----------
    first_weights : (M, P) float32 ndarray
        How much each line comes first; the sum is 1.
    """
    weights = [first_weights]
    for layer in range(1, min(len(first_weights), MAX_LAYERS)):
        weights.append(weights[-1] + np.roll(first_weights, layer, axis=0))
    return weights


def ordered_thresholds(
    thresholds: np.ndarray, weights: Sequence[np.ndarray], undefined: np.ndarray, look: Look
) -> np.ndarray:
    """Sort the thresholds of lines by their order.

    Parameters
    ----------
    thresholds : (M, P) float32 ndarray
        From `line_thresholds`.
    weights : sequence of min(M, MAX_LAYERS) (M, P) float32 ndarrays
        For each place in the order, how much each line has this place or an earlier one.
    undefined : (P,) bool ndarray
        Where there are no lines, and the thresholds of the first hold for all ink together.
    look : Look
        Its `layers` and `layering` are used where the field is undefined.

    Returns
    -------
    (min(M, MAX_LAYERS), P) float32 ndarray
        Independent of each other, and evenly distributed from 0 to 1.
    """
    count = len(thresholds)
    layers = min(count, MAX_LAYERS)
    if count == 1:
        return thresholds
    # What is left of the density of each line, and whether it has begun.
    density = -np.log1p(-np.minimum(thresholds, np.float32(1 - np.exp(-MAX_DENSITY))))
    has_begun = np.zeros(density.shape, dtype=bool)
    ordered = np.empty((layers, density.shape[1]), dtype=np.float32)
    points = np.arange(density.shape[1])
    for layer in range(layers):
        share = np.where(has_begun, np.float32(0), weights[layer])
        share /= np.maximum(share.sum(axis=0), np.float32(1e-6))
        begin = np.full(density.shape, np.inf, dtype=np.float32)
        np.divide(density, share, out=begin, where=share > 0)
        begin[has_begun] = np.inf
        next_line = begin.argmin(axis=0)
        earliest = np.minimum(begin[next_line, points], np.float32(MAX_DENSITY))
        ordered[layer] = -np.expm1(-earliest)
        density -= share * earliest
        np.maximum(density, 0, out=density)
        has_begun[next_line, points] = True
    if undefined.any():
        ordered[0, undefined] = _first_of_all(
            thresholds[0, undefined], min(look.layers, layers), look.layering
        )
        ordered[1:, undefined] = 1
    return ordered


def layer_shares(darkness: np.ndarray, layers: int, layering: float) -> list[np.ndarray]:
    """Compute the shares of the lines, by their order, as `hatching.line_shares` does.

    Parameters
    ----------
    darkness : ndarray
        1 - transmittance.
    layers : int
        Number of lines.
    layering : float
        Of the look.
    """
    weights = onset_weights(darkness, [layer * layering for layer in range(layers)])
    total = np.add.reduce(weights)
    return [weight / total for weight in weights]


def _first_of_all(threshold: np.ndarray, layers: int, layering: float) -> np.ndarray:
    """Thresholds of the first line, with which it alone has the coverage of all lines together."""
    density = np.linspace(0, MAX_DENSITY, DENSITY_STEPS)
    first = density * layer_shares(-np.expm1(-density), layers, layering)[0]
    first = np.maximum.accumulate(first)
    total = -np.log1p(-np.minimum(threshold, 1 - np.exp(-MAX_DENSITY)))
    return -np.expm1(-np.interp(total, density, first))


def threshold_pixels(ordered: np.ndarray, resolved: np.ndarray | float = 1.0) -> np.ndarray:
    """Store ordered thresholds as the channels of pixels.

    Parameters
    ----------
    ordered : (L, P) float32 ndarray
        From `ordered_thresholds`.
    resolved : (L, P) or (P,) ndarray, or float
        0 to 1: how much of the contrast of the lines is drawn. They are a mean tone where it is 0.

    Returns
    -------
    (P, 4) float32 ndarray
        The thresholds in red, green and blue, rounded to multiples of 1 / 255; missing ones repeat the
        first. Alpha is the mean of (2 t - 1)^2 of the three thresholds t. Where pixels are averaged, it
        exceeds that of the averages by the spread of the thresholds, so that what is finer than a
        pixel can be drawn as its mean.
    """
    resolved = np.broadcast_to(resolved, ordered.shape)
    rgba = np.empty((ordered.shape[1], 4), dtype=np.float32)
    for channel in range(3):
        layer = channel if channel < len(ordered) else 0
        value = 0.5 + resolved[layer] * (ordered[layer] - np.float32(0.5))
        rgba[:, channel] = np.rint(255 * value) / np.float32(255)
    centered = 2 * rgba[:, :3] - 1
    rgba[:, 3] = (centered * centered).mean(axis=1)
    # What is not drawn has the spread of all thresholds.
    rgba[:, 3] += (1 - np.square(resolved).mean(axis=0)) / 3
    return rgba


def picture_thresholds(
    field: PixelField,
    images: LicImages | None,
    look: Look,
    modulation: LineModulation,
    samples_per_side: int = 1,
) -> np.ndarray:
    """Compute the thresholds of the pixels of a picture.

    The lines are in the order in which they are drawn in a picture: that of their ranks. The outline has ink
    in any tone but the lightest. Antialiased pixels have the mean and the spread of a few thresholds across
    the lines.

    Parameters
    ----------
    field : PixelField
    images : LicImages
        Member images in the order of `all_members(field, look.guiding_angle)`.
    look : Look
        A `sharp_look`, in pixels of the frame.
    modulation : LineModulation
        Without `line_tones`.
    samples_per_side : int
        Samples of the frame along each side of a pixel.

    Returns
    -------
    (P, 4) float32 ndarray
        As of `threshold_pixels`.
    """
    lines, even_lines = range(field.line_count), modulation.even_lines
    places = np.stack([soft_rank_of(rank, field.line_count) for rank in line_ranks(field, look)])
    crowding = None
    if even_lines is not None:
        # Crowded lines come last, as in `line_shares`.
        crowding = np.stack([even_lines.crowding(line, look) for line in lines])
        places += field.line_count * crowding
        places -= places.min(axis=0)
    layers = range(min(field.line_count, MAX_LAYERS))
    weights = [np.clip(layer + 1 - places, 0, 1) for layer in layers]
    # How much each line has each place.
    share = np.diff(np.stack(weights), axis=0, prepend=np.float32(0))
    share /= np.maximum(share.sum(axis=1, keepdims=True), np.float32(1e-6))
    pixels = np.zeros((len(field.pixel), 4), dtype=np.float32)
    is_sampled = even_lines is not None or images.slopes is not None
    for (node, weight), level in zip(PIXEL_NODES, PIXEL_LEVELS, strict=True):
        if not is_sampled and node:
            continue
        resolved: np.ndarray | float = 1.0
        if even_lines is not None:
            sample, period = _even_sample(even_lines, crowding > level, node)
            part = modulation._replace(even_lines=sample)
            resolved = np.einsum("klp,lp->kp", share, resolved_share(period, samples_per_side))
        else:
            part = modulation
        if part.break_images is not None:
            part = part._replace(break_images=_streak_sample(part.break_images, node))
        part_images = _streak_sample(images, node)
        thresholds = np.stack([line_thresholds(line, part_images, look, part) for line in lines])
        ordered = ordered_thresholds(thresholds, weights, field.representation == 0, look)
        if modulation.outline is not None:
            ordered *= 1 - modulation.outline
        pixels += np.float32(weight if is_sampled else 1) * threshold_pixels(ordered, resolved)
    # The spread is that about the values that are stored.
    mean = pixels[:, :3]
    rounded = np.rint(255 * mean) / np.float32(255)
    pixels[:, 3] += (np.square(2 * rounded - 1) - np.square(2 * mean - 1)).mean(axis=1)
    pixels[:, :3] = rounded
    return pixels


def _streak_sample(images: LicImages, node: float) -> LicImages:
    """Return images beside the centers of pixels, at a node of `PIXEL_NODES`."""
    if images.slopes is None or not node:
        return images
    shift = np.float32(STREAK_REACH * node) * images.slopes
    return replace(images, members=images.members + shift[..., None])


def _even_sample(
    lines: EvenLines, is_coarse: np.ndarray, node: float
) -> tuple[EvenLines, np.ndarray]:
    """Return even lines beside the centers of pixels, at a node of `PIXEL_NODES`, and their period.

    `is_coarse`, (M, P) bool, says where they are replaced by those of larger distance.
    """
    streaks, period = lines.streaks, lines.period
    if lines.coarse_streaks is not None:
        streaks = np.where(is_coarse, lines.coarse_streaks, streaks)
        period = np.where(is_coarse, np.float32(COARSE_RATIO) * period, period)
    position = np.abs(1 - streaks + np.float32(node) / np.maximum(period, np.float32(1)))
    position = np.minimum(position, 2 - position)
    if lines.growth is not None:
        # Ink spreads from lines and from those that grow between them.
        between = 0.5 * lines.growth
        spread_between = (1 - position) / np.maximum(between, np.float32(1e-6))
        position = np.minimum(position / (1 - between), spread_between)
    return EvenLines(1 - position, lines.period, growth=None), period


def layer_inks(look: Look, line_count: int) -> tuple[int, Inks]:
    """Return the number of lines that cross at most, and their inks: one each, or one for all."""
    layers = min(look.layers, line_count, MAX_LAYERS)
    return layers, inks_of(look, layers if look.hue != "one" else 1)


def ink_of_thresholds(
    pixels: np.ndarray, tone: np.ndarray, look: Look, line_count: int
) -> tuple[np.ndarray, np.ndarray]:
    """Draw the ink of a tone, as the node group *RoSy Hatching* does.

    Parameters
    ----------
    pixels : (P, 4) float32 ndarray
        From `threshold_pixels`, or means of them.
    tone : (P,) ndarray
        Linear, 0 to 1.
    look : Look
        Its settings of the ink are used.
    line_count : int
        Number of lines through a point.

    Returns
    -------
    color : (P, 3) float32 ndarray
        Linear color of ink on paper, or of the ink alone if `look.clear_paper`.
    coverage : (P,) float32 ndarray
        0 to 1.
    """
    layers, inks = layer_inks(look, line_count)
    required = inks.target_transmittance(inks.complement_if_light(tone))
    colors = [
        inks.ink_at_tone(np.full(len(tone), min(layer, len(inks.dark) - 1)), tone)
        for layer in range(layers)
    ]
    left = [1 - inks.required_coverage(required, ink) for ink in colors]
    shares = layer_shares(1 - left[0], layers, look.layering)
    centered = 2 * pixels[:, :3] - 1
    spread = pixels[:, 3] - (centered * centered).mean(axis=1) - np.float32(ROUNDING_SPREAD)
    spread = np.maximum(spread, 0)
    # Half the width of an even distribution with this spread, which is that of 2 t - 1 for thresholds t.
    filtered_edge = np.sqrt(EDGE_VARIANCE * spread)
    evenness = np.minimum(3 * spread, 1)
    correction = FILTER_CORRECTION * evenness * evenness * (1 - evenness)
    color = None if look.clear_paper else np.broadcast_to(inks.paper, (len(tone), 3))
    bare = np.ones(len(tone), dtype=np.float32)
    for layer in range(layers):
        coverage = 1 - np.maximum(left[layer], MIN_TRANSMITTANCE) ** shares[layer]
        room = np.minimum(coverage, 1 - coverage)
        inner = coverage * (1 - coverage)
        edge = DENSITY_FACTOR * softness(look.crispness) * inner
        edge = np.maximum(np.maximum(np.minimum(edge, room), filtered_edge), MIN_EDGE)
        corrected = coverage + correction * inner * (1 - 2 * coverage)
        covered = np.clip((corrected - pixels[:, layer]) / (2 * edge) + 0.5, 0, 1)
        # What is narrower than the edge covers no point of it entirely, be it ink or paper.
        missed = 1 - np.minimum(room / edge, 1)
        is_dark = coverage > 0.5
        covered = np.clip(covered, is_dark * missed, 1 - ~is_dark * missed)
        covered = is_dark + np.minimum(room / EXACT_ENDS, 1) * (covered - is_dark)
        ink = colors[layer]
        color = ink if color is None else color + covered[:, None] * (ink - color)
        bare *= 1 - covered
    return color.astype(np.float32), 1 - bare
