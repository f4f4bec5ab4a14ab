"""Make the input of a renderer for a mesh that is not in a scene of Blender, such as a mesh from a file."""

import numpy as np

from ..field.rosy_field import RosyField
from ..field.surface import Surface
from ..field.up_axis import UP_AXIS_MATRIX
from ..projection.gbuffer import MeshInstance
from ..projection.surface_tone import SurfaceTone


def mesh_instance(
    surface: Surface,
    field: RosyField | None = None,
    tone: SurfaceTone | None = None,
    color_values: np.ndarray | None = None,
) -> MeshInstance:
    """Return a surface as a mesh instance, rotated so that its upward axis is the z axis of world space.

    Parameters
    ----------
    surface : Surface
        The mesh. `Surface.up` is its upward axis.
    field : RosyField, optional
        Field on the faces. Without a field the mesh only hides what is behind it.
    tone : SurfaceTone, optional
        How light or dark the surface is drawn.
    color_values : (C,) float32 ndarray, optional
        Values for the color map, at the C corners of the mesh.
    """
    return MeshInstance(surface, UP_AXIS_MATRIX[surface.up], field, tone, color_values)
