"""Strokes of a family that came nearer than they may, cut back.

While strokes grow, their samples keep a distance, half a spacing from one to the next. Where strokes
bend much within that, at singularities above all, they may come nearer between samples, or change
from one family to another next to each other; over folds they are nearer than they were along the
surface. There, and where ends may meet, they are looked at closely when all is drawn, and of two that
are too near the shorter one gives way.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..field.frames import dot, unit
from .ground import Ground
from .nearby import Nearby
from .strokes import Strokes

#: Share of the spacing that strokes are apart, at least: a little more than the half that is
#: promised, for what is between the points that are compared.
LEAST = 0.52

#: Radians by which directions of a family may be farther apart here than elsewhere.
SLACK = np.radians(10)

#: Shares of the spacing between points that are compared.
FINE = 0.1

#: Radians by which a stroke, or the field, turns within a spacing where it is looked at closely.
MUCH = np.radians(18)

#: The same of the surface under them, and that under their ends.
FOLD, FOLD_AT_END = np.radians(40), np.radians(12)

#: Around such places others are looked at within so many spacings.
REACH = 1.0

#: A stroke is compared with itself past so many spacings of its length.
OWN = 2.5

#: Cosine between normals, and height over distance, beyond which points are on different sheets.
FACING, HEIGHT = 0.1, 0.6


def kept_apart(ground: Ground, strokes: Strokes, shortest: float) -> Strokes:
    """Take out of strokes what is nearer than `LEAST` spacings to another of the same family.

    Of two points next to each other the strokes are of one family if their directions are nearer
    than half of what is between two lines.

    Parameters
    ----------
    ground : Ground
        On which they were traced.
    strokes : Strokes
        Of one family yet: they are not numbered.
    shortest : float
        What is left of a stroke and has fewer spacings goes, too.
    """
    bent = _looked_at(ground, strokes)
    if not bent.any():
        return strokes
    around = _around(strokes, bent)
    some = np.unique(strokes.stroke[around])
    point = np.concatenate(
        [np.arange(strokes.start[number], strokes.start[number + 1]) for number in some]
    )
    close = strokes.chosen(some)
    fine, whence = _fine(close, np.isin(point, around))
    too_near = _too_near(ground, fine, bent[point][whence], close.length)
    if not too_near.any():
        return strokes
    # Loops that are opened are open where they were closed, too.
    opened = np.flatnonzero(fine.closed & (np.bincount(fine.stroke, too_near) > 0))
    too_near[fine.start[:-1][opened]] = too_near[fine.start[1:][opened] - 1] = True
    too_near = _widened(fine, too_near)
    hit = np.unique(fine.stroke[too_near])
    left = fine.runs(~too_near, loose=False)
    whose = np.repeat(False, len(some))
    whose[hit] = True
    left = left.chosen(whose[_origin(fine, ~too_near)])
    left = replace(left, weights=ground.weights(left.triangle, left.points))
    left = left.chosen(left.length >= shortest * left.spacing[left.start[:-1]])
    whole = np.ones(len(strokes), dtype=bool)
    whole[some[hit]] = False
    joined = Strokes.joined(strokes.chosen(whole), left)
    return replace(joined, family=np.zeros(len(joined), dtype=np.int32), names=strokes.names)


def _looked_at(ground: Ground, strokes: Strokes) -> np.ndarray:
    """(n,) bool: the points of strokes beside which others may be too near."""
    fold = surface_turning(ground, strokes)
    bent = (turning(strokes) > MUCH) | (field_turning(ground, strokes) > MUCH) | (fold > FOLD)
    ends = np.stack([strokes.start[:-1], strokes.start[1:] - 1], axis=1)
    gap = strokes.points[ends[:, 1]] - strokes.points[ends[:, 0]]
    near = OWN * strokes.spacing[ends[:, 1]]
    meets = (dot(gap, gap) < near**2) & (strokes.length > 2 * near) & ~strokes.closed
    bent[ends] |= (fold[ends] > FOLD_AT_END) | meets[:, None]
    return bent


def surface_turning(ground: Ground, strokes: Strokes) -> np.ndarray:
    """(n,) radians by which shading normals turn within a spacing, whichever way one goes."""
    slope, normal = ground.gradient[strokes.triangle], ground.corner_normal[strokes.triangle]
    along = np.einsum("nk,nki->ni", slope.real, normal)
    across = np.einsum("nk,nki->ni", slope.imag, normal)
    return strokes.spacing * np.sqrt(dot(along, along) + dot(across, across))


def turning(strokes: Strokes) -> np.ndarray:
    """(n,) radians by which strokes turn, in space, from half a spacing before to as much after."""
    arc, stroke = strokes.arc, strokes.stroke
    span = 2 * (float(arc.max(initial=0)) + float(strokes.spacing.max(initial=0)))
    position = stroke * span + arc
    first, last = strokes.start[stroke], strokes.start[stroke + 1] - 1
    reach = 0.5 * strokes.spacing
    behind = np.clip(np.searchsorted(position, position - reach), first, last)
    ahead = np.clip(np.searchsorted(position, position + reach), first, last)
    one, other = strokes.member[behind], strokes.member[ahead]
    return np.arccos(np.clip(dot(one, other), -1, 1))


def field_turning(ground: Ground, strokes: Strokes) -> np.ndarray:
    """(n,) radians by which the field turns within a spacing, whichever way one goes from there."""
    z, slope = ground.z[strokes.triangle], ground.gradient[strokes.triangle]
    here = np.einsum("nk,nk->n", strokes.weights, z)
    along = np.einsum("nk,nk->n", slope.real, z) * here.conj()
    across = np.einsum("nk,nk->n", slope.imag, z) * here.conj()
    size = np.maximum(ground.degree * np.abs(here) ** 2, 1e-300)
    return strokes.spacing * np.hypot(along.imag, across.imag) / size


def _around(strokes: Strokes, bent: np.ndarray) -> np.ndarray:
    """Numbers of the points within `REACH` spacings of bent ones, and of some a little farther."""
    cell = REACH * float(strokes.spacing.max())
    cells = np.floor((strokes.points - strokes.points.min(axis=0)) / cell).astype(np.int64) + 1
    size = cells.max(axis=0) + 2
    stride = np.array([size[1] * size[2], size[2], 1])
    side = np.arange(-1, 2)
    offset = np.stack(np.meshgrid(side, side, side), axis=-1).reshape(-1, 3) @ stride
    middle = np.unique(cells[bent] @ stride)
    return np.flatnonzero(np.isin(cells @ stride, np.unique(middle[:, None] + offset)))


def _fine(strokes: Strokes, where: np.ndarray) -> tuple[Strokes, np.ndarray]:
    """With points at most `FINE` spacings apart around some; and the point at or after each, as it was."""
    step = np.diff(strokes.arc, prepend=0)
    step[strokes.start[:-1]] = 0
    step[1:][~(where[1:] | where[:-1])] = 0
    pieces = np.ceil(step / (FINE * strokes.spacing)).clip(1, 1000).astype(np.int64)
    return strokes.densified(pieces), np.repeat(np.arange(len(pieces)), pieces)


def _too_near(ground: Ground, fine: Strokes, bent: np.ndarray, length: np.ndarray) -> np.ndarray:
    """(n,) bool: the points that are to go."""
    arc, stroke, spacing = fine.arc, fine.stroke, fine.spacing
    grid = Nearby(1.01 * LEAST * float(np.median(spacing)), len(stroke))
    grid.add(fine.points)
    query = np.flatnonzero(bent)
    own, other = grid.around(fine.points[query], LEAST * spacing[query])
    own = query[own]
    along = fine.between(own, other)
    apart = (stroke[own] != stroke[other]) | (along > OWN * spacing[own])
    own, other = own[apart], other[apart]
    here, there = fine.normal[own], fine.normal[other]
    normal, delta = here + there, fine.points[own] - fine.points[other]
    same = dot(here, there) > FACING
    same &= dot(delta, normal) ** 2 <= HEIGHT**2 * dot(delta, delta) * dot(normal, normal)
    one = ground.upright(fine.triangle[own], fine.member[own], here)
    two = ground.upright(fine.triangle[other], fine.member[other], there)
    # Over sharp bends it matters how directions are compared: carried over, or seen from above.
    above = unit(normal)
    ways = fine.member[own], fine.member[other]
    flat = [unit(way - dot(way, above)[:, None] * above) for way in ways]
    same &= ground.same_line(one, here, two, there, SLACK) | ground.same_line(
        flat[0], above, flat[1], above, SLACK
    )
    own, other = own[same], other[same]
    # The shorter one gives way; of one stroke, what is nearer to an end.
    to_end = np.minimum(arc, length[stroke] - arc)
    rank = np.where(stroke[own] == stroke[other], to_end[own], length[stroke[own]])
    other_rank = np.where(stroke[own] == stroke[other], to_end[other], length[stroke[other]])
    gives = (rank < other_rank) | ((rank == other_rank) & (own > other))
    found = np.zeros(len(stroke), dtype=bool)
    found[np.where(gives, own, other)] = True
    return found


def _widened(fine: Strokes, lost: np.ndarray) -> np.ndarray:
    """(n,) bool: the same, but no stretch so short that what is left of a stroke meets itself."""
    arc, stroke = fine.arc, fine.stroke
    span = 2 * (float(arc.max()) + float(fine.spacing.max()))
    position = stroke * span + arc
    edge = np.diff(np.concatenate([[0], (lost * (stroke + 1)), [0]]))
    changes = np.flatnonzero(edge)
    # Stretches of strokes one after the other share their change.
    first = changes[lost[np.minimum(changes, len(lost) - 1)] & (changes < len(lost))]
    last = changes[(changes > 0) & lost[np.maximum(changes - 1, 0)]] - 1
    wanted = (LEAST + 2 * FINE) * fine.spacing[first]
    more = np.maximum(wanted - (arc[last] - arc[first]), 0) / 2
    low = np.searchsorted(position, position[first] - more)
    high = np.searchsorted(position, position[last] + more, side="right")
    depth = np.zeros(len(lost) + 1, dtype=np.int64)
    np.add.at(depth, low, 1)
    np.add.at(depth, high, -1)
    return np.cumsum(depth[:-1]) > 0


def _origin(strokes: Strokes, kept: np.ndarray) -> np.ndarray:
    """(runs,) the stroke that each of `Strokes.runs` is of."""
    stroke = strokes.stroke
    begins = kept.copy()
    begins[1:] &= ~kept[:-1] | (stroke[1:] != stroke[:-1])
    run = np.cumsum(begins) - 1
    return stroke[begins][np.bincount(run[kept], minlength=int(begins.sum())) >= 2]
