"""Where strokes cross, and gaps there: one goes over, the other under."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from ..field.frames import unit
from .strokes import COLUMNS, Strokes

#: Pairs of pieces that are looked at at once: bounds memory.
PAIRS = 1 << 20


class Crossings(NamedTuple):
    """K places where two strokes cross.

    Attributes
    ----------
    stroke : (K, 2) int64 ndarray
    arc : (K, 2) float64 ndarray
        How far along each.
    """

    stroke: np.ndarray
    arc: np.ndarray


def crossings(strokes: Strokes) -> Crossings:
    """Find where strokes cross, as they were traced: before any is hidden.

    Two pieces cross if they lie in the same triangle and do so there.
    """
    arc, stroke = strokes.arc, strokes.stroke
    end = np.flatnonzero(np.diff(stroke, prepend=-1) == 0)
    end = end[np.argsort(strokes.triangle[end], kind="stable")]
    triangle = strokes.triangle[end]
    # Each piece with those after it that lie in the same triangle.
    last = np.searchsorted(triangle, triangle, side="right")
    count = last - np.arange(len(end)) - 1
    total = np.cumsum(count)
    found = []
    start = 0
    while start < len(end):
        done = total[start - 1] if start else 0
        stop = max(int(np.searchsorted(total, done + PAIRS, side="right")), start + 1)
        one = np.repeat(np.arange(start, stop), count[start:stop])
        begin = np.cumsum(count[start:stop]) - count[start:stop]
        two = one + 1 + np.arange(len(one)) - np.repeat(begin, count[start:stop])
        found.append(_met(strokes.points, stroke, end[one], end[two]))
        start = stop
    if not found:
        return Crossings(np.empty((0, 2), dtype=np.int64), np.empty((0, 2)))
    one, two, at_one, at_two = (np.concatenate(column) for column in zip(*found, strict=True))
    both = np.stack([one, two], axis=1)
    share = np.stack([at_one, at_two], axis=1)
    return Crossings(stroke[both], arc[both - 1] + share * (arc[both] - arc[both - 1]))


def _met(
    points: np.ndarray, stroke: np.ndarray, one: np.ndarray, two: np.ndarray
) -> tuple[np.ndarray, ...]:
    """Pairs of pieces, given by the points they end at, that cross, and where along each."""
    other = stroke[one] != stroke[two]
    one, two = one[other], two[other]
    p, q = points[one - 1], points[two - 1]
    r, s = points[one] - p, points[two] - q
    normal = np.cross(r, s)
    size = np.einsum("ni,ni->n", normal, normal)
    safe = np.where(size > 0, size, 1)
    t = np.einsum("ni,ni->n", np.cross(q - p, s), normal) / safe
    u = np.einsum("ni,ni->n", np.cross(q - p, r), normal) / safe
    met = (size > 0) & (t >= 0) & (t < 1) & (u >= 0) & (u < 1)
    return one[met], two[met], t[met], u[met]


def with_gaps(strokes: Strokes, gap: float, weave: bool = False) -> Strokes:
    """Leave a gap in one of two strokes where they cross.

    Parameters
    ----------
    strokes : Strokes
        As they were traced.
    gap : float
        Its length, in spacings.
    weave : bool
        Strokes go over and under in turn; else those of the first families go over.
    """
    met = crossings(strokes)
    if not len(met.stroke):
        return strokes
    if weave:
        under = _turns(met)
    else:
        family = strokes.family[met.stroke]
        under = np.where(family[:, 0] > family[:, 1], 0, 1)
        same = family[:, 0] == family[:, 1]
        under[same] = np.argmax(met.stroke[same], axis=1)
    row = np.arange(len(under))
    stroke, arc = met.stroke[row, under], met.arc[row, under]
    # Spacings change little over one.
    spacing = strokes.spacing[strokes.start[:-1]][stroke]
    return cut(strokes, stroke, arc - gap / 2 * spacing, arc + gap / 2 * spacing)


def _turns(met: Crossings) -> np.ndarray:
    """Which of two strokes goes under: every other crossing along the first of them."""
    order = np.lexsort((met.arc[:, 0], met.stroke[:, 0]))
    stroke = met.stroke[order, 0]
    begins = np.flatnonzero(np.diff(stroke, prepend=-1))
    rank = np.arange(len(order)) - np.repeat(begins, np.diff(np.append(begins, len(order))))
    under = np.empty(len(order), dtype=np.int64)
    under[order] = (rank + stroke) % 2
    return under


def cut(strokes: Strokes, stroke: np.ndarray, low: np.ndarray, high: np.ndarray) -> Strokes:
    """Take stretches out of strokes.

    Parameters
    ----------
    strokes : Strokes
    stroke : (k,) ndarray of int
    low, high : (k,) float64 ndarray
        From where to where along each, world space.
    """
    arc, own = strokes.arc, strokes.stroke
    span = 2 * (float(arc.max(initial=0)) + float(np.max(high - low, initial=0))) + 1
    total = strokes.length[stroke]
    inside_low, inside_high = np.maximum(low, 0), np.minimum(high, total)
    position = np.concatenate(
        [own * span + arc, stroke * span + inside_low, stroke * span + inside_high]
    )
    # At equal places: the end of a stretch, points, the beginning of one; but stretches that reach
    # the end of a stroke take that with them.
    count, cuts = len(own), len(stroke)
    whole_low, whole_high = low <= 0, high >= total
    zero = np.zeros(count)
    rank = np.concatenate([zero, np.where(whole_low, -2, 1), np.where(whole_high, 2, -1)])
    order = np.lexsort((rank, position))
    kind = np.concatenate([zero, np.ones(cuts), np.full(cuts, -1)])[order]
    stays = np.concatenate([zero == 0, ~whole_low, ~whole_high])[order]
    depth = np.cumsum(kind)
    # New points stay at either end of a stretch.
    kept = ((depth == 0) | ((depth == 1) & (kind == 1))) & stays
    after = np.clip(np.searchsorted(position[:count], position[order], side="left"), 0, count - 1)
    whose = np.concatenate([own, stroke, stroke])[order]
    after = np.minimum(np.maximum(after, strokes.start[whose] + 1), strokes.start[whose + 1] - 1)
    here = position[order] - whose * span
    length = arc[after] - arc[after - 1]
    share = np.clip((here - arc[after - 1]) / np.where(length > 0, length, 1), 0, 1)
    exact = kind == 0
    index = np.concatenate([np.arange(count), np.zeros(2 * cuts, dtype=np.int64)])[order]

    def mixed(values: np.ndarray) -> np.ndarray:
        weight = share.reshape((-1,) + (1,) * (values.ndim - 1))
        new = values[after - 1] + weight * (values[after] - values[after - 1])
        new[exact] = values[index[exact]]
        return new

    columns = {}
    for name in COLUMNS:
        values = getattr(strokes, name)
        if name in ("points", "normal", "spacing", "width", "opacity"):
            columns[name] = mixed(values)
        else:
            columns[name] = values[np.where(exact, index, after)]
    columns["normal"] = unit(columns["normal"])
    columns["weights"] = np.where(exact[:, None], columns["weights"], np.nan)
    size = np.bincount(whose, minlength=len(strokes))
    fuller = replace(
        strokes,
        **columns,
        start=np.concatenate([[0], np.cumsum(size)]),
    )
    # A run ends at each stretch, however short.
    return fuller.runs(kept, split=np.cumsum(kind == -1), loose=False)
