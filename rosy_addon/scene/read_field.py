"""Reading the field of a mesh, in any of the forms that `field_attributes` lists."""

from __future__ import annotations

import bpy
import numpy as np

from ..core.cache import Cache
from ..core.errors import RosyError
from ..core.progress import progress, report
from ..field.blocks import as_float64
from ..field.frames import normalize, tangent_frame
from ..field.polygon_arrays import mean_per_face
from ..field.representation import face_frames, from_representation, to_representation
from ..field.rosy_field import MAX_DEGREE, RosyField, check_degree
from ..field.surface import Surface
from ..field.validate import (
    apply_nonfinite_policy,
    project_to_tangent,
    validated_directions,
    validated_field,
)
from .field_attributes import (
    ANGLE_TYPE,
    VECTOR_TYPE,
    attribute_name,
    cached_field,
    describe_type,
    field_degree,
    field_values,
    is_face_vector_field,
)
from .meshes import flush_edit_mode, mesh_label, mesh_surface
from .rest_shape import follow_mesh, read_rest_shape

#: Largest angle between a vector on a corner and its face, in degrees. Such vectors may be tangent
#: to the smooth surface rather than to the face.
CORNER_TOLERANCE_DEGREES = 30.0


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
        Name in messages. By default `mesh_label`.
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
    label = mesh_label(mesh) if label is None else label
    flush_edit_mode(mesh)
    if surface is None:
        with progress(0.0, 0.5):
            surface = mesh_surface(mesh, label, cache=cache)
    field_name = name or attribute_name(mesh)
    degree = check_degree(field_degree(mesh) if degree is None else degree)
    if field_name not in mesh.attributes and "dir0" in mesh.attributes:
        with progress(0.5, 1.0):
            return _field_from_directions(mesh, surface, nonfinite, label, cache)
    attribute = mesh.attributes.get(field_name)
    if attribute is None:
        raise RosyError(
            f"{label} has no attribute '{field_name}' with a vector on faces{_attribute_hint(mesh)}"
        )
    source = f"{label}, attribute '{field_name}'"
    values = field_values(attribute, source, mesh)
    if is_face_vector_field(mesh, field_name):
        values = follow_mesh(read_rest_shape(mesh, field_name), values, surface)

    attribute_type = domain, data_type = attribute.domain, attribute.data_type

    def build() -> RosyField:
        if data_type == ANGLE_TYPE:
            return _field_from_angles(surface, values, degree, source, nonfinite)
        if domain == "CORNER":
            return _field_from_corners(surface, values, degree, source, nonfinite)
        element = {"FACE": "face", "POINT": "vertex"}[domain]
        return validated_field(surface, values, degree, source, nonfinite, element)

    with progress(0.5, 1.0, "reading the field"):
        return cached_field(
            cache, surface, build, "attribute", *attribute_type, values, degree, source, nonfinite
        )


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
            attribute_type not in (("FACE", VECTOR_TYPE), ("POINT", VECTOR_TYPE))
            or attribute.domain != first_attribute.domain
        ):
            raise RosyError(
                f"{source}: expected FLOAT_VECTOR on FACE or POINT, the same for all directions, "
                f"found {describe_type(attribute)}"
            )
        directions.append(field_values(attribute, source, mesh))
    directions = np.stack(directions, axis=1)
    if first_attribute.domain == "FACE":
        directions = follow_mesh(read_rest_shape(mesh, "dir0"), directions, surface)
    source = f"{label}, attributes dir0 to dir{degree - 1}"
    domain = {"FACE": "face", "POINT": "vertex"}[first_attribute.domain]

    def build() -> RosyField:
        return validated_directions(surface, directions, source, nonfinite, domain)

    with progress(0.0, 1.0, "reading the field"):
        return cached_field(
            cache, surface, build, "directions", directions, source, nonfinite, domain
        )


def _field_from_angles(
    surface: Surface, angles: np.ndarray, degree: int, source: str, nonfinite: str
) -> RosyField:
    """Return a unit field from angles, (F,), to the first edge of each face, in radians."""
    x, y = face_frames(surface)
    report(0.5, "reading the field")
    angles = as_float64(angles)
    defined = np.isfinite(angles)
    apply_nonfinite_policy(angles, source, "face", nonfinite)
    vectors = np.cos(angles)[:, None] * x + np.sin(angles)[:, None] * y
    return RosyField(degree, np.where(defined[:, None], vectors, 0.0))


def _field_from_corners(
    surface: Surface, vectors: np.ndarray, degree: int, source: str, nonfinite: str
) -> RosyField:
    """Return a field from vectors on corners: projected to the face, then averaged as RoSys."""
    vectors = as_float64(vectors)
    apply_nonfinite_policy(vectors, source, "corner", nonfinite)
    normal = surface.face_normal
    corner_face_normal = normal[surface.corner_face]
    report(0.2, "reading the field")
    with progress(0.2, 0.7):
        vectors = project_to_tangent(
            vectors, corner_face_normal, CORNER_TOLERANCE_DEGREES, source, "corner"
        )
    x, y = tangent_frame(normal)
    z = to_representation(vectors, x[surface.corner_face], y[surface.corner_face], degree)
    report(0.9, "reading the field")
    mean = from_representation(mean_per_face(z, surface.face_start), x, y, degree)
    return RosyField(degree, np.where(normalize(normal).any(axis=1)[:, None], mean, 0.0))


def _attribute_hint(mesh: bpy.types.Mesh) -> str:
    """Return a list of the mesh's vector attributes, for a message; empty if there are none."""
    names = [
        f"'{other.name}'"
        for other in mesh.attributes
        if other.data_type == VECTOR_TYPE
        and other.name not in ("position", "rest_position")
        and not other.name.startswith(".")
    ]
    return f": choose {' or '.join(names)}" if names else ": make or import a field"
