"""Places on a surface at even distances, in an order in which they are even from the first on.

The distance between places falls from level to level. They are found in space and in the rest shape, so they do not
depend on the view: a moving camera sees the same places.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..cache import Cache
from ..field.surface import Surface
from ..progress import Progress, Task
from ..projection.progressive_samples import rest_areas, surface_samples
from .even_spacing import spaced_points

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
    finest : float
        The least of these distances. There are no farther places in between.
    """

    triangle: np.ndarray
    barycentric: np.ndarray
    distance: np.ndarray
    finest: float


def surface_places_task(surface: Surface, distance: float, cache: Cache) -> Task[SurfacePlaces]:
    """Find places on a surface, down to the level at which they are as near as a distance.

    Parameters
    ----------
    surface : Surface
    distance : float
        In Blender units of the rest shape.
    cache : Cache
        Stores the places. They are the same for all deformations of a mesh.

    Yields
    ------
    Progress

    Returns
    -------
    SurfacePlaces
        Not as near if that is beyond `MAX_LEVEL`.
    """
    key = "places", surface.rest_shape_key
    first = cache.get_or_create((*key, 0), lambda: _first_level(surface))
    level, places = 0, first
    while places.finest > distance and level < MAX_LEVEL:
        yield Progress(level / MAX_LEVEL, "finding places of arrowheads")
        level += 1
        coarser, finest = places, first.finest * 2 ** (-level / LEVELS_PER_OCTAVE)
        places = cache.get((*key, level))
        if places is None:
            places = cache.put((*key, level), _next_level(surface, coarser, finest))
    return places


def _first_level(surface: Surface) -> SurfacePlaces:
    """Return places whose distance is the side of a square of the area of the surface."""
    finest = float(np.sqrt(rest_areas(surface).sum()))
    none = SurfacePlaces(np.empty(0, np.int32), np.empty((0, 3)), np.empty(0), finest)
    return _next_level(surface, none, finest) if finest else none


def _next_level(surface: Surface, places: SurfacePlaces, finest: float) -> SurfacePlaces:
    """Return places, followed by others at least at a distance from all."""
    triangle, barycentric, rank = surface_samples(surface, CANDIDATES_PER_PLACE / finest**2)
    order = np.argsort(rank, kind="stable")
    triangle = np.concatenate([places.triangle, triangle[order]])
    barycentric = np.concatenate([places.barycentric, barycentric[order]])
    distance = np.concatenate([places.distance, np.full(len(order), finest)])
    vertices = surface.vertices if surface.rest_vertices is None else surface.rest_vertices
    corners = vertices[surface.triangle_vertex[triangle]]
    chosen = spaced_points(np.einsum("nk,nki->ni", barycentric, corners), finest)
    return SurfacePlaces(triangle[chosen], barycentric[chosen], distance[chosen], finest)
