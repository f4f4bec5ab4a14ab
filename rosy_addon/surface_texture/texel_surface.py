"""`TexelSurface`: a mesh instance and the texels of its UV map."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..line_drawing.tangent_mesh import TangentMesh
from ..projection.gbuffer import MeshInstance
from .charts import UvCharts
from .texels import Texels


class TexelSurface(NamedTuple):
    """A mesh instance and the texels of its UV map, with streamlines in steps of one length.

    Attributes
    ----------
    instance : MeshInstance
    mesh : TangentMesh
    charts : UvCharts
    texels : Texels
    step : float
        In Blender units.
    """

    instance: MeshInstance
    mesh: TangentMesh
    charts: UvCharts
    texels: Texels
    step: float

    def interpolated(self, vertex_values: np.ndarray, block: slice) -> np.ndarray:
        """Interpolate (V, K) values of vertices at some of the texels: (n, K) float32."""
        corners = self.instance.surface.triangle_vertex.take(self.texels.triangle[block], axis=0).T
        total = np.zeros((corners.shape[1], vertex_values.shape[1]), dtype=np.float32)
        for corner, weight in zip(corners, self.texels.barycentric[block].T, strict=True):
            total += weight[:, None] * vertex_values.take(corner, axis=0)
        return total
