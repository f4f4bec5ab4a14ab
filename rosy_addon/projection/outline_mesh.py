"""What the outline of a mesh depends on besides the view: its creases, and its parts."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..cache import Cache
from ..field.creases import creases_task
from ..field.surface import Surface, connected_components_task
from ..progress import Progress, Task, subtask
from .face_values import SIMILARITY_EPS


class OutlineMesh(NamedTuple):
    """The creases and the parts of a mesh.

    Attributes
    ----------
    crease_points : (n, 2, 3) float64 ndarray
        The ends of each edge of a crease, in world space without the translation.
    triangle_part : (T,) int32 ndarray or None
        The part of each triangle. Parts are not connected with each other. None if there is only one.
    """

    crease_points: np.ndarray
    triangle_part: np.ndarray | None


def outline_mesh_task(
    surface: Surface, matrix: np.ndarray, crease_angle: float | None
) -> Task[OutlineMesh]:
    """Find the creases and the parts of a mesh.

    Parameters
    ----------
    surface : Surface
    matrix : (3, 3) or (4, 4) ndarray
        Object to world space. The translation has no effect.
    crease_angle : float or None
        See `creases_task`. None: no creases.
    """
    linear = np.asarray(matrix, dtype=np.float64)[:3, :3]
    ends = np.empty((0, 2), dtype=np.int32)
    if crease_angle is not None:
        shape = surface
        if not _is_similarity(linear):
            shape = surface.with_vertices(surface.vertices @ linear.T)
        ends = (yield from subtask(creases_task(shape, crease_angle), 0, 0.6)).ends
    yield Progress(0.6, "finding connected parts")
    pairs = np.stack([surface.corner_vertex, surface.corner_vertex[surface.next_corner]], axis=1)
    task = connected_components_task(len(surface.vertices), pairs)
    part = yield from subtask(task, 0.6, 1.0)
    part = part[surface.triangle_vertex[:, 0]]
    points = surface.vertices[ends] @ linear.T
    return OutlineMesh(points, None if (part == part[0]).all() else part)


def _is_similarity(linear: np.ndarray) -> bool:
    """Return whether a matrix keeps all angles."""
    gram = linear.T @ linear
    scale = np.trace(gram) / 3
    return bool(np.abs(gram - scale * np.eye(3)).max() <= SIMILARITY_EPS * scale)


def cached_outline_mesh_task(
    surface: Surface, matrix: np.ndarray, crease_angle: float | None, cache: Cache | None
) -> Task[OutlineMesh]:
    """Do the same as `outline_mesh_task`, with results stored in a cache if one is given."""
    if cache is None:
        return (yield from outline_mesh_task(surface, matrix, crease_angle))
    linear = np.ascontiguousarray(np.asarray(matrix, dtype=np.float64)[:3, :3])
    return (
        yield from cache.get_or_create_task(
            ("outline mesh", surface, linear.tobytes(), crease_angle),
            lambda: outline_mesh_task(surface, linear, crease_angle),
        )
    )
