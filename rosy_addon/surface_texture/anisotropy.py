"""The direction of a field at texels, as renderers read it: the anisotropy map of glTF.

Red and green are the components of a unit vector along the tangent, which is the direction of u, and along
the bitangent, from -1 to 1; blue is the strength of the anisotropy. A direction and its opposite mean the
same, so neither combing nor a seam shows, but a filter must not average the two: the directions are combed.

The Khronos Group, "KHR_materials_anisotropy", 2023.
"""

from __future__ import annotations

import numpy as np

from ..line_drawing.tangent_mesh import nearest_member
from ..progress import Progress, Task, subtask
from ..projection.pixel_blocks import pixel_blocks
from .charts import uv_tangents_task
from .line_order import combed_directions_task
from .texel_surface import TexelSurface

#: Label of all steps.
STEP_LABEL = "drawing directions"


def anisotropy_task(on: TexelSurface, guiding_angle: float) -> Task[np.ndarray]:
    """Compute the anisotropy map of a field.

    Parameters
    ----------
    on : TexelSurface
    guiding_angle : float
        Direction that the line of the map is near to; see `line_order`.

    Yields
    ------
    Progress

    Returns
    -------
    (P, 3) float32 ndarray
        As stored in the file, 0 to 1. Where the field is undefined, the strength is 0.
    """
    mesh, charts, texels = on.mesh, on.charts, on.texels
    combed = yield from subtask(combed_directions_task(mesh, guiding_angle), 0.0, 0.7)
    tangents = yield from subtask(uv_tangents_task(on.instance.surface, mesh, charts), 0.7, 0.8)
    is_mirrored = charts.density < 0
    values = np.empty((len(texels), 3), dtype=np.float32)
    for block in pixel_blocks(len(texels)):
        yield Progress(0.8 + 0.2 * block.start / len(texels), STEP_LABEL)
        triangle, weights = texels.triangle[block], texels.barycentric[block]
        guide = np.exp(1j * np.angle(combed.first_at(triangle, weights)))
        z = np.einsum("nk,nk->n", weights, mesh.z[triangle])
        member = nearest_member(guide, z, mesh.degree)
        direction = mesh.directions_at(triangle, weights, member)
        tangent = np.einsum("nk,nk->n", weights, tangents[triangle])
        relative = direction * np.exp(-1j * np.angle(tangent))
        relative[is_mirrored[triangle]] = relative[is_mirrored[triangle]].conj()
        values[block, 0], values[block, 1] = relative.real, relative.imag
        values[block, 2] = z != 0
    values[:, :2] = 0.5 + 0.5 * values[:, :2]
    return values
