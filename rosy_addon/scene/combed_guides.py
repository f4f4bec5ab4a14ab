"""The guides that a brush has combed, stored on the mesh.

The attribute `GUIDE_ATTRIBUTE` (FLOAT_VECTOR on faces) holds one member vector of each face in object
space, whose length from 0 to 1 is the firmness of the guide. Beside it is the rest shape, as for fields, and
a check of the field that was made from the guides.
"""

from __future__ import annotations

import bpy
import numpy as np

from ..field.surface import Surface
from .field_attributes import (
    ANGLE_TYPE,
    VECTOR_TYPE,
    attribute_name,
    check_attribute_type,
    get_or_create_attribute,
    is_face_vector_field,
)
from .meshes import read_attribute
from .rest_shape import (
    CHECK_TOLERANCE,
    follow_mesh,
    read_rest_shape,
    store_rest_shape,
    vector_checks,
)

#: Name of the attribute, and of that of the checks of the field.
GUIDE_ATTRIBUTE, FIELD_CHECK_ATTRIBUTE = "rosy_guides", ".rosy_guides_field"

#: Guides of strokes have at least this firmness. Those that only keep the rest of the field have less.
STROKE_FIRMNESS = 0.25


def has_combed_guides(mesh: bpy.types.Mesh) -> bool:
    """Whether a mesh has combed guides."""
    return is_face_vector_field(mesh, GUIDE_ATTRIBUTE)


def read_combed_guides(mesh: bpy.types.Mesh, surface: Surface) -> np.ndarray:
    """Read the guides of a mesh.

    Parameters
    ----------
    mesh : bpy.types.Mesh
    surface : Surface
        Of the mesh.

    Returns
    -------
    (F, 3) float64 ndarray
        Zero on faces without a guide, and where something else has changed the field since.
    """
    guides = np.zeros((surface.face_count, 3))
    values = read_attribute(mesh, GUIDE_ATTRIBUTE, np.float32, 3)
    checks = read_attribute(mesh, FIELD_CHECK_ATTRIBUTE, np.float32, 1)
    field = read_attribute(mesh, attribute_name(mesh), np.float32, 3)
    if not has_combed_guides(mesh) or checks is None or not is_face_vector_field(mesh):
        return guides
    values = follow_mesh(read_rest_shape(mesh, GUIDE_ATTRIBUTE), values.astype(np.float64), surface)
    length = np.abs(field).max(axis=1)
    with np.errstate(invalid="ignore"):
        is_current = np.abs(vector_checks(field) - checks) <= CHECK_TOLERANCE * length
        is_current &= np.isfinite(values).all(axis=1)
    guides[is_current] = values[is_current]
    return guides


def check_guides_storable(mesh: bpy.types.Mesh) -> None:
    """Raise an error if `store_combed_guides` cannot store guides on a mesh."""
    check_attribute_type(mesh, GUIDE_ATTRIBUTE, VECTOR_TYPE)
    check_attribute_type(mesh, FIELD_CHECK_ATTRIBUTE, ANGLE_TYPE)


def store_combed_guides(mesh: bpy.types.Mesh, guides: np.ndarray) -> None:
    """Store (F, 3) guides, after the field that was made from them.

    Raises
    ------
    RosyError
        If the mesh has an attribute of the same name and another type.
    """
    check_guides_storable(mesh)
    attribute = get_or_create_attribute(mesh, GUIDE_ATTRIBUTE, VECTOR_TYPE)
    attribute.data.foreach_set("vector", guides.astype(np.float32).ravel())
    store_rest_shape(mesh, GUIDE_ATTRIBUTE)
    field = read_attribute(mesh, attribute_name(mesh), np.float32, 3)
    attribute = get_or_create_attribute(mesh, FIELD_CHECK_ATTRIBUTE, ANGLE_TYPE)
    attribute.data.foreach_set("value", vector_checks(field).astype(np.float32))
    mesh.update()
