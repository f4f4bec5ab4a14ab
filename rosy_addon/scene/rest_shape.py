"""The shape that a mesh had when its field was stored, by which the field follows later changes.

Blender moves the vertices of a mesh when a transform or a modifier is applied, when objects are
joined, and in edit mode. It does not turn the vectors of attributes. Two hidden attributes beside
the field's tell how the faces have moved since: the positions of the vertices, and a number of each
face that shows whether its vector is still the one that was stored with them.
"""

from __future__ import annotations

import bpy
import numpy as np

from ..core.errors import RosyError
from ..field.carry import carried_vectors
from ..field.surface import Surface
from .field_attributes import ANGLE_TYPE, VECTOR_TYPE, get_or_create_attribute
from .meshes import read_attribute

#: Coefficients of a vector's components in its check. A sum of products stays right when Blender
#: interpolates attributes.
CHECK_COEFFICIENTS = np.array([1.0, 1.618034, 2.718282])

#: Largest difference of a check, relative to the length of the vector.
CHECK_TOLERANCE = 1e-4

#: Positions of the vertices and checks of the faces.
RestShape = tuple[np.ndarray, np.ndarray]


def _attribute_names(name: str) -> tuple[str, str]:
    """Return the names of the positions and the checks of a field's attribute."""
    return f".{name}_rest", f".{name}_check"


def store_rest_shape(mesh: bpy.types.Mesh, name: str) -> None:
    """Store the present shape beside an attribute of vectors on faces.

    Nothing is stored if Blender does not allow the names of the attributes. The field is then read
    as it is stored.
    """
    rest_name, check_name = _attribute_names(name)
    vectors = read_attribute(mesh, name, np.float32, 3)
    positions = read_attribute(mesh, "position", np.float32, 3)
    try:
        get_or_create_attribute(mesh, rest_name, VECTOR_TYPE, "POINT")
        get_or_create_attribute(mesh, check_name, ANGLE_TYPE)
    except RosyError:
        return
    # Only now: a new attribute may move the others in memory.
    mesh.attributes[rest_name].data.foreach_set("vector", positions.ravel())
    mesh.attributes[check_name].data.foreach_set("value", vector_checks(vectors).astype(np.float32))


def read_rest_shape(mesh: bpy.types.Mesh, name: str) -> RestShape | None:
    """Return the positions (V, 3) and checks (F,) beside an attribute; None if there are none.

    Parameters
    ----------
    mesh : bpy.types.Mesh
        Original or evaluated.
    name : str
        Name of the attribute that was stored with `store_rest_shape`.
    """
    if not _has_rest_shape(mesh, name):
        return None
    rest_name, check_name = _attribute_names(name)
    positions = read_attribute(mesh, rest_name, np.float32, 3)
    checks = read_attribute(mesh, check_name, np.float32, 1)
    return None if positions is None or checks is None else (positions, checks)


def follow_mesh(rest_shape: RestShape | None, vectors: np.ndarray, surface: Surface) -> np.ndarray:
    """Turn stored vectors as the faces were turned since they were stored.

    Parameters
    ----------
    rest_shape : (ndarray, ndarray) or None
        Of `read_rest_shape`.
    vectors : (F, 3) or (F, N, 3) ndarray
        The values of the attribute, or of several whose first it is.
    surface : Surface
        The surface of the mesh. If it is deformed, the vectors are turned to its rest shape.

    Returns
    -------
    ndarray
        `vectors` itself if there is nothing to turn. Vectors that were changed since, by a script
        for example, stay as they are; see `carried_vectors` for others that do.
    """
    if rest_shape is None:
        return vectors
    stored_positions, checks = rest_shape
    positions = surface.vertices if surface.rest_vertices is None else surface.rest_vertices
    if len(stored_positions) != len(positions):
        return vectors
    if np.array_equal(stored_positions, positions):
        return vectors
    first = vectors.reshape(len(vectors), -1, 3)[:, 0]
    with np.errstate(invalid="ignore", over="ignore"):
        length = np.abs(first).max(axis=1)
        is_stored = np.abs(vector_checks(first) - checks) <= CHECK_TOLERANCE * length
    carried = carried_vectors(surface.in_rest_shape(), stored_positions, vectors)
    is_stored = is_stored.reshape(-1, *(1 for _ in vectors.shape[1:]))
    return np.where(is_stored, carried, vectors)


def _has_rest_shape(mesh: bpy.types.Mesh, name: str) -> bool:
    """Whether both attributes exist as they were stored. Users can convert them to other types."""
    types = ("POINT", VECTOR_TYPE), ("FACE", ANGLE_TYPE)
    attributes = (mesh.attributes.get(hidden) for hidden in _attribute_names(name))
    return all(
        attribute is not None and (attribute.domain, attribute.data_type) == expected
        for attribute, expected in zip(attributes, types, strict=True)
    )


def vector_checks(vectors: np.ndarray) -> np.ndarray:
    """(F,) float64 checks of (F, 3) vectors."""
    return vectors.astype(np.float64) @ CHECK_COEFFICIENTS
