"""The direction of a field at texels, as renderers read it: anisotropy maps of glTF, and flow maps.

An anisotropy map has the components along the tangent, which is the direction of u, and the bitangent. A
direction and its opposite mean the same there, so neither combing nor a seam shows, but a filter must not
average the two: the directions are combed. A flow map has the components along u and v, in which a shader
moves a texture.

The Khronos Group, "KHR_materials_anisotropy", 2023. Flow maps: Vlachos, "Water Flow in Portal 2", SIGGRAPH 2010
course "Advances in Real-Time Rendering".
"""

from __future__ import annotations

import numpy as np

from ..core.progress import progress, report
from ..field.rosy_field import RosyField
from ..field.surface import Surface
from ..line_drawing.tangent_mesh import TangentMesh, build_tangent_mesh, nearest_member
from ..projection.gbuffer import MeshInstance
from ..projection.pixel_blocks import pixel_blocks
from .charts import uv_tangents
from .line_order import CombedDirections, combed_directions
from .texels import TexelSurface

#: Label of the progress.
LABEL = "drawing directions"


def direction_map(on: TexelSurface, content: str, guiding_angle: float) -> np.ndarray:
    """Compute the anisotropy map or the flow map of a field.

    Parameters
    ----------
    on : TexelSurface
    content : {"anisotropy", "flow"}
    guiding_angle : float
        Direction that the direction of the map is near to; see `line_order`.

    Returns
    -------
    (P, 4) float32 ndarray
        As stored in the file, 0 to 1: the components of a unit vector, from -1 to 1, in red and green. Blue is
        1, and 0 where the field is undefined. Alpha is 1.
    """
    mesh, charts, texels = on.mesh, on.charts, on.texels
    with progress(0.0, 0.7):
        combed = combed_directions(mesh, guiding_angle)
    is_flow = content == "flow"
    tangents = None
    if not is_flow:
        with progress(0.7, 0.8):
            tangents = uv_tangents(on.instance.surface, mesh, charts)
    is_mirrored = charts.density < 0
    values = np.ones((len(texels), 4), dtype=np.float32)
    for block in pixel_blocks(len(texels)):
        report(0.8 + 0.2 * block.start / len(texels), LABEL)
        triangle, weights = texels.triangle[block], texels.barycentric[block]
        direction, is_defined = _directions_at(mesh, combed, triangle, weights)
        if is_flow:
            relative = charts.to_uv(triangle, direction)
            relative /= np.maximum(np.abs(relative), np.finfo(float).tiny)
        else:
            tangent = np.einsum("nk,nk->n", weights, tangents[triangle])
            relative = direction * np.exp(-1j * np.angle(tangent))
            relative[is_mirrored[triangle]] = relative[is_mirrored[triangle]].conj()
        values[block, 0], values[block, 1] = relative.real, relative.imag
        values[block, 2] = is_defined
    values[:, :2] = 0.5 + 0.5 * values[:, :2]
    return values


def corner_tangents(surface: Surface, field: RosyField, guiding_angle: float) -> np.ndarray:
    """Compute one direction of a field on each corner of a surface.

    Parameters
    ----------
    surface : Surface
    field : RosyField
    guiding_angle : float
        Direction that it is near to; see `line_order`.

    Returns
    -------
    (C, 3) float32 ndarray
        Unit vectors in object space; 0 where the field is undefined.
    """
    with progress(0.0, 0.3):
        mesh = build_tangent_mesh(MeshInstance(surface, np.eye(4), field))
    with progress(0.3, 0.9):
        combed = combed_directions(mesh, guiding_angle)
    report(0.9, LABEL)
    triangle = np.repeat(np.arange(len(mesh.x)), 3)
    weights = np.tile(np.eye(3, dtype=np.float32), (len(mesh.x), 1))
    direction, is_defined = _directions_at(mesh, combed, triangle, weights)
    vectors = mesh.to_world(triangle, direction) * is_defined[:, None]
    tangents = np.zeros((len(surface.corner_vertex), 3), dtype=np.float32)
    tangents[surface.triangles] = vectors.reshape(-1, 3, 3)
    return tangents


def _directions_at(
    mesh: TangentMesh, combed: CombedDirections, triangle: np.ndarray, weights: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return (n,) unit tangents of points, those nearest to the combed ones, and whether they are defined."""
    guide = combed.directions_at(triangle, weights)
    z = np.einsum("nk,nk->n", weights, mesh.z[triangle])
    member = nearest_member(guide, z, mesh.degree)
    return mesh.directions_at(triangle, weights, member), z != 0
