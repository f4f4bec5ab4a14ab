"""Match the singularities of two fields on one surface."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..progress import report
from .surface import Surface

#: Singularities match if they are nearer than this fraction of the longest side of the mesh.
DEFAULT_REACH = 0.05

#: Distances that are computed at once.
DISTANCES_PER_BLOCK = 2_000_000


class SingularityMatching(NamedTuple):
    """M pairs of singularities of two fields that correspond to each other.

    Attributes
    ----------
    first, second : (M,) intp ndarray
        Which singularities of each field, as indices into its list.
    distance : (M,) float64 ndarray
        Between the two, in Blender units.
    """

    first: np.ndarray
    second: np.ndarray
    distance: np.ndarray


def match_on_surface(
    surface: Surface,
    singularities: tuple[np.ndarray, np.ndarray],
    other: tuple[np.ndarray, np.ndarray],
    reach: float = DEFAULT_REACH,
) -> SingularityMatching:
    """Match the singularities of two fields of the same degree on a surface.

    Parameters
    ----------
    surface : Surface
    singularities, other : (vertex, index)
        As `singularities.find_singularities` returns them.
    reach : float
        Largest distance of a pair, as a fraction of the longest side of the mesh.
    """
    (vertex, index), (other_vertex, other_index) = singularities, other
    return match_singularities(
        surface.vertices[vertex],
        index,
        surface.vertices[other_vertex],
        other_index,
        reach * surface.extent,
    )


def match_singularities(
    points: np.ndarray,
    index: np.ndarray,
    other_points: np.ndarray,
    other_index: np.ndarray,
    reach: float,
) -> SingularityMatching:
    """Match singularities of the same index, the nearest pairs first, each at most once.

    Parameters
    ----------
    points : (K, 3) float64 ndarray
        Where the singularities of the first field are.
    index : (K,) int ndarray
        In the same unit as `other_index`.
    other_points, other_index : (L, 3) float64 ndarray, (L,) int ndarray
        Of the second field.
    reach : float
        Largest distance of a pair, a straight line, in Blender units.

    Returns
    -------
    SingularityMatching
        In the order of `first`.
    """
    first, second, distance = _candidates(points, index, other_points, other_index, reach)
    order = np.lexsort((second, first, distance))
    first, second, distance = first[order], second[order], distance[order]
    matched = []
    while len(first):
        report(1.0, "matching singularities")
        # A pair is the nearest of both its singularities if it is the first with each of them.
        is_nearest = np.zeros(len(first), dtype=bool)
        is_nearest[np.unique(first, return_index=True)[1]] = True
        of_second = np.zeros(len(first), dtype=bool)
        of_second[np.unique(second, return_index=True)[1]] = True
        chosen = np.flatnonzero(is_nearest & of_second)
        matched.append((first[chosen], second[chosen], distance[chosen]))
        left = ~(np.isin(first, first[chosen]) | np.isin(second, second[chosen]))
        first, second, distance = first[left], second[left], distance[left]
    if not matched:
        return SingularityMatching(first, second, distance)
    first, second, distance = (np.concatenate(parts) for parts in zip(*matched, strict=True))
    order = np.argsort(first)
    return SingularityMatching(first[order], second[order], distance[order])


def _candidates(
    points: np.ndarray,
    index: np.ndarray,
    other_points: np.ndarray,
    other_index: np.ndarray,
    reach: float,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Find all pairs within reach whose indices are the same: both singularities, and distances."""
    empty = np.empty(0, dtype=np.intp)
    found = [(empty, empty, np.empty(0))]
    rows = max(DISTANCES_PER_BLOCK // max(len(other_index), 1), 1)
    for start in range(0, len(index), rows):
        report(start / len(index), "matching singularities")
        block = slice(start, start + rows)
        squared = np.zeros((len(index[block]), len(other_index)))
        for coordinate in range(3):
            squared += (points[block, None, coordinate] - other_points[None, :, coordinate]) ** 2
        near = (squared <= reach**2) & (index[block, None] == other_index)
        first, second = np.nonzero(near)
        found.append((first + start, second, np.sqrt(squared[first, second])))
    return tuple(np.concatenate(parts) for parts in zip(*found, strict=True))
