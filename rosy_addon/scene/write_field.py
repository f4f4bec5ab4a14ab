"""Storing fields on meshes."""

from __future__ import annotations

import bpy
import numpy as np

from ..core.errors import RosyError, counted
from ..field.directional_field import field_directions
from ..field.frames import dot
from ..field.representation import face_frames
from ..field.rosy_field import RosyField
from .compat import has_rosy_properties, is_editable
from .field_attributes import (
    ANGLE_TYPE,
    DEFAULT_FIELD_NAME,
    VECTOR_TYPE,
    attribute_name,
    check_attribute_type,
    get_or_create_attribute,
    is_face_vector_field,
)
from .meshes import mesh_surface, read_attribute
from .rest_shape import store_rest_shape

#: Name of the attribute of a field that is stored as angles.
DEFAULT_ANGLE_NAME = "rosy_angle"

#: Forms in which a field can be stored: label and description in the user interface.
STORAGE_FORMS = {
    "VECTOR": ("One Vector", "One direction on each face, from which the others follow"),
    "DIRECTIONS": ("Directions", "All directions, as dir0, dir1 ... on faces"),
    "ANGLE": ("Angle", "The angle from each face's first edge, in radians"),
}


def assign_fields(
    fields: dict[bpy.types.Mesh, RosyField], name: str | None = None, form: str = "VECTOR"
) -> None:
    """Store fields on meshes, all or none of them.

    Parameters
    ----------
    fields : dict of bpy.types.Mesh to RosyField
    name : str, optional
        Name of the attribute. By default the existing field of each mesh is replaced; for "ANGLE",
        the name is `DEFAULT_ANGLE_NAME`.
    form : {"VECTOR", "DIRECTIONS", "ANGLE"}
        See `write_mesh_field`.

    Raises
    ------
    RosyError
        If a field cannot be stored on its mesh. Nothing is changed in this case.
    """
    names = {mesh: name or _default_name(mesh, form) for mesh in fields}
    for mesh, field in fields.items():
        _check_storable(mesh, field, names[mesh], form)
    for mesh, field in fields.items():
        _store(mesh, field, names[mesh], form)


def _default_name(mesh: bpy.types.Mesh, form: str) -> str:
    """Return the name of the attribute of a mesh's field in a form."""
    if form == "ANGLE":
        return DEFAULT_ANGLE_NAME
    name = attribute_name(mesh)
    is_other_form = form == "VECTOR" and name in mesh.attributes
    return DEFAULT_FIELD_NAME if is_other_form and not is_face_vector_field(mesh, name) else name


def write_mesh_field(
    mesh: bpy.types.Mesh, field: RosyField, name: str = DEFAULT_FIELD_NAME, form: str = "VECTOR"
) -> bpy.types.Attribute:
    """Store a field on a mesh. A field with the same name is replaced.

    Parameters
    ----------
    mesh : bpy.types.Mesh
    field : RosyField
    name : str
        Name of the attribute. Not used for "DIRECTIONS", whose attributes are ``dir0`` ...
        ``dir{N-1}``.
    form : {"VECTOR", "DIRECTIONS", "ANGLE"}
        See `STORAGE_FORMS`. A field with free directions is always stored as "DIRECTIONS", and a
        vector attribute with the name of the field is removed: it would be read instead. A RoSy
        field stored as "DIRECTIONS" keeps such an attribute.

    Returns
    -------
    bpy.types.Attribute
        The attribute, or the first of several.

    Raises
    ------
    RosyError
        If the mesh is linked from a library or in edit mode, its number of faces differs from the
        field's, an attribute of the name has another type or domain, or the field has free
        directions and the form is "ANGLE". Nothing is changed in this case.

    See Also
    --------
    read_mesh_field : The inverse.
    """
    name = name or DEFAULT_FIELD_NAME
    _check_storable(mesh, field, name, form)
    return _store(mesh, field, name, form)


def _store(mesh: bpy.types.Mesh, field: RosyField, name: str, form: str) -> bpy.types.Attribute:
    """Store a field that `_check_storable` has checked. Return the attribute, or the first."""
    if form == "DIRECTIONS" or field.direction_ratios is not None:
        attribute = _write_directions(mesh, field, name)
    elif form == "ANGLE":
        attribute = get_or_create_attribute(mesh, name, ANGLE_TYPE)
        x, y = face_frames(mesh_surface(mesh))
        angle = np.arctan2(dot(field.vectors, y), dot(field.vectors, x))
        angle[~field.vectors.any(axis=1)] = np.nan
        attribute.data.foreach_set("value", angle.astype(np.float32))
    else:
        attribute = get_or_create_attribute(mesh, name, VECTOR_TYPE)
        attribute.data.foreach_set("vector", field.vectors.astype(np.float32).ravel())
    if attribute.data_type == VECTOR_TYPE:
        stored_name = attribute.name
        store_rest_shape(mesh, stored_name)
        attribute = mesh.attributes[stored_name]  # new attributes may have moved it
    if has_rosy_properties():
        mesh.rosy.degree = field.degree
        if attribute.name == name:
            mesh.rosy.attribute = name
    mesh.update()
    return attribute


def overwrite_vectors(mesh: bpy.types.Mesh, vectors: np.ndarray) -> np.ndarray:
    """Replace the vectors of a field that is stored as one vector on each face, without any check.

    For changes that are shown while they are made. `write_mesh_field` stores the result.

    Parameters
    ----------
    mesh : bpy.types.Mesh
    vectors : (F, 3) ndarray

    Returns
    -------
    (F, 3) float32 ndarray
        The vectors before.
    """
    name = attribute_name(mesh)
    before = read_attribute(mesh, name, np.float32, 3)
    mesh.attributes[name].data.foreach_set("vector", vectors.astype(np.float32).ravel())
    mesh.update()
    return before


def _check_storable(mesh: bpy.types.Mesh, field: RosyField, name: str, form: str) -> None:
    """Raise an error if `write_mesh_field` cannot store a field. Nothing is changed."""
    check_writable(mesh)
    face_count = len(mesh.polygons)
    if len(field.vectors) != face_count:
        raise RosyError(
            f"mesh '{mesh.name}' has {counted(face_count, 'face')}, but the field has {len(field.vectors)}"
        )
    has_free_directions = field.direction_ratios is not None
    if form == "ANGLE" and has_free_directions:
        raise RosyError(
            f"mesh '{mesh.name}': the directions of its field are not a RoSy, so one angle cannot "
            "store them"
        )
    if has_free_directions and name in mesh.attributes:
        check_attribute_type(mesh, name, VECTOR_TYPE)
    names = [name]
    if form == "DIRECTIONS" or has_free_directions:
        names = [f"dir{index}" for index in range(field.degree)]
    for new_name in names:
        is_new = new_name not in mesh.attributes
        attribute = get_or_create_attribute(
            mesh, new_name, ANGLE_TYPE if form == "ANGLE" else VECTOR_TYPE
        )
        if is_new:
            mesh.attributes.remove(attribute)


def _write_directions(mesh: bpy.types.Mesh, field: RosyField, name: str) -> bpy.types.Attribute:
    """Store all directions of a field as ``dir0`` ... ``dir{N-1}``; remove ``dirN`` and so on."""
    directions = (
        field_directions(mesh_surface(mesh), field)
        if field.source_directions is None
        else field.source_directions
    )
    names = [f"dir{index}" for index in range(field.degree)]
    vector_attribute = mesh.attributes.get(name)
    if field.direction_ratios is not None and vector_attribute is not None:
        mesh.attributes.remove(vector_attribute)
    extra_index = field.degree
    while f"dir{extra_index}" in mesh.attributes:
        mesh.attributes.remove(mesh.attributes[f"dir{extra_index}"])
        extra_index += 1
    for direction_name, vectors in zip(names, directions.swapaxes(0, 1), strict=True):
        attribute = get_or_create_attribute(mesh, direction_name, VECTOR_TYPE)
        attribute.data.foreach_set("vector", vectors.astype(np.float32).ravel())
    return mesh.attributes["dir0"]


def check_writable(mesh: bpy.types.Mesh) -> None:
    """Raise an error if a mesh is linked from a library or in edit mode."""
    if not is_editable(mesh):
        library = mesh.library.filepath if mesh.library else "its library"
        raise RosyError(f"mesh '{mesh.name}' is linked from {library}: make it local first")
    if mesh.is_editmode:
        raise RosyError(f"mesh '{mesh.name}' is in edit mode: leave edit mode (Tab) first")
