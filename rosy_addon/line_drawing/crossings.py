"""Find crossings of strokes, and cut gaps into the strokes that pass under others."""

from collections.abc import Iterator
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from ..core.progress import progress, report
from ..field.blocks import blocks_of_ranges, concatenated_ranges
from ..field.formats.polygons import offsets_from_sizes
from ..field.frames import dot, normalize
from .stroke_set import POINT_COLUMNS, Strokes

#: Number of pairs of segments that are intersected at once. It bounds memory.
PAIR_BATCH_SIZE = 1 << 20

#: Sine of the angle between segments below which they count as parallel.
MIN_SINE = 1e-9

#: Strokes also cross where a segment ends within this fraction of its length before the other stroke.
#: Where two strokes cross at an edge of a triangle, all four segments end at the crossing, up to rounding.
END_TOLERANCE = 1e-6

#: Two crossings of the same strokes are one crossing if they are nearer than this along both, in spacings.
SAME_CROSSING = 1e-4

#: Difference between the sort keys of two successive strips, and tolerance of positions along strips; see
#: `_strip_keys`.
STRIP_STRIDE, ROUNDING = 4.0, 1e-6


class Crossings(NamedTuple):
    """K points at which two strokes cross.

    Attributes
    ----------
    stroke : (K, 2) int64 ndarray
        Indices of the two strokes.
    arc : (K, 2) float64 ndarray
        Arc length along each stroke up to the crossing, in world space.
    """

    stroke: np.ndarray
    arc: np.ndarray


def find_crossings(strokes: Strokes) -> Crossings:
    """Find the points at which two strokes cross on the surface.

    Only segments in the same triangle are compared.

    Parameters
    ----------
    strokes : Strokes
        Strokes as they were traced, before `clip_to_visible`.
    """
    arc, stroke = strokes.arc, strokes.stroke
    segment_end = np.flatnonzero(np.diff(stroke, prepend=-1) == 0)
    segment_end = segment_end[np.argsort(strokes.triangle[segment_end], kind="stable")]
    if not len(segment_end):
        return Crossings(np.empty((0, 2), dtype=np.int64), np.empty((0, 2)))
    batches = []
    for first, second in _close_pairs(strokes, segment_end):
        report(min(0.1 * len(batches), 0.9), "finding crossings")
        first, second = segment_end[first], segment_end[second]
        batches.append(_intersect_segments(strokes.points, stroke, first, second))
    first, second, *fractions = (np.concatenate(column) for column in zip(*batches, strict=True))
    order = np.lexsort((second, first, strokes.triangle[first]))
    pairs, fraction = (np.stack(both, axis=1)[order] for both in ((first, second), fractions))
    arc = arc[pairs - 1] + fraction * (arc[pairs] - arc[pairs - 1])
    kept = _first_of_each(stroke[pairs], arc, SAME_CROSSING * strokes.spacing[pairs[:, 0]])
    return Crossings(stroke[pairs[kept]], arc[kept])


def _first_of_each(stroke: np.ndarray, arc: np.ndarray, tolerance: np.ndarray) -> np.ndarray:
    """Return the rows of the crossings that do not repeat a crossing in an earlier row, in ascending order.

    Parameters
    ----------
    stroke : (m, 2) ndarray of int
        Indices of the two strokes of each crossing.
    arc : (m, 2) ndarray
        Arc length along each of these strokes up to the crossing, in world space.
    tolerance : (m,) ndarray
        Difference in arc length, in world space, up to which crossings of the same strokes are one crossing.
    """
    swapped = stroke[:, :1] > stroke[:, 1:]
    stroke = np.where(swapped, stroke[:, ::-1], stroke)
    arc = np.where(swapped, arc[:, ::-1], arc)
    order = np.lexsort((arc[:, 0], stroke[:, 1], stroke[:, 0]))
    stroke, arc = stroke[order], arc[order]
    is_new = np.ones(len(order), dtype=bool)
    is_far = np.abs(np.diff(arc, axis=0)) > tolerance[order[1:], None]
    is_new[1:] = ((np.diff(stroke, axis=0) != 0) | is_far).any(axis=1)
    return np.sort(np.minimum.reduceat(order, np.flatnonzero(is_new)))


def _close_pairs(
    strokes: Strokes, segment_end: np.ndarray
) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Yield, in batches, the pairs of segments of the same triangle that are close enough to cross.

    Each triangle is divided into strips as wide as its longest segment, and the segments of a strip
    are sorted along it. So a segment is compared only with the segments near it in its own strip and in
    the next one.

    Parameters
    ----------
    strokes : Strokes
    segment_end : (m,) ndarray of int
        Index of the point at which each segment ends, sorted by the triangle of the segment.

    Yields
    ------
    first, second : (k,) int64 ndarray
        The two segments of each pair, as indices into `segment_end`; first < second.
    """
    key, window = _strip_keys(strokes, segment_end)
    order = np.argsort(key, kind="stable")
    key, window = key[order], window[order]
    own_strip = np.arange(1, len(key) + 1), np.searchsorted(key, key + window, side="right")
    nearest, farthest = key + (STRIP_STRIDE - window), key + (STRIP_STRIDE + window)
    next_strip = np.searchsorted(key, nearest), np.searchsorted(key, farthest, side="right")
    for low, high in (own_strip, next_strip):
        for pair in blocks_of_ranges(low, np.maximum(high - low, 0), PAIR_BATCH_SIZE):
            segment, other = (order[place] for place in pair)
            yield np.minimum(segment, other), np.maximum(segment, other)


def _strip_keys(strokes: Strokes, segment_end: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return keys by which segments are sorted, and the largest difference of the keys of crossing segments.

    Each triangle is divided into numbered strips, which are as wide as its longest segment.

    Parameters
    ----------
    strokes : Strokes
    segment_end : (m,) ndarray of int
        Index of the point at which each segment ends, sorted by the triangle of the segment.

    Returns
    -------
    key : (m,) float64 ndarray
        Number of the strip times `STRIP_STRIDE`, plus the position along the strip, 0 to 1.
    window : (m,) float64 ndarray
        For each segment, the largest difference between its position along the strip and the position of a
        segment that crosses it. The keys of the two segments differ by at most this in the same strip, and by
        `STRIP_STRIDE` plus or minus at most this in successive strips.
    """
    start, end = strokes.points[segment_end - 1], strokes.points[segment_end]
    middle = (start + end) / 2
    triangle = strokes.triangle[segment_end]
    group_start = np.flatnonzero(np.diff(triangle, prepend=triangle[0] - 1))
    size = np.diff(np.append(group_start, len(segment_end)))
    length = np.linalg.norm(end - start, axis=1)
    reach = np.maximum.reduceat(length, group_start) * (1 + ROUNDING)
    low = np.minimum.reduceat(middle, group_start)
    extent = np.maximum.reduceat(middle, group_start) - low
    # The two axes along which the segments of a triangle spread most.
    row = np.arange(len(size))
    _, across, along = np.argsort(extent, axis=1).T
    strip_width = np.maximum(reach, extent[row, across] / size)
    strip_width[strip_width == 0] = 1
    # One strip more than needed, so that the last strip of a triangle is empty.
    strip_count = 2 + (extent[row, across] / strip_width).astype(np.int64)
    scale = np.maximum(extent[row, along], reach)
    scale[scale == 0] = 1
    first_strip = offsets_from_sizes(strip_count)[:-1]
    group = np.repeat(row, size)
    offset = middle - low[group]
    segment = np.arange(len(group))
    strip = first_strip[group] + (offset[segment, across[group]] / strip_width[group]).astype(int)
    position = offset[segment, along[group]] / scale[group]
    return strip * STRIP_STRIDE + position, (reach / scale)[group] + ROUNDING


def _intersect_segments(
    points: np.ndarray, stroke: np.ndarray, first: np.ndarray, second: np.ndarray
) -> tuple[np.ndarray, ...]:
    """Return the given pairs of segments that cross, and where they cross.

    A segment is given by the index of the point at which it ends. It begins at the point before that.
    Pairs of segments of the same stroke are left out.

    Parameters
    ----------
    points : (n, 3) float64 ndarray
        Points of all strokes, in world space.
    stroke : (n,) int ndarray
        Index of the stroke of each point.
    first, second : (k,) int64 ndarray
        The pairs to test, row by row.

    Returns
    -------
    first, second : (m,) int64 ndarray
        The two segments of each pair that crosses.
    fraction_first, fraction_second : (m,) float64 ndarray
        Position of the crossing on each segment, from 0 to 1.
    """
    distinct = stroke[first] != stroke[second]
    first, second = first[distinct], second[distinct]
    p, q = points[first - 1], points[second - 1]
    r, s = points[first] - p, points[second] - q
    normal = np.cross(r, s)
    norm_squared = dot(normal, normal)
    is_oblique = norm_squared > MIN_SINE**2 * (dot(r, r) * dot(s, s))
    denominator = np.where(is_oblique, norm_squared, 1)
    t = dot(np.cross(q - p, s), normal) / denominator
    u = dot(np.cross(q - p, r), normal) / denominator
    low, high = -END_TOLERANCE, 1 + END_TOLERANCE
    crosses = is_oblique & (t > low) & (t < high) & (u > low) & (u < high)
    return first[crosses], second[crosses], t[crosses], u[crosses]


def with_crossing_gaps(strokes: Strokes, gap: float) -> Strokes:
    """Cut a gap into one of the two strokes at each crossing, as if it passed under the other stroke.

    A stroke passes over and under in turn, as in a woven fabric.

    Parameters
    ----------
    strokes : Strokes
        Strokes as they were traced, before `clip_to_visible`.
    gap : float
        Length of a gap along the stroke, as a multiple of the spacing at the start of the stroke.
    """
    with progress(0.0, 0.6):
        crossings = find_crossings(strokes)
    report(0.6, "cutting gaps")
    if not len(crossings.stroke):
        return strokes
    under = _alternating_under(crossings)
    row = np.arange(len(under))
    stroke, arc = crossings.stroke[row, under], crossings.arc[row, under]
    # The gaps of a stroke are measured in the spacing at its start.
    spacing = strokes.spacing[strokes.start[:-1]][stroke]
    report(0.7, "cutting gaps")
    return cut_intervals(strokes, stroke, arc - gap / 2 * spacing, arc + gap / 2 * spacing)


def _alternating_under(crossings: Crossings) -> np.ndarray:
    """Return (K,) int64: 0 if the first stroke of a crossing passes under the second one, 1 if over it.

    The value alternates from crossing to crossing along the first stroke.
    """
    order = np.lexsort((crossings.arc[:, 0], crossings.stroke[:, 0]))
    stroke = crossings.stroke[order, 0]
    count = np.unique(stroke, return_counts=True)[1]
    under = np.empty(len(order), dtype=np.int64)
    under[order] = (concatenated_ranges(np.zeros_like(count), count) + stroke) % 2
    return under


def cut_intervals(
    strokes: Strokes, stroke: np.ndarray, low: np.ndarray, high: np.ndarray
) -> Strokes:
    """Remove intervals of arc length from strokes.

    Parameters
    ----------
    strokes : Strokes
    stroke : (k,) ndarray of int
        Index of the stroke from which each interval is removed.
    low, high : (k,) float64 ndarray
        Arc lengths at which the intervals begin and end, in world space. Intervals may overlap and
        may reach beyond the ends of the stroke.

    Returns
    -------
    Strokes
        The remaining parts of strokes, with new points at the ends of the intervals.
    """
    arc, point_stroke = strokes.arc, strokes.stroke
    stride = 2 * (float(arc.max(initial=0)) + float(np.max(high - low, initial=0))) + 1
    stroke_length = strokes.length[stroke]
    reaches_end = np.concatenate([low <= 0, high >= stroke_length])
    owner = np.concatenate([point_stroke, stroke, stroke])
    position = [arc, np.maximum(low, 0), np.minimum(high, stroke_length)]
    key = owner * stride + np.concatenate(position)
    # Order at equal arc length: ends of intervals, points, beginnings of intervals. An interval
    # that reaches an end of the stroke also removes the point there.
    point_count, interval_count = len(point_stroke), len(stroke)
    event = np.repeat([0, 1, -1], [point_count, interval_count, interval_count])
    tie_break, survives = event.copy(), event == 0
    tie_break[point_count:][reaches_end] *= -2
    survives[point_count:] = ~reaches_end
    order = np.lexsort((tie_break, key))
    event, survives, owner = event[order], survives[order], owner[order]
    depth = np.cumsum(event)
    # Keep the points outside all intervals, and the new points at the ends of the intervals.
    kept = ((depth == 0) | ((depth == 1) & (event == 1))) & survives
    new = np.flatnonzero(event)
    after = np.clip(np.searchsorted(key[:point_count], key[order[new]]), 0, point_count - 1)
    after = np.clip(after, strokes.start[owner[new]] + 1, strokes.start[owner[new] + 1] - 1)
    arc_position = key[order[new]] - owner[new] * stride
    segment_length = arc[after] - arc[after - 1]
    fraction = (arc_position - arc[after - 1]) / np.where(segment_length > 0, segment_length, 1)
    inserted = strokes.between(after, np.clip(fraction, 0, 1))
    inserted.weights[:] = np.nan
    cut = strokes.take_points(np.where(event == 0, order, 0))
    for name in POINT_COLUMNS:
        getattr(cut, name)[new] = getattr(inserted, name)
    start = offsets_from_sizes(np.bincount(owner, minlength=len(strokes)))
    with_cuts = replace(cut, normal=normalize(cut.normal), start=start)
    # Split at each interval, also where no point lies inside it.
    return with_cuts.runs_where(kept, split_labels=np.cumsum(event == -1), free_at_removed=False)
