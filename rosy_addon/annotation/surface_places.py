"""Places on a surface at even distances, in an order in which they are even from the first on.

The distance between places falls from level to level. They are found in space and in the rest shape, so they do not
depend on the view: a moving camera sees the same places.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

import numpy as np

from ..core.cache import Cache
from ..core.progress import report
from ..field.surface import Surface
from ..projection.progressive_samples import rest_areas, surface_samples

#: Levels in which the distance halves, and the number of the finest level. It has about 7000 places.
LEVELS_PER_OCTAVE, MAX_LEVEL = 3, 20

#: Points among which the places of a level are chosen, in the square of their distance.
CANDIDATES_PER_PLACE = 6


@dataclass(frozen=True, eq=False)
class SurfacePlaces:
    """P places on a surface, those of coarser levels first.

    Attributes
    ----------
    triangle : (P,) int32 ndarray
    barycentric : (P, 3) float64 ndarray
    distance : (P,) float64 ndarray
        Least distance to those before, in Blender units of the rest shape.
    level : int
        The last level; -1 if there is none.
    extent : float
        The distance of level 0: the side of a square of the area of the surface.
    """

    triangle: np.ndarray
    barycentric: np.ndarray
    distance: np.ndarray
    level: int
    extent: float

    @property
    def finest(self) -> float:
        """The distance of the last level. No point of the surface is much farther from all places."""
        return level_distance(self.extent, self.level)


def level_distance(extent: float, level: int) -> float:
    """Return the least distance between the places of a level, given that of level 0."""
    return extent * 2 ** (-level / LEVELS_PER_OCTAVE)


def surface_places(surface: Surface, distance: float, cache: Cache) -> SurfacePlaces:
    """Find places on a surface, down to the level at which they are as near as a distance, or further.

    Parameters
    ----------
    surface : Surface
    distance : float
        In Blender units of the rest shape.
    cache : Cache
        Stores the places. They are the same for all deformations of a mesh, and those of a level for any
        distance.

    Returns
    -------
    SurfacePlaces
        Not as near if that is beyond `MAX_LEVEL`.
    """
    key = "places", surface.rest_shape_key
    places = cache.get(key)
    if places is None:
        extent = float(np.sqrt(rest_areas(surface).sum()))
        places = SurfacePlaces(np.empty(0, np.int32), np.empty((0, 3)), np.empty(0), -1, extent)
    last = _wanted_level(places.extent, distance)
    if places.level >= last:
        return places
    report(0.0, "finding places of arrowheads")
    density = CANDIDATES_PER_PLACE / level_distance(places.extent, last) ** 2
    triangle, barycentric, rank = surface_samples(surface, density)
    order = np.argsort(rank, kind="stable")
    # The samples of a level are the first ones of these.
    triangle, barycentric, rank = triangle[order], barycentric[order], rank[order]
    for level in range(places.level + 1, last + 1):
        report(level / (last + 1), "finding places of arrowheads")
        density = CANDIDATES_PER_PLACE / level_distance(places.extent, level) ** 2
        count = int(np.searchsorted(rank, density))
        places = _with_level(surface, places, triangle[:count], barycentric[:count])
    return cache.put(key, places)


def _wanted_level(extent: float, distance: float) -> int:
    """Return the first level with a distance, or the finest; -1 if the surface has no area."""
    if not extent:
        return -1
    levels = level_distance(extent, np.arange(MAX_LEVEL + 1))
    return min(int(np.count_nonzero(levels > distance)), MAX_LEVEL)


def _with_level(
    surface: Surface, places: SurfacePlaces, triangle: np.ndarray, barycentric: np.ndarray
) -> SurfacePlaces:
    """Return places with those of the next level, chosen among points of triangles."""
    level = places.level + 1
    finest = level_distance(places.extent, level)
    distance = np.concatenate([places.distance, np.full(len(triangle), finest)])
    triangle = np.concatenate([places.triangle, triangle])
    barycentric = np.concatenate([places.barycentric, barycentric])
    corners = surface.in_rest_shape().vertices[surface.triangle_vertex[triangle]]
    chosen = spaced_points(np.einsum("nk,nki->ni", barycentric, corners), finest)
    return SurfacePlaces(
        triangle[chosen], barycentric[chosen], distance[chosen], level, places.extent
    )


def spaced_points(position: np.ndarray, spacing: float) -> np.ndarray:
    """Choose points, first come first served, with at least a distance between any two.

    Parameters
    ----------
    position : (n, d) float64 ndarray
        In order of preference.
    spacing : float

    Returns
    -------
    (K,) intp ndarray
        The chosen points, in ascending order.

    Notes
    -----
    A cell of the grid, with a diagonal of the spacing, has one point at most. In each round all points are chosen
    that come first in the 5^d cells around them, and those near them are left out. The result is that
    of taking one point after the other.
    """
    count, dimension = position.shape
    if not count:
        return np.empty(0, dtype=np.intp)
    cell, around = _cells(position, spacing / np.sqrt(dimension))
    cell_count = around.shape[1]
    chosen = []
    left = np.arange(count)
    while len(left):
        first = np.full(cell_count + 1, count)
        first[cell[left[::-1]]] = left[::-1]
        candidate = left[first[cell[left]] == left]
        earliest = np.full(len(candidate), count)
        for neighbor in around:
            np.minimum(earliest, first[neighbor[cell[candidate]]], out=earliest)
        new = candidate[earliest == candidate]
        chosen.append(new)
        taken = np.full(cell_count + 1, -1)
        taken[cell[new]] = new
        for neighbor in around:
            other = taken[neighbor[cell[left]]]
            near = np.flatnonzero(other >= 0)
            if not len(near):
                continue
            step = position[left[near]] - position[other[near]]
            is_near = (step * step).sum(axis=1) < spacing**2
            left = np.delete(left, near[is_near])
    return np.sort(np.concatenate(chosen))


def _cells(position: np.ndarray, side: float) -> tuple[np.ndarray, np.ndarray]:
    """Sort points into cells of a grid.

    Returns
    -------
    cell : (n,) intp ndarray
        The cell of each point, among the C cells that have points.
    around : (5^d, C) intp ndarray
        The cells around each of them, itself first; C where there is none.
    """
    index = ((position - position.min(axis=0)) / side).astype(np.int64) + 2
    stride = np.cumprod([1, *(index.max(axis=0) + 3)])[:-1]
    key, cell = np.unique(index @ stride, return_inverse=True)
    steps = np.array(list(product(range(-2, 3), repeat=position.shape[1])))
    steps = steps[np.argsort(np.abs(steps).sum(axis=1), kind="stable")]
    around = np.empty((len(steps), len(key)), dtype=np.intp)
    for step, out in zip(steps @ stride, around, strict=True):
        place = np.minimum(np.searchsorted(key, key + step), len(key) - 1)
        out[:] = np.where(key[place] == key + step, place, len(key))
    return cell.reshape(-1), around
