"""The angle between two fields of a mesh, stored as an attribute on its faces."""

from __future__ import annotations

import re
from typing import NamedTuple

import bpy
import numpy as np

from ..core.errors import RosyError
from ..field.analysis import ErrorStatistics, compare_fields
from ..worker.job import Call, Steps, job
from .combed_guides import GUIDE_ATTRIBUTE
from .field_attributes import (
    VECTOR_TYPE,
    attribute_name,
    check_attribute_type,
    get_or_create_attribute,
)
from .meshes import mesh_label, mesh_surface
from .read_field import read_mesh_field
from .tangents import DEFAULT_TANGENT_NAME
from .write_field import check_writable

#: Name of the attribute with the angles, in degrees; NaN where a field is undefined.
DIFFERENCE_ATTRIBUTE = "Difference"

#: Vector attributes that are no fields.
_OTHER_VECTORS = ("position", GUIDE_ATTRIBUTE, DEFAULT_TANGENT_NAME)


class FieldDifference(NamedTuple):
    """How the field of a mesh differs from another one.

    Attributes
    ----------
    other : str
        Attribute of the other field.
    degree : int
        Of both.
    statistics : ErrorStatistics
        Of the angles, in radians.
    singularity_count, other_count : int
        Singularities of each field.
    matched_count : int
        Those that have the same index in both, at nearly the same place.
    """

    other: str
    degree: int
    statistics: ErrorStatistics
    singularity_count: int
    other_count: int
    matched_count: int


def other_field_names(mesh: bpy.types.Mesh) -> list[str]:
    """Return the names of the attributes that may hold another field of a mesh."""
    own = attribute_name(mesh)
    return [
        attribute.name
        for attribute in mesh.attributes
        if attribute.data_type == VECTOR_TYPE
        and attribute.name not in (own, *_OTHER_VECTORS)
        and not re.fullmatch(r"\..*|dir\d+", attribute.name)
    ]


@job
def store_difference(
    mesh: bpy.types.Mesh, other: str, name: str = DIFFERENCE_ATTRIBUTE
) -> Steps[FieldDifference]:
    """Compute the angle between the field of a mesh and another one, and store it on the faces.

    Parameters
    ----------
    mesh : bpy.types.Mesh
    other : str
        Attribute of the other field. Its degree is that of the mesh. If empty, the only one that there is.
    name : str
        Attribute that gets the angles in degrees.

    Raises
    ------
    RosyError
        If there is no such field, or the attribute cannot be written. Nothing is changed then.
    """
    check_writable(mesh)
    label = mesh_label(mesh)
    names = other_field_names(mesh)
    if not other and len(names) == 1:
        (other,) = names
    if not other or other == attribute_name(mesh):
        choice = " or ".join(f"'{known}'" for known in names)
        hint = f"choose {choice}" if choice else "make one with another name of the attribute"
        raise RosyError(f"{label}: needs another field to compare with: {hint}")
    check_attribute_type(mesh, name, "FLOAT")
    surface = mesh_surface(mesh, label)
    field = read_mesh_field(mesh, surface=surface)
    other_field = read_mesh_field(mesh, other, field.degree, surface)
    comparison = yield Call(compare_fields, (surface, field, other_field))
    attribute = get_or_create_attribute(mesh, name, "FLOAT")
    attribute.data.foreach_set("value", np.degrees(comparison.angles).astype(np.float32))
    mesh.update()
    return FieldDifference(
        other,
        field.degree,
        comparison.statistics,
        comparison.singularity_count,
        comparison.other_count,
        comparison.matched_count,
    )
