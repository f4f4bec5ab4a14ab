"""One direction of a field on each corner of a mesh, as an attribute for the Tangent input of shaders."""

from __future__ import annotations

from collections.abc import Mapping

import bpy
import numpy as np

from ..line_drawing.tangent_mesh import build_tangent_mesh
from ..progress import progress
from ..projection.gbuffer import MeshInstance
from ..surface_texture.direction_maps import corner_directions
from .field_attributes import VECTOR_TYPE, check_attribute_type, get_or_create_attribute
from .meshes import mesh_surface
from .read_field import read_mesh_field
from .write_field import check_writable

#: Name of the attribute.
DEFAULT_TANGENT_NAME = "rosy_tangent"


def mesh_tangents(mesh: bpy.types.Mesh, guiding_angle: float, name: str = "") -> np.ndarray:
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
    with progress(0.0, 0.1):
        surface = mesh_surface(mesh)
    with progress(0.1, 0.2):
        field = read_mesh_field(mesh, surface=surface)
    instance = MeshInstance(surface, np.eye(4), field)
    with progress(0.2, 0.4):
        tangent_mesh = build_tangent_mesh(instance)
    with progress(0.4, 1.0):
        vectors = corner_directions(tangent_mesh, guiding_angle)
    tangents = np.zeros((len(surface.corner_vertex), 3), dtype=np.float32)
    tangents[surface.triangles] = vectors
    return tangents


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
