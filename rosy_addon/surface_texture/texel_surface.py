"""`TexelSurface`: a mesh instance and the texels of its UV map."""

from __future__ import annotations

from typing import NamedTuple

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
