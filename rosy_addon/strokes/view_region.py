"""The part of a mesh that can be in the picture: strokes are traced only there."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..projection.camera import Camera
from .tangent_mesh import TangentMesh

#: Distance from the frame, in pixels, up to which strokes are traced. They then reach the frame as if
#: the mesh went on.
MARGIN_PIXELS = 64.0


def restrict_to_view(mesh: TangentMesh, camera: Camera) -> TangentMesh:
    """Leave out the triangles that are beyond the frame, or behind the camera.

    Parameters
    ----------
    mesh : TangentMesh
    camera : Camera

    Returns
    -------
    TangentMesh
        With the same triangles. Those outside have no area, no field and no neighbors.
    """
    outside = _is_outside(mesh.points, camera)
    if not outside.any():
        return mesh
    is_cut = outside[:, None] | outside[mesh.neighbor]
    return replace(
        mesh,
        area=np.where(outside, 0.0, mesh.area),
        z=np.where(outside[:, None], 0.0, mesh.z),
        neighbor=np.where(is_cut, -1, mesh.neighbor).astype(mesh.neighbor.dtype),
    )


def _is_outside(corners: np.ndarray, camera: Camera) -> np.ndarray:
    """(T,) bool: whether all corners of a triangle are beyond the same side of the frame.

    Parameters
    ----------
    corners : (T, 3, 3) ndarray
        World space.
    camera : Camera
    """
    matrix = camera.projection @ camera.view
    x, y, z, w = np.moveaxis(corners @ matrix[:, :3].T + matrix[:, 3], -1, 0)
    right = w * (1 + 2 * MARGIN_PIXELS / camera.width)
    top = w * (1 + 2 * MARGIN_PIXELS / camera.height)
    sides = (x > right, x < -right, y > top, y < -top, z < -w)
    return np.logical_or.reduce([side.all(axis=1) for side in sides])
