"""How evenly strokes are spaced, measured: apart from what spaced them.

At points along all strokes, and on either side of each, the gap is how far it is across the stroke
to the next stroke of its family, over the spacing asked for there. The next stroke is that which
passes abeam: where the line across the first meets it. Distances are chords, made longer by what
the surface bends between the two normals.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..field.frames import dot, unit
from .ground import Ground
from .nearby import Nearby
from .strokes import Strokes
from .walk import Walkers, go_straight

#: Shares of the spacing: between the points of strokes that are compared, and how far is looked.
FINE, REACH = 0.1, 2.0

#: A stroke's gap to itself counts past so many spacings of its length.
OWN = 2.5


class Gaps(NamedTuple):
    """At n points of strokes, on their left (0) and right (1).

    Attributes
    ----------
    point : (n,) int64 ndarray
        Of the strokes.
    gap : (n, 2) float64 ndarray
        In spacings; inf if there is none within `REACH`.
    free : (n, 2) bool ndarray
        Whether the surface goes on to that side for 1.25 spacings: where it ends, or a crease
        stops strokes, none is to be expected.
    nearest : (n,) float64 ndarray
        How far the nearest point of any other stroke of the family is, in any direction.
    """

    point: np.ndarray
    gap: np.ndarray
    free: np.ndarray
    nearest: np.ndarray

    def even(self, tolerance: float = 0.25) -> float:
        """Share of the gaps, of those on free sides, that are within a tolerance of 1."""
        gap = self.gap[self.free]
        return float(np.mean(np.abs(gap - 1) <= tolerance)) if len(gap) else 1.0


def side_gaps(ground: Ground, strokes: Strokes, most: int = 20_000) -> Gaps:
    """Measure strokes that were traced on a ground; all of them, before any is hidden or cut.

    At `most` of their points or a few more, evenly taken.
    """
    arc = strokes.arc
    step = np.diff(arc, prepend=0)
    step[strokes.start[:-1]] = 0
    fine = strokes.densified(np.ceil(step / (FINE * strokes.spacing)).clip(1, 1000))
    way = _ways(fine)
    grid = Nearby(REACH * float(np.median(fine.spacing)), len(fine.points))
    grid.add(fine.points)
    own = np.flatnonzero(np.isfinite(fine.weights[:, 0]))
    point = np.flatnonzero(np.isfinite(strokes.weights[:, 0]))
    stride = max(len(own) // most, 1)
    own, point = own[::stride], point[::stride]
    gap, nearest = np.full((len(own), 2), np.inf), np.full(len(own), np.inf)
    for first in range(0, len(own), 1 << 12):
        part = slice(first, first + (1 << 12))
        gap[part], nearest[part] = _measured(ground, fine, way, grid, own[part])
    return Gaps(point, gap, _free(ground, fine, way, own), nearest)


def _measured(
    ground: Ground, fine: Strokes, way: np.ndarray, grid: Nearby, own: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    stroke = fine.stroke
    query, other = grid.around(fine.points[own], REACH * fine.spacing[own])
    mine = own[query]
    away = stroke[mine] != stroke[other]
    away |= fine.between(mine, other) > OWN * fine.spacing[mine]
    away &= dot(fine.normal[mine], fine.normal[other]) > 0.3
    query, other, mine = query[away], other[away], mine[away]
    normal = unit(fine.normal[mine] + fine.normal[other])
    delta = fine.points[other] - fine.points[mine]
    height = dot(delta, normal)
    same = np.abs(height) < 0.5 * np.sqrt(dot(delta, delta))
    one, two = mine[same], other[same]
    same[same] = ground.same_line(
        ground.upright(fine.triangle[one], fine.member[one], fine.normal[one]),
        fine.normal[one],
        ground.upright(fine.triangle[two], fine.member[two], fine.normal[two]),
        fine.normal[two],
    )
    query, other, mine, normal, delta, height = (
        values[same] for values in (query, other, mine, normal, delta, height)
    )
    flat = delta - height[:, None] * normal
    bend = np.arccos(np.clip(dot(fine.normal[mine], fine.normal[other]), -1, 1)) / 2
    longer = np.where(bend > 1e-6, bend / np.sin(np.maximum(bend, 1e-6)), 1)
    distance = np.sqrt(dot(flat, flat)) * longer
    spacing = fine.spacing[mine]
    nearest = np.full(len(own), np.inf)
    others = stroke[mine] != stroke[other]
    np.minimum.at(nearest, query[others], (distance / spacing)[others])
    ahead = dot(flat, way[mine])
    abeam = np.abs(ahead) <= 0.6 * FINE * spacing + 0.05 * distance
    side = (dot(flat, np.cross(fine.normal[mine], way[mine])) < 0).astype(np.intp)
    gap = np.full((len(own), 2), np.inf)
    np.minimum.at(gap, (query[abeam], side[abeam]), (distance / spacing)[abeam])
    return gap, nearest


def _ways(fine: Strokes) -> np.ndarray:
    """(n, 3) unit tangents."""
    way = np.zeros_like(fine.points)
    way[1:] = np.diff(fine.points, axis=0)
    first = fine.start[:-1]
    way[first] = way[first + 1]
    return unit(way)


def _free(ground: Ground, fine: Strokes, way: np.ndarray, own: np.ndarray) -> np.ndarray:
    triangle, weights = fine.triangle[own], fine.weights[own]
    ahead = dot(way[own], ground.x[triangle]) + 1j * dot(way[own], ground.y[triangle])
    ahead /= np.maximum(np.abs(ahead), 1e-300)
    start = Walkers(triangle, weights, ahead, np.ones(len(own)))
    free = np.empty((len(own), 2), dtype=bool)
    for side, turn in enumerate((1j, -1j)):
        wanted = 1.25 * fine.spacing[own]
        _, walked = go_straight(ground, start, ahead * turn, wanted)
        free[:, side] = walked >= 0.999 * wanted
    return free
