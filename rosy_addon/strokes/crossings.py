"""Crossings of strokes, and gaps in the stroke that passes under another."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from ..field.frames import normalize
from .stroke_set import POINT_COLUMNS, Strokes

#: Pairs of segments that are intersected at once. Bounds memory.
PAIR_BATCH_SIZE = 1 << 20


class Crossings(NamedTuple):
    """K points at which two strokes cross.

    Attributes
    ----------
    stroke : (K, 2) int64 ndarray
        The two strokes.
    arc : (K, 2) float64 ndarray
        Arc length along each stroke up to the crossing, in world space.
    """

    stroke: np.ndarray
    arc: np.ndarray


def find_crossings(strokes: Strokes) -> Crossings:
    """Find where strokes cross.

    Only segments in the same triangle are compared.

    Parameters
    ----------
    strokes : Strokes
        As they were traced, before `clip_to_visible`.
    """
    arc, stroke = strokes.arc, strokes.stroke
    segment_end = np.flatnonzero(np.diff(stroke, prepend=-1) == 0)
    segment_end = segment_end[np.argsort(strokes.triangle[segment_end], kind="stable")]
    triangle = strokes.triangle[segment_end]
    # Pair each segment with the later segments in the same triangle.
    last = np.searchsorted(triangle, triangle, side="right")
    count = last - np.arange(len(segment_end)) - 1
    total = np.cumsum(count)
    batches = []
    start = 0
    while start < len(segment_end):
        done = total[start - 1] if start else 0
        stop = max(int(np.searchsorted(total, done + PAIR_BATCH_SIZE, side="right")), start + 1)
        first = np.repeat(np.arange(start, stop), count[start:stop])
        begin = np.cumsum(count[start:stop]) - count[start:stop]
        second = first + 1 + np.arange(len(first)) - np.repeat(begin, count[start:stop])
        batches.append(
            _intersect_segments(strokes.points, stroke, segment_end[first], segment_end[second])
        )
        start = stop
    if not batches:
        return Crossings(np.empty((0, 2), dtype=np.int64), np.empty((0, 2)))
    first, second, fraction_first, fraction_second = (
        np.concatenate(column) for column in zip(*batches, strict=True)
    )
    pairs = np.stack([first, second], axis=1)
    fraction = np.stack([fraction_first, fraction_second], axis=1)
    return Crossings(stroke[pairs], arc[pairs - 1] + fraction * (arc[pairs] - arc[pairs - 1]))


def _intersect_segments(
    points: np.ndarray, stroke: np.ndarray, first: np.ndarray, second: np.ndarray
) -> tuple[np.ndarray, ...]:
    """Return the pairs of segments that cross.

    Segments are given by the numbers of their end points. Pairs from one stroke are left out.

    Returns
    -------
    first, second : (m,) int64 ndarray
        The segments of each pair.
    fraction_first, fraction_second : (m,) float64 ndarray
        Position of the crossing on each segment, from 0 to 1.
    """
    distinct = stroke[first] != stroke[second]
    first, second = first[distinct], second[distinct]
    p, q = points[first - 1], points[second - 1]
    r, s = points[first] - p, points[second] - q
    normal = np.cross(r, s)
    norm_squared = np.einsum("ni,ni->n", normal, normal)
    denominator = np.where(norm_squared > 0, norm_squared, 1)
    t = np.einsum("ni,ni->n", np.cross(q - p, s), normal) / denominator
    u = np.einsum("ni,ni->n", np.cross(q - p, r), normal) / denominator
    crosses = (norm_squared > 0) & (t >= 0) & (t < 1) & (u >= 0) & (u < 1)
    return first[crosses], second[crosses], t[crosses], u[crosses]


def with_crossing_gaps(strokes: Strokes, gap: float, weave: bool = False) -> Strokes:
    """Cut a gap into one of the two strokes at each crossing.

    Parameters
    ----------
    strokes : Strokes
        As they were traced, before `clip_to_visible`.
    gap : float
        Length of the gap in spacings.
    weave : bool
        If true, strokes pass over and under in turn. Otherwise the stroke of the family with the
        lower number passes over.
    """
    crossings = find_crossings(strokes)
    if not len(crossings.stroke):
        return strokes
    if weave:
        under = _alternating_under(crossings)
    else:
        family = strokes.family[crossings.stroke]
        under = np.where(family[:, 0] > family[:, 1], 0, 1)
        same_family = family[:, 0] == family[:, 1]
        under[same_family] = np.argmax(crossings.stroke[same_family], axis=1)
    row = np.arange(len(under))
    stroke, arc = crossings.stroke[row, under], crossings.arc[row, under]
    # The gaps of a stroke are measured in the spacing at its start.
    spacing = strokes.spacing[strokes.start[:-1]][stroke]
    return cut_intervals(strokes, stroke, arc - gap / 2 * spacing, arc + gap / 2 * spacing)


def _alternating_under(crossings: Crossings) -> np.ndarray:
    """Return (K,) int64: 0 or 1, the stroke of each crossing that passes under.

    It alternates from crossing to crossing along the first stroke.
    """
    order = np.lexsort((crossings.arc[:, 0], crossings.stroke[:, 0]))
    stroke = crossings.stroke[order, 0]
    group_start = np.flatnonzero(np.diff(stroke, prepend=-1))
    rank = np.arange(len(order)) - np.repeat(
        group_start, np.diff(np.append(group_start, len(order)))
    )
    under = np.empty(len(order), dtype=np.int64)
    under[order] = (rank + stroke) % 2
    return under


def cut_intervals(
    strokes: Strokes, stroke: np.ndarray, low: np.ndarray, high: np.ndarray
) -> Strokes:
    """Remove intervals of arc length from strokes.

    Parameters
    ----------
    strokes : Strokes
    stroke : (k,) ndarray of int
        The stroke of each interval.
    low, high : (k,) float64 ndarray
        Arc lengths at which the intervals begin and end, in world space. Intervals may overlap and
        may reach beyond the ends of the stroke.

    Returns
    -------
    Strokes
        The parts that are left, with new points at the ends of the intervals.
    """
    arc, point_stroke = strokes.arc, strokes.stroke
    stride = 2 * (float(arc.max(initial=0)) + float(np.max(high - low, initial=0))) + 1
    stroke_length = strokes.length[stroke]
    clamped_low, clamped_high = np.maximum(low, 0), np.minimum(high, stroke_length)
    key = np.concatenate(
        [point_stroke * stride + arc, stroke * stride + clamped_low, stroke * stride + clamped_high]
    )
    # Order at equal arc length: ends of intervals, points, beginnings of intervals. An interval
    # that reaches an end of the stroke also removes the point there.
    point_count, interval_count = len(point_stroke), len(stroke)
    reaches_start, reaches_end = low <= 0, high >= stroke_length
    zeros = np.zeros(point_count)
    tie_break = np.concatenate(
        [zeros, np.where(reaches_start, -2, 1), np.where(reaches_end, 2, -1)]
    )
    order = np.lexsort((tie_break, key))
    event = np.concatenate([zeros, np.ones(interval_count), np.full(interval_count, -1)])[order]
    survives = np.concatenate([zeros == 0, ~reaches_start, ~reaches_end])[order]
    depth = np.cumsum(event)
    # Keep the points outside all intervals, and the new points at the ends of the intervals.
    kept = ((depth == 0) | ((depth == 1) & (event == 1))) & survives
    after = np.clip(np.searchsorted(key[:point_count], key[order], side="left"), 0, point_count - 1)
    owner = np.concatenate([point_stroke, stroke, stroke])[order]
    after = np.minimum(np.maximum(after, strokes.start[owner] + 1), strokes.start[owner + 1] - 1)
    arc_position = key[order] - owner * stride
    segment_length = arc[after] - arc[after - 1]
    fraction = np.clip(
        (arc_position - arc[after - 1]) / np.where(segment_length > 0, segment_length, 1), 0, 1
    )
    is_original = event == 0
    source = np.concatenate([np.arange(point_count), np.zeros(2 * interval_count, dtype=np.int64)])[
        order
    ]

    def interpolate(values: np.ndarray) -> np.ndarray:
        weight = fraction.reshape((-1,) + (1,) * (values.ndim - 1))
        result = values[after - 1] + weight * (values[after] - values[after - 1])
        result[is_original] = values[source[is_original]]
        return result

    columns = {}
    for name in POINT_COLUMNS:
        values = getattr(strokes, name)
        if name in ("points", "normal", "spacing", "width", "opacity"):
            columns[name] = interpolate(values)
        else:
            columns[name] = values[np.where(is_original, source, after)]
    columns["normal"] = normalize(columns["normal"])
    columns["weights"] = np.where(is_original[:, None], columns["weights"], np.nan)
    counts = np.bincount(owner, minlength=len(strokes))
    with_cuts = replace(
        strokes,
        **columns,
        start=np.concatenate([[0], np.cumsum(counts)]),
    )
    # Split at each interval, also where no point lies inside it.
    return with_cuts.runs_where(kept, split_labels=np.cumsum(event == -1), free_at_removed=False)
