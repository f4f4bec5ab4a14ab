"""Creases and connected components of a mesh, from which its outline is drawn in any view."""

from functools import partial
from typing import NamedTuple

import numpy as np

from ..core.cache import Cache, cached
from ..core.progress import progress, report
from ..field.connectivity import connected_components
from ..field.creases import find_creases
from ..field.surface import Surface
from .face_values import similarity_scale


class OutlineMesh(NamedTuple):
    """The creases and the connected components of a mesh, which all its deformations share.

    Attributes
    ----------
    crease_ends : (n, 2) int32 ndarray
        The vertices of each edge of a crease.
    triangle_part : (T,) int32 ndarray or None
        The connected component of each triangle. None if there is only one component.
    """

    crease_ends: np.ndarray
    triangle_part: np.ndarray | None

    def crease_points(self, surface: Surface, matrix: np.ndarray) -> np.ndarray:
        """Return the ends of the edges of creases, (n, 2, 3), in world space without the translation.

        Parameters
        ----------
        surface : Surface
        matrix : (3, 3) or (4, 4) ndarray
            Object to world space.
        """
        linear = np.asarray(matrix, dtype=np.float64)[:3, :3]
        return surface.vertices[self.crease_ends] @ linear.T


def outline_mesh(surface: Surface, linear: np.ndarray, crease_angle: float | None) -> OutlineMesh:
    """Find the creases and the connected components of a mesh, in its rest shape.

    Creases neither appear nor vanish while a mesh is deformed, so outlines do not flicker.

    Parameters
    ----------
    surface : Surface
    linear : (3, 3) ndarray
        Object to world space, without the translation.
    crease_angle : float or None
        Angle between the normals of two faces, in radians, from which their edge can be a crease; see
        `find_creases`. If it is None, the mesh has no creases.
    """
    ends = np.empty((0, 2), dtype=np.int32)
    if crease_angle is not None:
        shape = surface.in_rest_shape()
        with progress(0.0, 0.6):
            ends = find_creases(shape.with_vertices(shape.vertices @ linear.T), crease_angle)
    report(0.6, "finding connected parts")
    pairs = np.stack([surface.corner_vertex, surface.corner_vertex[surface.next_corner]], axis=1)
    with progress(0.6, 1.0):
        part = connected_components(len(surface.vertices), pairs)
    part = part[surface.triangle_vertex[:, 0]]
    return OutlineMesh(ends, None if (part == part[0]).all() else part)


def cached_outline_mesh(
    surface: Surface, matrix: np.ndarray, crease_angle: float | None, cache: Cache | None
) -> OutlineMesh:
    """Return the result of `outline_mesh`, and store it in a cache if one is given.

    `matrix`, (3, 3) or (4, 4), maps object to world space. All deformations of a mesh share a result.
    """
    linear = np.asarray(matrix, dtype=np.float64)[:3, :3]
    if similarity_scale(linear) is not None:
        linear = np.eye(3)
    create = partial(outline_mesh, surface, linear, crease_angle)
    shape_key = surface.rest_shape_key, surface.corner_fan
    return cached(cache, create, "outline mesh", *shape_key, linear, crease_angle)
