"""Where the points of strokes are on their surface, so that they can follow it when it deforms."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..field.frames import dot
from ..projection.gbuffer import MeshInstance
from .stroke_set import Strokes


class SurfacePoints(NamedTuple):
    """Points at a height above the triangles of a mesh.

    Attributes
    ----------
    vertices : (n, 3) int32 ndarray
        Vertices of the triangles.
    weights : (n, 3) float64 ndarray
        Barycentric coordinates.
    height : (n,) float64 ndarray
        Along the normals of the vertices, in world space.
    """

    vertices: np.ndarray
    weights: np.ndarray
    height: np.ndarray


def surface_points(strokes: Strokes, height: np.ndarray, instance: MeshInstance) -> SurfacePoints:
    """Return the places of the points of strokes.

    Parameters
    ----------
    strokes : Strokes
    height : (n,) float64 ndarray
        Heights of the points above the surface, in world space.
    instance : MeshInstance
        The instance that all strokes are on.
    """
    surface = instance.surface
    corners = surface.triangle_vertex[strokes.triangle]
    a, b, c = instance.world_points()[corners].transpose(1, 0, 2)
    u, v, offset = b - a, c - a, strokes.points - a
    # Least squares: the nearest point of the plane.
    uu, uv, vv, pu, pv = dot(u, u), dot(u, v), dot(v, v), dot(offset, u), dot(offset, v)
    determinant = uu * vv - uv * uv
    is_flat = determinant <= 0
    determinant = np.where(is_flat, 1.0, determinant)
    along_u, along_v = (vv * pu - uv * pv) / determinant, (uu * pv - uv * pu) / determinant
    weights = np.stack([1 - along_u - along_v, along_u, along_v], axis=1)
    weights[is_flat] = 1 / 3
    return SurfacePoints(corners.astype(np.int32), weights, height)
