"""Fields as attributes of meshes.

The convention: a vector attribute (FLOAT_VECTOR) on faces, one member in object space each, its
length the magnitude and zero where the field is undefined. Name and degree are in ``mesh.rosy``.
Also read are

- such vectors on points, averaged onto the faces, and on corners, likewise;
- ``dir0`` ... ``dir{N-1}``, the N directions of each face or point, a RoSy or not;
- a float on faces: the angle of a member from the face's first edge, counter-clockwise about its
  normal, in radians; the magnitude is 1, and NaN is undefined where that is asked for.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import bpy
import numpy as np

from ..errors import RosyError
from ..field.check import (
    checked_directions,
    checked_field,
    into_planes,
    settle_undefined,
    tangent_normals,
)
from ..field.directions import directions_of
from ..field.frames import carry, dot, tangent_frame, unit
from ..field.representation import face_frames, from_representation, to_representation
from ..field.rosy_field import MAX_DEGREE, RosyField, check_degree
from ..field.surface import Surface, mean_over_faces
from ..reuse import Kept, digest
from .capabilities import has_properties, is_editable
from .meshes import flush_edit_mode, mesh_surface, read_values

DEFAULT_NAME = "rosy"
DEFAULT_DEGREE = 4

#: Normals of the faces that vectors were given on, carried through modifiers while a scene is read.
FACE_NORMAL = "rosy_face_normal"

_VECTOR, _FLOAT = "FLOAT_VECTOR", "FLOAT"


def attribute_name(mesh: bpy.types.Mesh) -> str:
    """What the mesh's field is called."""
    return (mesh.rosy.attribute if has_properties() else "") or DEFAULT_NAME


def field_degree(mesh: bpy.types.Mesh) -> int:
    """The degree of the mesh's field."""
    return mesh.rosy.degree if has_properties() else DEFAULT_DEGREE


def has_field(thing: bpy.types.Object) -> bool:
    """Whether an object is a mesh with a field on it, good or not."""
    if thing.type != "MESH" or thing.data is None:
        return False
    attributes = thing.data.attributes
    return attribute_name(thing.data) in attributes or "dir0" in attributes


def is_native(mesh: bpy.types.Mesh, name: str | None = None) -> bool:
    """Whether the field is stored by the convention proper: vectors on faces."""
    attribute = mesh.attributes.get(name or attribute_name(mesh))
    return attribute is not None and (attribute.domain, attribute.data_type) == ("FACE", _VECTOR)


def read_mesh_field(
    mesh: bpy.types.Mesh,
    name: str | None = None,
    degree: int | None = None,
    surface: Surface | None = None,
    *,
    undefined: str = "error",
    owner: str | None = None,
    kept: Kept | None = None,
) -> RosyField:
    """The field of a mesh.

    Parameters
    ----------
    mesh : bpy.types.Mesh
        May be in edit mode.
    name : str, optional
        Of the attribute; ``mesh.rosy.attribute`` if not given.
    degree : int, optional
        ``mesh.rosy.degree`` if not given.
    surface : Surface, optional
        Of the mesh, if it is at hand.
    undefined : {"error", "zero"}
        What to do about NaN and infinite values: refuse them, or call them undefined.
    owner : str, optional
        What to call the mesh in messages.
    kept : Kept, optional
        Where surface and field are found if they have not changed.

    Raises
    ------
    RosyError
        If there is no such attribute, it is of another type or on another domain, or its values
        are not a field on the mesh (see `checked_field`). The message names mesh and attribute.
    """
    owner = f"mesh '{mesh.name}'" if owner is None else owner
    flush_edit_mode(mesh)
    surface = mesh_surface(mesh, owner, kept=kept) if surface is None else surface
    wanted = name or attribute_name(mesh)
    degree = check_degree(field_degree(mesh) if degree is None else degree)
    if wanted not in mesh.attributes and "dir0" in mesh.attributes:
        return _read_directions(mesh, surface, undefined, owner, kept)
    attribute = mesh.attributes.get(wanted)
    if attribute is None:
        raise RosyError(
            f"{owner} has no attribute '{wanted}'; a vector on faces is wanted{_others(mesh)}"
        )
    source = f"{owner}, attribute '{wanted}'"
    values = _values(attribute, source, mesh)

    def make() -> RosyField:
        if attribute.data_type == _FLOAT:
            return _from_angles(surface, values, degree, source, undefined)
        if attribute.domain == "CORNER":
            return _from_corners(surface, values, degree, source, undefined)
        domain = {"FACE": "face", "POINT": "vertex"}[attribute.domain]
        return checked_field(surface, values, degree, source, undefined, domain)

    kind = attribute.domain, attribute.data_type
    return _found_or_made(kept, surface, make, "given", *kind, values, degree, source, undefined)


def read_vectors(mesh: bpy.types.Mesh, name: str) -> np.ndarray:
    """(F, 3) float64: a vector attribute on faces, points or corners as a vector on each face.

    Those of points and corners are added up; they need not be tangent to the surface.

    Raises
    ------
    RosyError
        If the attribute is of another type, or its values are not finite.
    """
    source = f"mesh '{mesh.name}', attribute '{name}'"
    attribute = mesh.attributes[name]
    values = _values(attribute, source, mesh).astype(np.float64)
    if values.ndim == 1:
        raise RosyError(f"{source}: found {_kind(attribute)}; a vector is wanted")
    settle_undefined(values, source, attribute.domain.lower(), "error")
    if attribute.domain == "FACE":
        return values
    surface = mesh_surface(mesh)
    if attribute.domain == "POINT":
        values = values[surface.corner_vertex]
    return mean_over_faces(values, surface.face_start)


def read_scalars(mesh: bpy.types.Mesh, name: str) -> np.ndarray:
    """(F,) float64: a number for each face, of an attribute or a vertex group.

    Of a float, a whole number, a boolean or a colour (its brightness), on faces, points or corners.

    Raises
    ------
    RosyError
        If there is neither, or it holds anything else.
    """
    surface = mesh_surface(mesh)
    source = f"mesh '{mesh.name}', '{name}'"
    attribute = mesh.attributes.get(name)
    if attribute is not None:
        domain, values = attribute.domain, attribute_numbers(attribute, source)
    else:
        owner = next(
            (o for o in bpy.data.objects if o.data == mesh and name in o.vertex_groups), None
        )
        if owner is None:
            raise RosyError(f"{source}: is neither an attribute nor a vertex group")
        group = owner.vertex_groups[name].index
        domain, values = "POINT", np.zeros(len(mesh.vertices))
        for vertex in mesh.vertices:
            for entry in vertex.groups:
                if entry.group == group:
                    values[vertex.index] = entry.weight
    if not np.isfinite(values).all():
        raise RosyError(f"{source}: has values that are not finite")
    if domain == "FACE":
        return values
    if domain == "POINT":
        values = values[surface.corner_vertex]
    return mean_over_faces(values, surface.face_start)


def attribute_numbers(attribute: bpy.types.Attribute, source: str) -> np.ndarray:
    """(n,) float64: a number for each element of an attribute's domain; of a colour its luminance.

    Raises
    ------
    RosyError
        If it is not on faces, points or corners, or holds anything else.
    """
    count, kind = len(attribute.data), attribute.data_type
    if attribute.domain not in ("FACE", "POINT", "CORNER"):
        raise RosyError(f"{source}: found {_kind(attribute)}; wanted on FACE, POINT or CORNER")
    if kind in ("FLOAT_COLOR", "BYTE_COLOR"):
        values = np.empty(4 * count, dtype=np.float32)
        attribute.data.foreach_get("color", values)
        return values.reshape(-1, 4)[:, :3] @ (0.2126, 0.7152, 0.0722)
    kinds = {"FLOAT": np.float32, "INT": np.int32, "INT8": np.int32, "BOOLEAN": bool}
    if kind not in kinds:
        raise RosyError(f"{source}: found {_kind(attribute)}; a number or a colour is wanted")
    values = np.empty(count, dtype=kinds[kind])
    attribute.data.foreach_get("value", values)
    return values.astype(np.float64)


@dataclass(frozen=True)
class Stored:
    """How a field is found in an evaluated mesh: vectors on faces, and what there is besides.

    Attributes
    ----------
    name : str
        Of the attribute of the members; that of the deviation k is ``name_k``, if there are any.
    degree : int
    deviating : bool
    families : int
        See `RosyField`.
    """

    name: str
    degree: int
    deviating: bool = False
    families: int = 1

    @property
    def names(self) -> list[str]:
        """Of all attributes."""
        more = range(self.degree if self.deviating else 0)
        return [self.name, *(f"{self.name}_{number}" for number in more)]


def lend_field(mesh: bpy.types.Mesh, field: RosyField, name: str) -> Stored:
    """Store a field on the faces of a mesh for as long as it is read."""
    stored = Stored(name, field.degree, field.deviations is not None, field.families)
    lend_vectors(mesh, name, field.vectors)
    for number, other in enumerate(stored.names[1:]):
        deviation = field.deviations[:, number]
        attribute = mesh.attributes.new(other, "FLOAT2", "FACE")
        pairs = np.stack([deviation.real, deviation.imag], axis=1).astype(np.float32)
        attribute.data.foreach_set("vector", pairs.ravel())
    mesh.update_tag()
    return stored


def lend_vectors(mesh: bpy.types.Mesh, name: str, vectors: np.ndarray) -> None:
    """Store vectors on the faces of a mesh for as long as it is read."""
    attribute = mesh.attributes.new(name, _VECTOR, "FACE")
    attribute.data.foreach_set("vector", vectors.astype(np.float32).ravel())
    mesh.update_tag()


def read_carried_field(
    mesh: bpy.types.Mesh,
    stored: Stored,
    surface: Surface,
    undefined: str,
    owner: str,
    kept: Kept | None = None,
) -> RosyField:
    """The field of an evaluated mesh, whose faces a modifier may have made anew.

    A face's vector came unchanged from the face it was given on, and `Surface.rest` knows the face
    from before any deformation, still not in quite the same plane where polygons are warped. The
    minimal rotation between the two normals turns the vector there, if the mesh carries the former
    ones as `FACE_NORMAL`; it is projected if not.

    Raises
    ------
    RosyError
        If values are not finite.
    """
    source = f"{owner}, attribute '{stored.name}'"
    values = _values(mesh.attributes[stored.name], source, mesh)
    former = read_values(mesh, FACE_NORMAL, np.float32, 3)
    pairs = [read_values(mesh, name, np.float32, 2) for name in stored.names[1:]]

    def make() -> RosyField:
        vectors = _carried(values, former, surface, source, undefined)
        deviations = [pair.astype(np.float64) @ (1, 1j) for pair in pairs]
        return RosyField(
            stored.degree,
            vectors,
            np.stack(deviations, axis=1) if deviations else None,
            stored.families,
        )

    given = values, former, *pairs, stored, source, undefined
    if kept is None or surface.rest is None:
        return _found_or_made(kept, surface, make, "carried", *given)
    # The shape at rest is all that counts: that of now is another from frame to frame.
    shape = surface.rest, surface.corner_vertex, surface.face_start
    return kept.find_or_make(("carried", digest(*shape, *given)), make)


def _carried(
    values: np.ndarray, former: np.ndarray | None, surface: Surface, source: str, undefined: str
) -> np.ndarray:
    vectors = values.astype(np.float64)
    settle_undefined(vectors, source, "face", undefined)
    normal = tangent_normals(surface, "face")
    if former is not None:
        former = unit(former.astype(np.float64))
        # A mirrored face has turned over: its plane is what matters.
        former *= np.where(dot(former, normal) < 0, -1.0, 1.0)[:, None]
        vectors = into_planes(vectors, former, 180.0, source, "face")
        vectors = carry(vectors, former, normal)
    return into_planes(vectors, normal, 180.0, source, "face")


def _found_or_made(
    kept: Kept | None, surface: Surface, make: Callable[[], RosyField], *given: object
) -> RosyField:
    """The field made of a surface and what else is given, or that made of the same before."""
    if kept is None:
        return make()
    key = "field", id(surface), digest(*given)
    # With the surface, so that this number stays its own.
    return kept.find_or_make(key, lambda: (surface, make()))[1]


#: The forms in which a field can be stored, in the words a user meets.
FORMS = {
    "VECTOR": ("One Vector", "One direction on each face, the others follow from it"),
    "DIRECTIONS": ("Directions", "All directions, as dir0, dir1 ... on faces"),
    "ANGLE": ("Angle", "The angle from each face's first edge, in radians"),
}


def write_mesh_field(
    mesh: bpy.types.Mesh, field: RosyField, name: str = DEFAULT_NAME, form: str = "VECTOR"
) -> bpy.types.Attribute:
    """Store a field on a mesh, in place of one of the same name.

    Parameters
    ----------
    mesh : bpy.types.Mesh
    field : RosyField
    name : str
    form : {"VECTOR", "DIRECTIONS", "ANGLE"}
        A field of free directions is always stored as these: ``dir0`` ... ``dir{N-1}``. Of a RoSy
        stored so, vectors of that name stay; of other directions they go, or they would be read.

    Returns
    -------
    bpy.types.Attribute
        The (first) attribute.

    Raises
    ------
    RosyError
        If the mesh is linked from a library or in edit mode, has another number of faces, a name
        belongs to an attribute of another kind, or the field has no such form. Nothing is changed
        then.
    """
    name = name or DEFAULT_NAME
    _check_writable(mesh)
    faces = len(mesh.polygons)
    if len(field.vectors) != faces:
        raise RosyError(
            f"mesh '{mesh.name}' has {faces} faces, but the field has {len(field.vectors)}"
        )
    if form == "ANGLE" and field.deviations is not None:
        raise RosyError(f"mesh '{mesh.name}': the directions of its field are no RoSy of one angle")
    if form == "DIRECTIONS" or field.deviations is not None:
        attribute = _write_directions(mesh, field, name)
    elif form == "ANGLE":
        attribute = _attribute_for(mesh, name, _FLOAT)
        x, y = face_frames(mesh_surface(mesh))
        angle = np.arctan2(dot(field.vectors, y), dot(field.vectors, x))
        angle[~field.vectors.any(axis=1)] = np.nan
        attribute.data.foreach_set("value", angle.astype(np.float32))
    else:
        attribute = _attribute_for(mesh, name, _VECTOR)
        attribute.data.foreach_set("vector", field.vectors.astype(np.float32).ravel())
    if has_properties():
        mesh.rosy.degree = field.degree
        if attribute.name == name:
            mesh.rosy.attribute = name
    mesh.update()
    return attribute


def _write_directions(mesh: bpy.types.Mesh, field: RosyField, name: str) -> bpy.types.Attribute:
    directions = directions_of(mesh_surface(mesh), field) if field.given is None else field.given
    names = [f"dir{number}" for number in range(field.degree)]
    for each in names:
        _check_kind(mesh, each, _VECTOR)
    native = mesh.attributes.get(name)
    if field.deviations is not None and native is not None:
        _check_kind(mesh, name, _VECTOR)
        mesh.attributes.remove(native)
    number = field.degree
    while f"dir{number}" in mesh.attributes:
        mesh.attributes.remove(mesh.attributes[f"dir{number}"])
        number += 1
    for each, vectors in zip(names, directions.swapaxes(0, 1), strict=True):
        attribute = _attribute_for(mesh, each, _VECTOR)
        attribute.data.foreach_set("vector", vectors.astype(np.float32).ravel())
    return mesh.attributes["dir0"]


def _check_kind(mesh: bpy.types.Mesh, name: str, kind: str) -> None:
    attribute = mesh.attributes.get(name)
    if attribute is not None and (attribute.domain, attribute.data_type) != ("FACE", kind):
        raise RosyError(
            f"mesh '{mesh.name}' has an attribute '{name}' of another kind, {_kind(attribute)}; "
            "remove it, or give the field another name"
        )


def _attribute_for(mesh: bpy.types.Mesh, name: str, kind: str) -> bpy.types.Attribute:
    """The attribute of a name and kind on faces, a new one if there is none."""
    _check_kind(mesh, name, kind)
    attribute = mesh.attributes.get(name)
    if attribute is None:
        attribute = mesh.attributes.new(name, kind, "FACE")
        if attribute is None or attribute.name != name:
            if attribute is not None:
                mesh.attributes.remove(attribute)
            raise RosyError(f"mesh '{mesh.name}': an attribute cannot be named '{name}'")
    return attribute


def _check_writable(mesh: bpy.types.Mesh) -> None:
    if not is_editable(mesh):
        library = mesh.library.filepath if mesh.library else "its library"
        raise RosyError(
            f"mesh '{mesh.name}' is linked from {library}: make it local to give it a field"
        )
    if mesh.is_editmode:
        raise RosyError(f"mesh '{mesh.name}' is in edit mode: leave it (Tab) to give it a field")


def _values(attribute: bpy.types.Attribute, source: str, mesh: bpy.types.Mesh) -> np.ndarray:
    """(n, 3) vectors or (n,) angles, float32.

    Raises
    ------
    RosyError
        If the attribute is of another type, or where a field cannot be.
    """
    kind = (attribute.domain, attribute.data_type)
    vectors = [(domain, _VECTOR) for domain in ("FACE", "POINT", "CORNER")]
    if kind not in [*vectors, ("FACE", _FLOAT)]:
        raise RosyError(
            f"{source}: found {_kind(attribute)}; wanted FLOAT_VECTOR on FACE (or POINT or "
            "CORNER), or angles as FLOAT on FACE"
        )
    columns = 3 if attribute.data_type == _VECTOR else 1
    size = {"FACE": mesh.polygons, "POINT": mesh.vertices, "CORNER": mesh.loops}
    if len(attribute.data) != len(size[attribute.domain]):
        raise RosyError(f"{source}: cannot be read in edit mode: leave it (Tab) first")
    values = np.empty(len(attribute.data) * columns, dtype=np.float32)
    attribute.data.foreach_get("vector" if columns == 3 else "value", values)
    return values.reshape(-1, 3) if columns == 3 else values


def _kind(attribute: bpy.types.Attribute) -> str:
    return f"{attribute.data_type} on {attribute.domain}"


def _others(mesh: bpy.types.Mesh) -> str:
    """Attributes that could be meant, for a message."""
    names = [
        f"'{other.name}'"
        for other in mesh.attributes
        if other.data_type == _VECTOR and other.name not in ("position", "rest_position")
    ]
    return f"; there are {', '.join(names)}" if names else ""


def _read_directions(
    mesh: bpy.types.Mesh, surface: Surface, undefined: str, owner: str, kept: Kept | None
) -> RosyField:
    """From ``dir0`` ... ``dir{N-1}``; N is how many there are."""
    degree = 0
    while f"dir{degree}" in mesh.attributes:
        degree += 1
    if degree > MAX_DEGREE:
        raise RosyError(f"{owner}: has {degree} attributes dir0 ..., at most {MAX_DEGREE} are read")
    first = mesh.attributes["dir0"]
    directions = []
    for number in range(degree):
        attribute = mesh.attributes[f"dir{number}"]
        source = f"{owner}, attribute 'dir{number}'"
        kind = (attribute.domain, attribute.data_type)
        if kind not in (("FACE", _VECTOR), ("POINT", _VECTOR)) or attribute.domain != first.domain:
            raise RosyError(
                f"{source}: found {_kind(attribute)}; wanted FLOAT_VECTOR on FACE or POINT, the "
                "same for all members"
            )
        directions.append(_values(attribute, source, mesh))
    source = f"{owner}, attributes dir0 to dir{degree - 1}"
    domain = {"FACE": "face", "POINT": "vertex"}[first.domain]

    def make() -> RosyField:
        return checked_directions(surface, np.stack(directions, axis=1), source, undefined, domain)

    return _found_or_made(kept, surface, make, "directions", *directions, source, undefined, domain)


def _from_angles(
    surface: Surface, angles: np.ndarray, degree: int, source: str, undefined: str
) -> RosyField:
    x, y = face_frames(surface)
    angles = angles.astype(np.float64)
    defined = np.isfinite(angles)
    settle_undefined(angles, source, "face", undefined)
    vectors = np.cos(angles)[:, None] * x + np.sin(angles)[:, None] * y
    return RosyField(degree, np.where(defined[:, None], vectors, 0.0))


def _from_corners(
    surface: Surface, vectors: np.ndarray, degree: int, source: str, undefined: str
) -> RosyField:
    """Turned into the face's plane at each corner, then averaged as RoSys."""
    vectors = vectors.astype(np.float64)
    settle_undefined(vectors, source, "corner", undefined)
    normal = surface.face_normal
    of_corner = normal[surface.corner_face]
    vectors = into_planes(vectors, of_corner, CORNER_TOLERANCE, source, "corner")
    x, y = tangent_frame(normal)
    z = to_representation(vectors, x[surface.corner_face], y[surface.corner_face], degree)
    mean = from_representation(mean_over_faces(z, surface.face_start), x, y, degree)
    return RosyField(degree, np.where(unit(normal).any(axis=1)[:, None], mean, 0.0))


#: Vectors on corners may be tangent to a smooth surface there rather than to the face: degrees.
CORNER_TOLERANCE = 30.0
