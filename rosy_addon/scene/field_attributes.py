"""Reading and writing fields as mesh attributes.

The standard form is a vector attribute (FLOAT_VECTOR) on faces. It holds one member vector of each
face in object space. Its length is the magnitude; it is zero where the field is undefined. The name
of the attribute and the degree are in ``mesh.rosy``. These forms can be read too:

- vectors on points or corners, averaged over each face;
- ``dir0`` ... ``dir{N-1}``: N directions of each face or point, which need not be rotations of one
  another;
- a float on faces: the angle in radians between the face's first edge and a member,
  counterclockwise about the normal. The magnitude is 1. NaN means undefined if the policy for
  values that are not finite allows it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import bpy
import numpy as np

from ..cache import Cache, content_hash
from ..color import REC709_LUMINANCE
from ..errors import RosyError
from ..field.directional_field import field_directions
from ..field.frames import dot, normalize, tangent_frame, transport
from ..field.representation import face_frames, from_representation, to_representation
from ..field.rosy_field import MAX_DEGREE, RosyField, check_degree
from ..field.surface import Surface, mean_per_face
from ..field.validate import (
    apply_nonfinite_policy,
    project_to_tangent,
    tangent_normals,
    validated_directions,
    validated_field,
)
from .compat import has_rosy_properties, is_editable
from .meshes import flush_edit_mode, mesh_surface, read_attribute

DEFAULT_FIELD_NAME = "rosy"
DEFAULT_DEGREE = 4

#: Temporary attribute while a scene is read: the normals of the original faces, on which the
#: field's vectors were given. Modifiers carry it to the evaluated mesh.
FACE_NORMAL_ATTRIBUTE = "rosy_face_normal"

_VECTOR, _FLOAT = "FLOAT_VECTOR", "FLOAT"


def attribute_name(mesh: bpy.types.Mesh) -> str:
    """Return the name of the attribute that holds the mesh's field."""
    return (mesh.rosy.attribute if has_rosy_properties() else "") or DEFAULT_FIELD_NAME


def field_degree(mesh: bpy.types.Mesh) -> int:
    """Return the degree of the mesh's field."""
    return mesh.rosy.degree if has_rosy_properties() else DEFAULT_DEGREE


def has_field(obj: bpy.types.Object) -> bool:
    """Whether an object is a mesh with a field attribute, which may be invalid."""
    if obj.type != "MESH" or obj.data is None:
        return False
    attributes = obj.data.attributes
    return attribute_name(obj.data) in attributes or "dir0" in attributes


def is_face_vector_field(mesh: bpy.types.Mesh, name: str | None = None) -> bool:
    """Whether the field is stored in the standard form: vectors on faces."""
    attribute = mesh.attributes.get(name or attribute_name(mesh))
    return attribute is not None and (attribute.domain, attribute.data_type) == ("FACE", _VECTOR)


def read_mesh_field(
    mesh: bpy.types.Mesh,
    name: str | None = None,
    degree: int | None = None,
    surface: Surface | None = None,
    *,
    nonfinite: str = "error",
    label: str | None = None,
    cache: Cache | None = None,
) -> RosyField:
    """Read the field of a mesh.

    Parameters
    ----------
    mesh : bpy.types.Mesh
        May be in edit mode.
    name : str, optional
        Name of the attribute. By default ``mesh.rosy.attribute``.
    degree : int, optional
        By default ``mesh.rosy.degree``.
    surface : Surface, optional
        The surface of the mesh, if it has been read already.
    nonfinite : {"error", "zero"}
        Raise an error if a value is not finite, or treat it as undefined.
    label : str, optional
        Name of the mesh in messages.
    cache : Cache, optional
        Keeps surfaces and fields that have not changed since an earlier call.

    Raises
    ------
    RosyError
        If there is no such attribute, its type or domain is not supported, or its values are not a
        field on the mesh (see `validated_field`). The message names the mesh and the attribute.

    See Also
    --------
    write_mesh_field : The inverse.
    """
    label = f"mesh '{mesh.name}'" if label is None else label
    flush_edit_mode(mesh)
    surface = mesh_surface(mesh, label, cache=cache) if surface is None else surface
    field_name = name or attribute_name(mesh)
    degree = check_degree(field_degree(mesh) if degree is None else degree)
    if field_name not in mesh.attributes and "dir0" in mesh.attributes:
        return _field_from_directions(mesh, surface, nonfinite, label, cache)
    attribute = mesh.attributes.get(field_name)
    if attribute is None:
        raise RosyError(
            f"{label} has no attribute '{field_name}' with a vector on faces{_attribute_hint(mesh)}"
        )
    source = f"{label}, attribute '{field_name}'"
    values = _field_values(attribute, source, mesh)

    def build_field() -> RosyField:
        if attribute.data_type == _FLOAT:
            return _field_from_angles(surface, values, degree, source, nonfinite)
        if attribute.domain == "CORNER":
            return _field_from_corners(surface, values, degree, source, nonfinite)
        domain = {"FACE": "face", "POINT": "vertex"}[attribute.domain]
        return validated_field(surface, values, degree, source, nonfinite, domain)

    attribute_type = attribute.domain, attribute.data_type
    return _cached_field(
        cache, surface, build_field, "given", *attribute_type, values, degree, source, nonfinite
    )


def read_face_vectors(mesh: bpy.types.Mesh, name: str) -> np.ndarray:
    """Read a vector attribute on faces, points or corners as one vector for each face.

    Vectors on points or corners are averaged over each face. The vectors need not be tangent.

    Returns
    -------
    (F, 3) float64 ndarray

    Raises
    ------
    RosyError
        If the attribute is of another type, or a value is not finite.
    """
    source = f"mesh '{mesh.name}', attribute '{name}'"
    attribute = mesh.attributes[name]
    values = _field_values(attribute, source, mesh).astype(np.float64)
    if values.ndim == 1:
        raise RosyError(f"{source}: expected a vector, found {_describe_type(attribute)}")
    apply_nonfinite_policy(values, source, attribute.domain.lower(), "error")
    if attribute.domain == "FACE":
        return values
    surface = mesh_surface(mesh)
    if attribute.domain == "POINT":
        values = values[surface.corner_vertex]
    return mean_per_face(values, surface.face_start)


def read_face_scalars(mesh: bpy.types.Mesh, name: str) -> np.ndarray:
    """Read an attribute or a vertex group as one number for each face.

    The attribute may be a float, an integer, a boolean or a color (its luminance is taken). Values
    on points or corners are averaged over each face.

    Returns
    -------
    (F,) float64 ndarray

    Raises
    ------
    RosyError
        If there is neither an attribute nor a vertex group of this name, the type or domain of the
        attribute is not supported, or a value is not finite.
    """
    surface = mesh_surface(mesh)
    source = f"mesh '{mesh.name}', '{name}'"
    attribute = mesh.attributes.get(name)
    if attribute is not None:
        domain, values = attribute.domain, scalar_values(attribute, source)
    else:
        obj = next(
            (
                other
                for other in bpy.data.objects
                if other.data == mesh and name in other.vertex_groups
            ),
            None,
        )
        if obj is None:
            raise RosyError(f"{source}: no attribute or vertex group has this name")
        group = obj.vertex_groups[name].index
        domain, values = "POINT", np.zeros(len(mesh.vertices))
        for vertex in mesh.vertices:
            for membership in vertex.groups:
                if membership.group == group:
                    values[vertex.index] = membership.weight
    if not np.isfinite(values).all():
        raise RosyError(f"{source}: has values that are not finite")
    if domain == "FACE":
        return values
    if domain == "POINT":
        values = values[surface.corner_vertex]
    return mean_per_face(values, surface.face_start)


def scalar_values(attribute: bpy.types.Attribute, source: str) -> np.ndarray:
    """Return the values of a scalar attribute. Colors are converted to linear luminance.

    Parameters
    ----------
    attribute : bpy.types.Attribute
    source : str
        Name of the attribute in messages.

    Returns
    -------
    (n,) float64 ndarray
        One value for each element of the domain.

    Raises
    ------
    RosyError
        If the attribute is not on faces, points or corners, or is neither a number nor a color.
    """
    count, data_type = len(attribute.data), attribute.data_type
    if attribute.domain not in ("FACE", "POINT", "CORNER"):
        raise RosyError(
            f"{source}: expected values on FACE, POINT or CORNER, found {_describe_type(attribute)}"
        )
    if data_type in ("FLOAT_COLOR", "BYTE_COLOR"):
        values = np.empty(4 * count, dtype=np.float32)
        attribute.data.foreach_get("color", values)
        return values.reshape(-1, 4)[:, :3] @ REC709_LUMINANCE
    dtypes = {"FLOAT": np.float32, "INT": np.int32, "INT8": np.int32, "BOOLEAN": bool}
    if data_type not in dtypes:
        raise RosyError(
            f"{source}: expected a number or a color, found {_describe_type(attribute)}"
        )
    values = np.empty(count, dtype=dtypes[data_type])
    attribute.data.foreach_get("value", values)
    return values.astype(np.float64)


@dataclass(frozen=True)
class FieldLayout:
    """The attributes that hold a field on an evaluated mesh.

    Attributes
    ----------
    name : str
        Name of the attribute with the member vectors, on faces. The ratio of direction k is in the
        attribute ``name_k`` if there are deviations.
    degree : int
    has_deviations : bool
        Whether the field has `RosyField.direction_ratios`.
    family_count : int
        See `RosyField`.
    """

    name: str
    degree: int
    has_deviations: bool = False
    family_count: int = 1

    @property
    def attribute_names(self) -> list[str]:
        """The names of all attributes: the member vectors, then the direction ratios."""
        indices = range(self.degree if self.has_deviations else 0)
        return [self.name, *(f"{self.name}_{index}" for index in indices)]


def add_temp_field(mesh: bpy.types.Mesh, field: RosyField, name: str) -> FieldLayout:
    """Store a field in temporary attributes on the faces of a mesh, and return their layout."""
    layout = FieldLayout(name, field.degree, field.direction_ratios is not None, field.family_count)
    add_temp_vectors(mesh, name, field.vectors)
    for index, deviation_name in enumerate(layout.attribute_names[1:]):
        deviation = field.direction_ratios[:, index]
        attribute = mesh.attributes.new(deviation_name, "FLOAT2", "FACE")
        pairs = np.stack([deviation.real, deviation.imag], axis=1).astype(np.float32)
        attribute.data.foreach_set("vector", pairs.ravel())
    mesh.update_tag()
    return layout


def add_temp_vectors(mesh: bpy.types.Mesh, name: str, vectors: np.ndarray) -> None:
    """Store vectors, (F, 3), in a temporary attribute on the faces of a mesh."""
    attribute = mesh.attributes.new(name, _VECTOR, "FACE")
    attribute.data.foreach_set("vector", vectors.astype(np.float32).ravel())
    mesh.update_tag()


def read_evaluated_field(
    mesh: bpy.types.Mesh,
    layout: FieldLayout,
    surface: Surface,
    nonfinite: str,
    label: str,
    cache: Cache | None = None,
) -> RosyField:
    """Read the field of an evaluated mesh, whose faces a modifier may have created.

    Modifiers copy the vector of an original face without changing it. `Surface.rest_vertices` gives
    the new face before any deformation, but its plane can still differ from that of the original
    face, for example if the polygon was not planar. If the mesh has the original normals
    (`FACE_NORMAL_ATTRIBUTE`), each vector is transported by the minimal rotation between the two
    normals. Otherwise it is projected to the tangent plane.

    Parameters
    ----------
    mesh : bpy.types.Mesh
        Evaluated.
    layout : FieldLayout
    surface : Surface
        The surface of the mesh.
    nonfinite : {"error", "zero"}
        Raise an error if a vector is not finite, or treat it as undefined.
    label : str
        Name of the mesh in messages.
    cache : Cache, optional
        Keeps fields that have not changed since an earlier call.

    Raises
    ------
    RosyError
        If a value is not finite and the policy is "error".
    """
    source = f"{label}, attribute '{layout.name}'"
    values = _field_values(mesh.attributes[layout.name], source, mesh)
    original_normals = read_attribute(mesh, FACE_NORMAL_ATTRIBUTE, np.float32, 3)
    deviation_pairs = [
        read_attribute(mesh, name, np.float32, 2) for name in layout.attribute_names[1:]
    ]

    def build_field() -> RosyField:
        vectors = _transported_vectors(values, original_normals, surface, source, nonfinite)
        deviations = [pair.astype(np.float64) @ (1, 1j) for pair in deviation_pairs]
        return RosyField(
            layout.degree,
            vectors,
            np.stack(deviations, axis=1) if deviations else None,
            layout.family_count,
        )

    key_parts = values, original_normals, *deviation_pairs, layout, source, nonfinite
    if cache is None or surface.rest_vertices is None:
        return _cached_field(cache, surface, build_field, "carried", *key_parts)
    # The field depends on the rest shape alone. The deformed shape changes from frame to frame.
    rest_shape = surface.rest_vertices, surface.corner_vertex, surface.face_start
    return cache.get_or_create(("carried", content_hash(*rest_shape, *key_parts)), build_field)


def _transported_vectors(
    values: np.ndarray,
    original_normals: np.ndarray | None,
    surface: Surface,
    source: str,
    nonfinite: str,
) -> np.ndarray:
    """Return the vectors, (F, 3) float64, transported from the original to the new normals."""
    vectors = values.astype(np.float64)
    apply_nonfinite_policy(vectors, source, "face", nonfinite)
    normals = tangent_normals(surface, "face")
    if original_normals is not None:
        original_normals = normalize(original_normals.astype(np.float64))
        # A mirrored face has the opposite normal. Only its plane matters.
        original_normals *= np.where(dot(original_normals, normals) < 0, -1.0, 1.0)[:, None]
        vectors = project_to_tangent(vectors, original_normals, 180.0, source, "face")
        vectors = transport(vectors, original_normals, normals)
    return project_to_tangent(vectors, normals, 180.0, source, "face")


def _cached_field(
    cache: Cache | None, surface: Surface, build_field: Callable[[], RosyField], *key_parts: object
) -> RosyField:
    """Return the cached field for a surface and other inputs, or build it."""
    if cache is None:
        return build_field()
    key = "field", id(surface), content_hash(*key_parts)
    # The surface is cached too: while it is alive, no other object can have its id.
    return cache.get_or_create(key, lambda: (surface, build_field()))[1]


#: Forms in which a field can be stored: label and description in the user interface.
STORAGE_FORMS = {
    "VECTOR": ("One Vector", "One direction on each face, from which the others follow"),
    "DIRECTIONS": ("Directions", "All directions, as dir0, dir1 ... on faces"),
    "ANGLE": ("Angle", "The angle from each face's first edge, in radians"),
}


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
    _check_writable(mesh)
    face_count = len(mesh.polygons)
    if len(field.vectors) != face_count:
        raise RosyError(
            f"mesh '{mesh.name}' has {face_count} faces, but the field has {len(field.vectors)}"
        )
    if form == "ANGLE" and field.direction_ratios is not None:
        raise RosyError(
            f"mesh '{mesh.name}': the directions of its field are not a RoSy, so one angle cannot store them"
        )
    if form == "DIRECTIONS" or field.direction_ratios is not None:
        attribute = _write_directions(mesh, field, name)
    elif form == "ANGLE":
        attribute = _get_or_create_attribute(mesh, name, _FLOAT)
        x, y = face_frames(mesh_surface(mesh))
        angle = np.arctan2(dot(field.vectors, y), dot(field.vectors, x))
        angle[~field.vectors.any(axis=1)] = np.nan
        attribute.data.foreach_set("value", angle.astype(np.float32))
    else:
        attribute = _get_or_create_attribute(mesh, name, _VECTOR)
        attribute.data.foreach_set("vector", field.vectors.astype(np.float32).ravel())
    if has_rosy_properties():
        mesh.rosy.degree = field.degree
        if attribute.name == name:
            mesh.rosy.attribute = name
    mesh.update()
    return attribute


def _write_directions(mesh: bpy.types.Mesh, field: RosyField, name: str) -> bpy.types.Attribute:
    """Store all directions of a field as ``dir0`` ... ``dir{N-1}``; remove ``dirN`` and so on."""
    directions = (
        field_directions(mesh_surface(mesh), field)
        if field.source_directions is None
        else field.source_directions
    )
    names = [f"dir{index}" for index in range(field.degree)]
    for direction_name in names:
        _check_attribute_type(mesh, direction_name, _VECTOR)
    vector_attribute = mesh.attributes.get(name)
    if field.direction_ratios is not None and vector_attribute is not None:
        _check_attribute_type(mesh, name, _VECTOR)
        mesh.attributes.remove(vector_attribute)
    extra_index = field.degree
    while f"dir{extra_index}" in mesh.attributes:
        mesh.attributes.remove(mesh.attributes[f"dir{extra_index}"])
        extra_index += 1
    for direction_name, vectors in zip(names, directions.swapaxes(0, 1), strict=True):
        attribute = _get_or_create_attribute(mesh, direction_name, _VECTOR)
        attribute.data.foreach_set("vector", vectors.astype(np.float32).ravel())
    return mesh.attributes["dir0"]


def _check_attribute_type(mesh: bpy.types.Mesh, name: str, data_type: str) -> None:
    """Raise an error if an attribute exists and is not of the given type on faces."""
    attribute = mesh.attributes.get(name)
    if attribute is not None and (attribute.domain, attribute.data_type) != ("FACE", data_type):
        raise RosyError(
            f"mesh '{mesh.name}' already has an attribute '{name}' of another type "
            f"({_describe_type(attribute)}): remove it, or choose another name for the field"
        )


def _get_or_create_attribute(
    mesh: bpy.types.Mesh, name: str, data_type: str
) -> bpy.types.Attribute:
    """Return the attribute of a name and type on faces, and create it if it is missing."""
    _check_attribute_type(mesh, name, data_type)
    attribute = mesh.attributes.get(name)
    if attribute is None:
        attribute = mesh.attributes.new(name, data_type, "FACE")
        if attribute is None or attribute.name != name:
            if attribute is not None:
                mesh.attributes.remove(attribute)
            raise RosyError(
                f"mesh '{mesh.name}': '{name}' cannot be the name of an attribute: choose another one"
            )
    return attribute


def _check_writable(mesh: bpy.types.Mesh) -> None:
    """Raise an error if a mesh is linked from a library or in edit mode."""
    if not is_editable(mesh):
        library = mesh.library.filepath if mesh.library else "its library"
        raise RosyError(f"mesh '{mesh.name}' is linked from {library}: make it local first")
    if mesh.is_editmode:
        raise RosyError(f"mesh '{mesh.name}' is in edit mode: leave edit mode (Tab) first")


def _field_values(attribute: bpy.types.Attribute, source: str, mesh: bpy.types.Mesh) -> np.ndarray:
    """Return the values of a field attribute: (n, 3) vectors or (n,) angles, float32.

    Raises
    ------
    RosyError
        If the type or domain of the attribute is not supported, or the mesh is in edit mode and
        the attribute cannot be read.
    """
    attribute_type = (attribute.domain, attribute.data_type)
    vectors = [(domain, _VECTOR) for domain in ("FACE", "POINT", "CORNER")]
    if attribute_type not in [*vectors, ("FACE", _FLOAT)]:
        raise RosyError(
            f"{source}: expected FLOAT_VECTOR on FACE, POINT or CORNER, or angles as FLOAT on FACE, "
            f"found {_describe_type(attribute)}"
        )
    columns = 3 if attribute.data_type == _VECTOR else 1
    elements = {"FACE": mesh.polygons, "POINT": mesh.vertices, "CORNER": mesh.loops}
    if len(attribute.data) != len(elements[attribute.domain]):
        raise RosyError(f"{source}: cannot be read in edit mode: leave edit mode (Tab) first")
    values = np.empty(len(attribute.data) * columns, dtype=np.float32)
    attribute.data.foreach_get("vector" if columns == 3 else "value", values)
    return values.reshape(-1, 3) if columns == 3 else values


def _describe_type(attribute: bpy.types.Attribute) -> str:
    """Return the type and domain of an attribute, for a message."""
    return f"{attribute.data_type} on {attribute.domain}"


def _attribute_hint(mesh: bpy.types.Mesh) -> str:
    """Return a list of the mesh's vector attributes, for a message; empty if there are none."""
    names = [
        f"'{other.name}'"
        for other in mesh.attributes
        if other.data_type == _VECTOR and other.name not in ("position", "rest_position")
    ]
    return f": choose {' or '.join(names)}" if names else ": make or import a field"


def _field_from_directions(
    mesh: bpy.types.Mesh, surface: Surface, nonfinite: str, label: str, cache: Cache | None
) -> RosyField:
    """Read a field from ``dir0`` ... ``dir{N-1}``. N is the number of these attributes."""
    degree = 0
    while f"dir{degree}" in mesh.attributes:
        degree += 1
    if degree > MAX_DEGREE:
        raise RosyError(
            f"{label}: has {degree} attributes dir0, dir1 ..., but at most {MAX_DEGREE} are supported"
        )
    first_attribute = mesh.attributes["dir0"]
    directions = []
    for index in range(degree):
        attribute = mesh.attributes[f"dir{index}"]
        source = f"{label}, attribute 'dir{index}'"
        attribute_type = (attribute.domain, attribute.data_type)
        if (
            attribute_type not in (("FACE", _VECTOR), ("POINT", _VECTOR))
            or attribute.domain != first_attribute.domain
        ):
            raise RosyError(
                f"{source}: expected FLOAT_VECTOR on FACE or POINT, the same for all directions, "
                f"found {_describe_type(attribute)}"
            )
        directions.append(_field_values(attribute, source, mesh))
    source = f"{label}, attributes dir0 to dir{degree - 1}"
    domain = {"FACE": "face", "POINT": "vertex"}[first_attribute.domain]

    def build_field() -> RosyField:
        return validated_directions(
            surface, np.stack(directions, axis=1), source, nonfinite, domain
        )

    return _cached_field(
        cache, surface, build_field, "directions", *directions, source, nonfinite, domain
    )


def _field_from_angles(
    surface: Surface, angles: np.ndarray, degree: int, source: str, nonfinite: str
) -> RosyField:
    """Return a unit field from angles, (F,), to the first edge of each face, in radians."""
    x, y = face_frames(surface)
    angles = angles.astype(np.float64)
    defined = np.isfinite(angles)
    apply_nonfinite_policy(angles, source, "face", nonfinite)
    vectors = np.cos(angles)[:, None] * x + np.sin(angles)[:, None] * y
    return RosyField(degree, np.where(defined[:, None], vectors, 0.0))


def _field_from_corners(
    surface: Surface, vectors: np.ndarray, degree: int, source: str, nonfinite: str
) -> RosyField:
    """Return a field from vectors on corners: projected to the face, then averaged as RoSys."""
    vectors = vectors.astype(np.float64)
    apply_nonfinite_policy(vectors, source, "corner", nonfinite)
    normal = surface.face_normal
    corner_face_normal = normal[surface.corner_face]
    vectors = project_to_tangent(
        vectors, corner_face_normal, CORNER_TOLERANCE_DEGREES, source, "corner"
    )
    x, y = tangent_frame(normal)
    z = to_representation(vectors, x[surface.corner_face], y[surface.corner_face], degree)
    mean = from_representation(mean_per_face(z, surface.face_start), x, y, degree)
    return RosyField(degree, np.where(normalize(normal).any(axis=1)[:, None], mean, 0.0))


#: Largest angle between a vector on a corner and its face, in degrees. Such vectors may be tangent
#: to the smooth surface rather than to the face.
CORNER_TOLERANCE_DEGREES = 30.0
