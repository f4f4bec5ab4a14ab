"""One direction of a field on each corner of a mesh, as an attribute for the Tangent input of shaders."""

from __future__ import annotations

from collections.abc import Mapping

import bpy
import numpy as np

from ..surface_texture.line_order import corner_tangents
from ..worker.job import Steps, call_steps, job
from .field_attributes import VECTOR_TYPE, check_attribute_type, get_or_create_attribute
from .meshes import mesh_surface
from .read_field import read_mesh_field
from .write_field import check_writable

#: Name of the attribute.
DEFAULT_TANGENT_NAME = "rosy_tangent"


@job
def mesh_tangents(mesh: bpy.types.Mesh, guiding_angle: float, name: str = "") -> Steps[np.ndarray]:
    """Compute one direction of a mesh's field on each corner.

    Parameters
    ----------
    mesh : bpy.types.Mesh
    guiding_angle : float
        Angle from the horizontal direction, in radians, of the line that the direction is near to.
    name : str
        Name of the attribute that is to store them, as for `assign_tangents`.

    Returns
    -------
    (C, 3) float32 ndarray
        Unit vectors in object space; 0 where the field is undefined.

    Raises
    ------
    RosyError
        If there is no field, or no attribute of this name can store tangents.
    """
    _check_storable(mesh, name)
    surface = mesh_surface(mesh)
    field = read_mesh_field(mesh, surface=surface)
    return call_steps(corner_tangents, surface, field, guiding_angle)


def assign_tangents(tangents: Mapping[bpy.types.Mesh, np.ndarray], name: str = "") -> None:
    """Store tangents on the corners of meshes, all or none of them.

    Parameters
    ----------
    tangents : mapping of bpy.types.Mesh to (C, 3) float32 ndarray
    name : str
        Name of the attribute; `DEFAULT_TANGENT_NAME` if it is empty.

    Raises
    ------
    RosyError
        If a mesh is linked from a library or in edit mode, or has an attribute of the name with
        another type or domain. Nothing is changed in this case.
    """
    for mesh in tangents:
        _check_storable(mesh, name)
    for mesh, vectors in tangents.items():
        attribute = get_or_create_attribute(
            mesh, name or DEFAULT_TANGENT_NAME, VECTOR_TYPE, "CORNER"
        )
        attribute.data.foreach_set("vector", vectors.ravel())
        mesh.update()


def _check_storable(mesh: bpy.types.Mesh, name: str) -> None:
    """Raise an error if tangents cannot be stored on a mesh."""
    check_writable(mesh)
    check_attribute_type(mesh, name or DEFAULT_TANGENT_NAME, VECTOR_TYPE, "CORNER")
