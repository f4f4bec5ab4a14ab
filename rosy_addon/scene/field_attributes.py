"""The mesh attributes that hold fields: their names, forms and values, and the rest shape stored with them.

The standard form is a vector attribute (FLOAT_VECTOR) on faces. It holds one member vector of the field per
face, in object space. The length of the vector is the magnitude of the field; it is zero where the field is
undefined. The name of the attribute and the degree are in ``mesh.rosy``. These forms can be read too:

- vectors on points or corners, averaged over each face;
- ``dir0`` ... ``dir{N-1}``: N directions of each face or point, which need not be rotations of one
  another; or ``dir0`` and ``dir1``: one direction of each line of a cross;
- a float on faces: the angle in radians between the face's first edge and a member,
  counterclockwise about the normal. The magnitude is 1. NaN is an error, or means undefined, as the parameter
  `nonfinite` of the reading function says.

Blender moves the vertices of a mesh when a transform or a modifier is applied, when objects are joined, and
in edit mode, but it does not rotate the vectors of attributes. So two hidden attributes record the shape of
the mesh at the time when a field was stored: the positions of the vertices, and a checksum of each vector.
The checksum shows whether the vector has been changed since. When the field is read, unchanged vectors are
rotated with their faces.
"""

from contextlib import suppress
from itertools import count, takewhile

import numpy as np
from bpy.types import Attribute, Mesh, Object

from ..core.errors import RosyError
from ..field.carry import carried_vectors
from ..field.surface import Surface
from .datablocks import field_mesh, has_rosy_properties
from .meshes import read_attribute, read_collection, write_attribute

DEFAULT_FIELD_NAME = "rosy"
DEFAULT_DEGREE = 4

#: Largest length of the name of a new attribute, in bytes. Before Blender 5.2, to create an attribute with a
#: longer name fails, and may rename another attribute.
MAX_NAME_BYTES = 67

#: Blender's data types of attributes with vectors, and of attributes with angles.
VECTOR_TYPE, ANGLE_TYPE = "FLOAT_VECTOR", "FLOAT"


def attribute_name(mesh: Mesh) -> str:
    """Return the name of the attribute that holds the mesh's field."""
    return (mesh.rosy.attribute if has_rosy_properties() else "") or DEFAULT_FIELD_NAME


def field_degree(mesh: Mesh) -> int:
    """Return the degree of the mesh's field."""
    return mesh.rosy.degree if has_rosy_properties() else DEFAULT_DEGREE


def direction_names(mesh: Mesh) -> list[str]:
    """Return the names ``dir0``, ``dir1`` ... of attributes of a mesh, up to the first one that is missing."""
    names = (f"dir{index}" for index in count())
    return list(takewhile(mesh.attributes.keys().__contains__, names))


def has_field(obj: Object) -> bool:
    """Return whether an object is a mesh with a field attribute, which may be invalid."""
    if obj.type != "MESH" or obj.data is None:
        return False
    mesh = field_mesh(obj)
    return attribute_name(mesh) in mesh.attributes or "dir0" in mesh.attributes


def is_face_vector_field(mesh: Mesh, name: str | None = None) -> bool:
    """Return whether the field is stored in the standard form: vectors on faces."""
    return _has_attribute(mesh, name or attribute_name(mesh), "FACE", VECTOR_TYPE)


def _has_attribute(mesh: Mesh, name: str, domain: str, data_type: str) -> bool:
    """Return whether a mesh has an attribute with this name, domain and type."""
    attribute = mesh.attributes.get(name)
    return attribute is not None and (attribute.domain, attribute.data_type) == (domain, data_type)


def field_values(attribute: Attribute, source: str, mesh: Mesh) -> np.ndarray:
    """Return the values of a field attribute: (n, 3) vectors or (n,) angles, float32.

    Row i is the value at face, point or corner i. `source` is the name of the attribute in messages.

    Raises
    ------
    RosyError
        If the type or domain of the attribute is not supported, or the mesh is in edit mode and
        the attribute cannot be read.
    """
    elements = {"FACE": mesh.polygons, "POINT": mesh.vertices, "CORNER": mesh.loops}
    is_vector = attribute.data_type == VECTOR_TYPE and attribute.domain in elements
    if not is_vector and (attribute.domain, attribute.data_type) != ("FACE", ANGLE_TYPE):
        raise RosyError(
            f"{source}: expected FLOAT_VECTOR on FACE, POINT or CORNER, or angles as FLOAT on FACE, "
            f"found {describe_type(attribute)}"
        )
    if len(attribute.data) != len(elements[attribute.domain]):
        raise RosyError(f"{source}: cannot be read in edit mode: leave edit mode (Tab) first")
    if is_vector:
        return read_collection(attribute.data, "vector", np.float32, 3)
    return read_collection(attribute.data, "value", np.float32)


def describe_type(attribute: Attribute) -> str:
    """Return the type and domain of an attribute, for a message."""
    return f"{attribute.data_type} on {attribute.domain}"


def check_attribute_type(mesh: Mesh, name: str, data_type: str, domain: str = "FACE") -> None:
    """Check that an attribute can be written: it has this type and domain, or can be created with them.

    Raises
    ------
    RosyError
        If an attribute of this name has another type or domain, or the name is too long for a new one.
    """
    attribute = mesh.attributes.get(name)
    if attribute is None and len(name.encode()) > MAX_NAME_BYTES:
        raise RosyError(
            f"mesh '{mesh.name}': '{name}' cannot be the name of an attribute: choose a shorter one"
        )
    if attribute is not None and (attribute.domain, attribute.data_type) != (domain, data_type):
        raise RosyError(
            f"mesh '{mesh.name}' already has an attribute '{name}' of another type "
            f"({describe_type(attribute)}): remove it, or choose another name"
        )


def ensure_attribute(mesh: Mesh, name: str, data_type: str, domain: str = "FACE") -> Attribute:
    """Return the attribute with this name, type and domain, and create it if it is missing.

    Raises
    ------
    RosyError
        If an attribute of this name has another type or domain, or Blender does not allow the name.
    """
    check_attribute_type(mesh, name, data_type, domain)
    attribute = mesh.attributes.get(name)
    if attribute is None:
        old_names = set(mesh.attributes.keys())
        attribute = mesh.attributes.new(name, data_type, domain)
        if attribute is None or attribute.name != name:
            # Blender may have created an attribute with another name without an error.
            for new_name in set(mesh.attributes.keys()) - old_names:
                mesh.attributes.remove(mesh.attributes[new_name])
            raise RosyError(
                f"mesh '{mesh.name}': '{name}' cannot be the name of an attribute: choose another one"
            )
    return attribute


def store_attribute(
    mesh: Mesh, name: str, data_type: str, values: np.ndarray, domain: str = "FACE"
) -> Attribute:
    """Create an attribute if it is missing, write its values, one row per element, and return it."""
    attribute = ensure_attribute(mesh, name, data_type, domain)
    write_attribute(attribute, values)
    return attribute


#: Coefficients of the checksum of a vector, which is a linear combination of its components. As it is linear,
#: it stays right when Blender interpolates attributes.
CHECK_COEFFICIENTS = np.array([1.0, 1.618034, 2.718282])

#: Largest difference between the checksum of an unchanged vector and the stored one, relative to the largest
#: component of the vector.
CHECK_TOLERANCE = 1e-4


def _attribute_names(name: str) -> tuple[str, str]:
    """Return the names of the attributes with the positions and the checksums of a field's attribute."""
    return f".{name}_rest", f".{name}_check"


def store_rest_shape(mesh: Mesh, name: str) -> None:
    """Store the present shape of a mesh for an attribute of vectors on faces.

    Nothing is stored if Blender does not allow the names of the hidden attributes. The vectors then do not
    follow later changes of the mesh.
    """
    rest_name, check_name = _attribute_names(name)
    vectors = read_attribute(mesh, name, np.float32, 3)
    positions = read_attribute(mesh, "position", np.float32, 3)
    with suppress(RosyError):
        store_attribute(mesh, rest_name, VECTOR_TYPE, positions, "POINT")
        store_attribute(mesh, check_name, ANGLE_TYPE, vector_checks(vectors))


def follow_mesh(mesh: Mesh, name: str, vectors: np.ndarray, surface: Surface) -> np.ndarray:
    """Rotate vectors with their faces, from the shape in which they were stored to the present one.

    Parameters
    ----------
    mesh : bpy.types.Mesh
        An original or evaluated mesh.
    name : str
        Name of the attribute. The shape in which it was stored is known if `store_rest_shape` was called.
    vectors : (F, 3) or (F, N, 3) ndarray
        Values of the attribute. If it is ``dir0``, the values of ``dir0`` ... ``dir{N-1}``.
    surface : Surface
        The surface of the mesh. If it has `rest_vertices`, these are the present shape.

    Returns
    -------
    ndarray
        The rotated vectors; see `carried_vectors`. A vector is not rotated if its checksum shows that it was
        changed after it was stored, for example by a script. If no vertex has moved, or if the stored shape
        is not known, `vectors` itself is returned.
    """
    rest_name, check_name = _attribute_names(name)
    # Users can convert attributes to other types.
    has_positions = _has_attribute(mesh, rest_name, "POINT", VECTOR_TYPE)
    if not (has_positions and _has_attribute(mesh, check_name, "FACE", ANGLE_TYPE)):
        return vectors
    stored_positions = read_attribute(mesh, rest_name, np.float32, 3)
    checks = read_attribute(mesh, check_name, np.float32, 1)
    positions = surface.vertices if surface.rest_vertices is None else surface.rest_vertices
    if stored_positions is None or checks is None or len(stored_positions) != len(positions):
        return vectors
    if np.array_equal(stored_positions, positions):
        return vectors
    first = vectors.reshape(len(vectors), -1, 3)[:, 0]
    is_stored = have_checks(first, checks).reshape(-1, *(1 for _ in vectors.shape[1:]))
    carried = carried_vectors(surface.in_rest_shape(), stored_positions, vectors)
    return np.where(is_stored, carried, vectors)


def have_checks(vectors: np.ndarray, checks: np.ndarray) -> np.ndarray:
    """Return which of (F, 3) vectors still have their stored checksum in `checks`, (F,), as (F,) bool."""
    with np.errstate(invalid="ignore", over="ignore"):
        length = np.abs(vectors).max(axis=1)
        return np.abs(vector_checks(vectors) - checks) <= CHECK_TOLERANCE * length


def vector_checks(vectors: np.ndarray) -> np.ndarray:
    """Return the checksums of (F, 3) vectors, (F,) float64."""
    return vectors.astype(np.float64) @ CHECK_COEFFICIENTS
