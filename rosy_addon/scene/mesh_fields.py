"""Read and store the field of a mesh, in any of the forms that `field_attributes` lists."""

import warnings
from functools import partial

import numpy as np
from bpy.types import Attribute, Mesh

from ..core.cache import Cache, cached
from ..core.errors import RosyError, RosyWarning, counted
from ..core.progress import progress, report
from ..field import validate
from ..field.blocks import as_float64
from ..field.directional_field import stored_directions, with_opposites
from ..field.field_io import HALF_CROSS_NOTE
from ..field.frames import dot, normalize, tangent_frame
from ..field.polygon_arrays import mean_per_face
from ..field.representation import from_representation, to_representation
from ..field.rosy_field import MAX_DEGREE, RosyField, check_degree
from ..field.surface import Surface
from .datablocks import has_rosy_properties, is_editable
from .field_attributes import (
    ANGLE_TYPE,
    DEFAULT_FIELD_NAME,
    VECTOR_TYPE,
    attribute_name,
    check_attribute_type,
    describe_type,
    direction_names,
    ensure_attribute,
    field_degree,
    field_values,
    follow_mesh,
    is_face_vector_field,
    store_attribute,
    store_rest_shape,
)
from .meshes import flush_edit_mode, mesh_surface, read_attribute, write_attribute

#: Names of the elements of a mesh in `field.validate`, by the domain of an attribute.
ELEMENTS = {"FACE": "face", "POINT": "vertex"}


def read_mesh_field(
    mesh: Mesh,
    name: str | None = None,
    degree: int | None = None,
    surface: Surface | None = None,
    *,
    nonfinite: str = "error",
    off_surface: str = "error",
    label: str | None = None,
    cache: Cache | None = None,
) -> RosyField:
    """Read the field of a mesh.

    Parameters
    ----------
    mesh : bpy.types.Mesh
        A mesh of Blender, which may be in edit mode.
    name : str, optional
        Name of the attribute. By default ``mesh.rosy.attribute``.
    degree : int, optional
        By default ``mesh.rosy.degree``.
    surface : Surface, optional
        The surface of the mesh, if it has been read already. Messages have its name.
    nonfinite : {"error", "zero"}
        Raise an error if a value is not finite, or treat it as undefined.
    off_surface : {"error", "project", "undefined"}
        What to do about vectors that are not tangent; see `VectorPolicy`.
    label : str, optional
        Name of the mesh in messages, if there is no surface. By default `mesh_label`.
    cache : Cache, optional
        Keeps surfaces and fields that have not changed since an earlier call.

    Raises
    ------
    RosyError
        If there is no such attribute, its type or domain is not supported, or its values are not tangent to
        the mesh or not finite (see `validated_field`). The message names the mesh and the attribute.

    See Also
    --------
    write_mesh_field : The inverse.
    """
    flush_edit_mode(mesh)
    if surface is None:
        with progress(0.0, 0.5):
            surface = mesh_surface(mesh, label, cache=cache)
    label = surface.name
    field_name = name or attribute_name(mesh)
    degree = check_degree(field_degree(mesh) if degree is None else degree)
    policy = validate.VectorPolicy(nonfinite, off_surface)
    if field_name not in mesh.attributes and "dir0" in mesh.attributes:
        with progress(0.5, 1.0):
            return _field_from_directions(mesh, surface, degree, policy, cache)
    attribute = mesh.attributes.get(field_name)
    if attribute is None:
        raise RosyError(
            f"{label} has no attribute '{field_name}' with a vector on faces{_attribute_hint(mesh)}"
        )
    source = f"{label}, attribute '{field_name}'"
    values = field_values(attribute, source, mesh)
    if is_face_vector_field(mesh, field_name):
        values = follow_mesh(mesh, field_name, values, surface)
    domain, data_type = attribute.domain, attribute.data_type

    def build() -> RosyField:
        if data_type == ANGLE_TYPE:
            return _field_from_angles(surface, values, degree, source, nonfinite)
        if domain == "CORNER":
            return _field_from_corners(surface, values, degree, source, policy)
        return validate.validated_field(surface, values, degree, source, policy, ELEMENTS[domain])

    key_parts = "attribute", domain, data_type, values, degree, source, *policy
    with progress(0.5, 1.0, "reading the field"):
        return cached(cache, build, surface, *key_parts)


def _field_from_directions(
    mesh: Mesh, surface: Surface, degree: int, policy: validate.VectorPolicy, cache: Cache | None
) -> RosyField:
    """Read a field from the attributes ``dir0`` ... ``dir{N-1}``. Their number N is the degree.

    Two attributes are the lines of a cross if their directions are nowhere opposite and `degree`, the
    expected degree, is not 2. A `RosyWarning` says so. `policy` says what to do about invalid vectors.
    """
    label, count = surface.name, len(direction_names(mesh))
    if count > MAX_DEGREE:
        raise RosyError(
            f"{label}: has {count} attributes dir0, dir1 ..., but at most {MAX_DEGREE} are supported"
        )
    domain = mesh.attributes["dir0"].domain
    directions = []
    for index in range(count):
        attribute = mesh.attributes[f"dir{index}"]
        source = f"{label}, attribute 'dir{index}'"
        attribute_type = (attribute.domain, attribute.data_type)
        if attribute_type != (domain, VECTOR_TYPE) or domain not in ELEMENTS:
            raise RosyError(
                f"{source}: expected FLOAT_VECTOR on FACE or POINT, the same for all directions, "
                f"found {describe_type(attribute)}"
            )
        directions.append(field_values(attribute, source, mesh))
    directions = np.stack(directions, axis=1)
    if domain == "FACE":
        directions = follow_mesh(mesh, "dir0", directions, surface)
    source = f"{label}, attributes dir0 to dir{count - 1}"
    directions = with_opposites(directions, 2 if degree == 2 else None)
    if directions.shape[1] > count:
        warnings.warn(f"{source}: {HALF_CROSS_NOTE}", RosyWarning, stacklevel=3)
    element = ELEMENTS[domain]
    build = partial(validate.validated_directions, surface, directions, source, policy, element)
    with progress(0.0, 1.0, "reading the field"):
        return cached(cache, build, surface, "directions", directions, source, *policy, element)


def _field_from_angles(
    surface: Surface, angles: np.ndarray, degree: int, source: str, nonfinite: str
) -> RosyField:
    """Return a field from the (F,) angles of its members in radians, counterclockwise from the first edges.

    `source` is the name of the attribute in messages. `nonfinite` is "error" or "zero": angles that are not
    finite raise an error, or the field is undefined there.
    """
    x, y = surface.face_frames
    report(0.5, "reading the field")
    angles = as_float64(angles)
    defined = np.isfinite(angles)
    validate.apply_nonfinite_policy(angles, source, "face", nonfinite)
    vectors = np.cos(angles)[:, None] * x + np.sin(angles)[:, None] * y
    return RosyField(degree, np.where(defined[:, None], vectors, 0.0))


def _field_from_corners(
    surface: Surface, vectors: np.ndarray, degree: int, source: str, policy: validate.VectorPolicy
) -> RosyField:
    """Return a field from (C, 3) vectors on face corners, averaged over each face.

    The vectors are projected to the face. Their representations z are averaged, so that different members at
    the corners of a face do not cancel out. `source` is the name of the attribute in messages. `policy` says
    what to do about invalid vectors.
    """
    vectors = as_float64(vectors)
    validate.apply_nonfinite_policy(vectors, source, "corner", policy.nonfinite)
    normal = surface.face_normal
    corner_normal = normal[surface.corner_face]
    report(0.2, "reading the field")
    with progress(0.2, 0.7):
        vectors = validate.project_to_tangent(
            vectors, corner_normal, source, "corner", policy.off_surface
        )
    x, y = tangent_frame(normal)
    z = to_representation(vectors, x[surface.corner_face], y[surface.corner_face], degree)
    report(0.9, "reading the field")
    mean = from_representation(mean_per_face(z, surface.face_start), x, y, degree)
    return RosyField(degree, np.where(normalize(normal).any(axis=1)[:, None], mean, 0.0))


def vector_names(mesh: Mesh) -> list[str]:
    """Return the names of the vector attributes of a mesh, except positions and hidden attributes."""
    names = [each.name for each in mesh.attributes if each.data_type == VECTOR_TYPE]
    positions = ("position", "rest_position")
    return [name for name in names if name not in positions and not name.startswith(".")]


def _attribute_hint(mesh: Mesh) -> str:
    """Return advice for a message: choose one of the mesh's vector attributes; if there is none, make a field."""
    names = [f"'{name}'" for name in vector_names(mesh)]
    return f": choose {' or '.join(names)}" if names else ": make or import a field"


#: Default name of the attribute in which a field is stored as angles.
DEFAULT_ANGLE_NAME = "rosy_angle"

#: Forms in which a field can be stored, with their labels and descriptions in the user interface.
STORAGE_FORMS = {
    "VECTOR": ("One Vector", "One direction on each face, from which the others follow"),
    "DIRECTIONS": ("Directions", "All directions, as dir0, dir1 ... on faces"),
    "ANGLE": ("Angle", "The angle from each face's first edge, in radians"),
}


def assign_fields(fields: dict[Mesh, RosyField], name: str = "", form: str = "VECTOR") -> None:
    """Store fields on meshes: on all of them, or on none if one field cannot be stored.

    Parameters
    ----------
    fields : dict of bpy.types.Mesh to RosyField
    name : str, optional
        Name of the attribute. By default the existing field of each mesh is replaced; for "ANGLE",
        the name is `DEFAULT_ANGLE_NAME`.
    form : {"VECTOR", "DIRECTIONS", "ANGLE"}
        Attributes in which a field is stored; see `write_mesh_field`.

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


def _default_name(mesh: Mesh, form: str) -> str:
    """Return the default name of the attribute that stores a field, given how it is stored: "VECTOR" or "ANGLE"."""
    if form == "ANGLE":
        return DEFAULT_ANGLE_NAME
    name = attribute_name(mesh)
    is_other_form = form == "VECTOR" and name in mesh.attributes
    return DEFAULT_FIELD_NAME if is_other_form and not is_face_vector_field(mesh, name) else name


def write_mesh_field(
    mesh: Mesh, field: RosyField, name: str = DEFAULT_FIELD_NAME, form: str = "VECTOR"
) -> None:
    """Store a field on a mesh. An existing field in an attribute with the same name is replaced.

    Parameters
    ----------
    mesh : bpy.types.Mesh
    field : RosyField
    name : str
        Name of the attribute. The attributes of the form "DIRECTIONS" are always ``dir0`` ... ``dir{N-1}``.
    form : {"VECTOR", "DIRECTIONS", "ANGLE"}
        One member per face as a vector, all N directions of each face as vectors, or the angle of a member
        from the first edge of each face. A field with free directions (not at equal angles) is always stored
        as "DIRECTIONS". A vector attribute with the name `name` is removed then, because it would be read
        instead of the directions. If a RoSy field is stored as "DIRECTIONS", such an attribute is kept.

    Raises
    ------
    RosyError
        If the mesh is linked from a library or in edit mode, the field has another number of faces, an
        attribute with the name has another type or domain, or the field has free directions and the form is
        "ANGLE". Nothing is changed in this case.

    See Also
    --------
    read_mesh_field : The inverse.
    """
    assign_fields({mesh: field}, name or DEFAULT_FIELD_NAME, form)


def _store(mesh: Mesh, field: RosyField, name: str, form: str) -> None:
    """Store a field that `_check_storable` has checked."""
    if form == "DIRECTIONS" or field.direction_ratios is not None:
        attribute = _write_directions(mesh, field, name)
    elif form == "ANGLE":
        x, y = mesh_surface(mesh).face_frames
        angle = np.arctan2(dot(field.vectors, y), dot(field.vectors, x))
        angle[~field.vectors.any(axis=1)] = np.nan
        attribute = store_attribute(mesh, name, ANGLE_TYPE, angle)
    else:
        attribute = store_attribute(mesh, name, VECTOR_TYPE, field.vectors)
    stored_name = attribute.name
    if attribute.data_type == VECTOR_TYPE:
        store_rest_shape(mesh, stored_name)
    if has_rosy_properties():
        mesh.rosy.degree = field.degree
        if stored_name == name:
            mesh.rosy.attribute = name
    mesh.update()


def overwrite_vectors(mesh: Mesh, vectors: np.ndarray) -> np.ndarray:
    """Replace the vectors of a field that is stored as one vector on each face, without any check.

    It is meant for a preview during an edit. `write_mesh_field` stores the final field.

    Parameters
    ----------
    mesh : bpy.types.Mesh
    vectors : (F, 3) ndarray

    Returns
    -------
    (F, 3) float32 ndarray
        The vectors that were stored before.
    """
    name = attribute_name(mesh)
    before = read_attribute(mesh, name, np.float32, 3)
    write_attribute(mesh.attributes[name], vectors)
    mesh.update()
    return before


def _check_storable(mesh: Mesh, field: RosyField, name: str, form: str) -> None:
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
    names, data_type = [name], ANGLE_TYPE if form == "ANGLE" else VECTOR_TYPE
    if form == "DIRECTIONS" or has_free_directions:
        names = [f"dir{index}" for index in range(field.degree)]
    for new_name in names:
        is_new = new_name not in mesh.attributes
        attribute = ensure_attribute(mesh, new_name, data_type)
        if is_new:
            mesh.attributes.remove(attribute)


def _write_directions(mesh: Mesh, field: RosyField, name: str) -> Attribute:
    """Store the N directions of a field as ``dir0`` ... ``dir{N-1}``, and return ``dir0``.

    Remove the attributes ``dirN``, ``dir{N+1}`` ... of an earlier field. If the directions of the field are
    not at equal angles, remove also the attribute `name`, which would be read instead.
    """
    directions = stored_directions(mesh_surface(mesh), field)
    vector_attribute = mesh.attributes.get(name)
    if field.direction_ratios is not None and vector_attribute is not None:
        mesh.attributes.remove(vector_attribute)
    extra_index = field.degree
    while f"dir{extra_index}" in mesh.attributes:
        mesh.attributes.remove(mesh.attributes[f"dir{extra_index}"])
        extra_index += 1
    for index in range(field.degree):
        store_attribute(mesh, f"dir{index}", VECTOR_TYPE, directions[:, index])
    return mesh.attributes["dir0"]


def check_writable(mesh: Mesh) -> None:
    """Raise an error if a mesh is linked from a library or in edit mode."""
    if not is_editable(mesh):
        library = mesh.library.filepath if mesh.library else "its library"
        raise RosyError(f"mesh '{mesh.name}' is linked from {library}: make it local first")
    if mesh.is_editmode:
        raise RosyError(f"mesh '{mesh.name}' is in edit mode: leave edit mode (Tab) first")
