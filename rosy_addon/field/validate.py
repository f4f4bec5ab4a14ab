"""Validate vectors and directions from files or attributes, and make fields from them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from ..core.errors import RosyError, RowCountError, counted
from .blocks import bincount_rows, by_rows, row_blocks
from .corner_fans import corner_angles, corner_rotations
from .directional_field import (
    closest_rosy,
    detect_families,
    field_from_directions,
    is_rosy,
    ratio_harmonics,
    ratios_from_harmonics,
)
from .frames import coordinates, dot, normalize, quotient, tangent_frame
from .polygon_arrays import mean_per_face
from .representation import from_representation, signed_power, to_representation
from .rosy_field import RosyField, check_degree
from .surface import Surface

#: Largest angle in degrees between a vector and the tangent plane of its face or vertex. Larger angles mean
#: that the field belongs to another mesh or another space. On faces, rounding in text files causes only
#: about a thousandth of this angle. On vertices, the angle allows for the different definitions of vertex
#: normals: angle-weighted and area-weighted normals differ by this much on coarse meshes. On corners it is large,
#: because their vectors may be tangent to the smooth surface rather than to the face.
TOLERANCE_DEG = {"face": 5.0, "vertex": 20.0, "corner": 30.0}

#: Largest fraction of the nonzero vectors that may exceed the tolerance, for example on needle
#: faces whose normals are inaccurate.
MAX_OUTLIER_FRACTION = 0.01

#: The values of `VectorPolicy.off_surface`.
OFF_SURFACE = ("error", "project", "undefined")

#: Values of at least this modulus count as infinite. Products of the lengths of longer vectors would
#: overflow, and pictures are computed in single precision.
MAX_COMPONENT = 1e30

#: A vector counts as zero if all its components are smaller than this, because products would underflow.
MIN_COMPONENT = 1e-30

#: Sine of the angle off the tangent plane below which vectors are left unchanged. It is the
#: rounding error of float32, which Blender stores, so such vectors survive a round trip through
#: files.
ROUNDING_SINE = 3e-7


class VectorPolicy(NamedTuple):
    """What to do about vectors that cannot be used as they are.

    Attributes
    ----------
    nonfinite : {"error", "zero"}
        For vectors that are not finite: raise an error, or treat them as undefined.
    off_surface : {"error", "project", "undefined"}
        For vectors that are more than `TOLERANCE_DEG` off the tangent plane: raise an error if they are more
        than `MAX_OUTLIER_FRACTION` of all, otherwise rotate them into the plane; always rotate them into the
        plane; or treat them as undefined.
    """

    nonfinite: str = "error"
    off_surface: str = "error"

    def checked(self) -> VectorPolicy:
        """Return the policy, or raise a `RosyError` if one of its values does not exist."""
        choices = {"nonfinite": ("error", "zero"), "off_surface": OFF_SURFACE}
        for name, value in self._asdict().items():
            if value not in choices[name]:
                raise RosyError(f"{name} is {value!r}: choose one of {', '.join(choices[name])}")
        return self


#: Raise errors about all such vectors.
STRICT = VectorPolicy()


def validated_field(
    surface: Surface,
    vectors: np.ndarray,
    degree: int,
    source: str,
    policy: VectorPolicy = STRICT,
    domain: str | None = None,
) -> RosyField:
    """Check one member vector for each face or vertex, and make a field from them.

    Vectors slightly off the tangent plane are rotated into the plane and keep their length. Values at
    vertices are averaged onto the faces in the RoSy representation. (A mean of member vectors would depend
    on which of the N members are stored.)

    Parameters
    ----------
    surface : Surface
        If it is deformed, the vectors must be tangent to its rest shape.
    vectors : (F, 3) or (V, 3) array_like
        Member vectors in object space. The field is undefined where they are zero, and on faces
        without area.
    degree : int
        N.
    source : str
        Name of the file or attribute, for messages.
    policy : VectorPolicy
        What to do about vectors that are not finite, or off the surface.
    domain : {"face", "vertex"}, optional
        The mesh elements to which the vectors belong. By default it is determined from the number of vectors,
        and is "face" if the mesh has as many faces as vertices.

    Returns
    -------
    RosyField

    Raises
    ------
    RosyError
        If there is neither one vector for each face nor one for each vertex, if a vector is not finite, or if
        more than `MAX_OUTLIER_FRACTION` of the vectors are off the tangent plane.
    """
    degree = check_degree(degree)
    vectors = np.array(vectors, dtype=np.float64).reshape(-1, 3)
    domain = checked_domain(surface, len(vectors), domain, source)
    apply_nonfinite_policy(vectors, source, domain, policy.nonfinite)
    normal = tangent_normals(surface, domain)
    vectors = project_to_tangent(vectors, normal, source, domain, policy.off_surface)
    if domain == "vertex":
        rest = surface.in_rest_shape()
        z = to_representation(vectors, *tangent_frame(normal), degree)
        face_z = _vertex_averages(rest, normal)(z, degree)
        vectors = from_representation(face_z, *rest.face_frames, degree)
    return RosyField(degree, vectors)


def checked_domain(surface: Surface, count: int, domain: str | None, source: str) -> str:
    """Return the domain ("face" or "vertex") of `count` rows, or raise an error if the count does not fit.

    If `domain` is given, `count` must fit it. Otherwise, it is "face" if the mesh has `count` faces, even if
    it has as many vertices.
    """
    faces, vertices = surface.face_count, len(surface.vertices)
    if domain is None:
        domain = "face" if count == faces else "vertex"
    if count != {"face": faces, "vertex": vertices}.get(domain):
        raise RowCountError(
            f"{source}: contains {counted(count, 'row')}, but {surface.name} has "
            f"{counted(faces, 'face')} and {counted(vertices, 'vertex', 'vertices')}"
        )
    return domain


def validated_directions(
    surface: Surface,
    directions: np.ndarray,
    source: str,
    policy: VectorPolicy = STRICT,
    domain: str | None = None,
) -> RosyField:
    """Check N directions for each face or vertex, and make a field from them.

    The directions need not be rotationally symmetric.

    Parameters
    ----------
    surface : Surface
        If it is deformed, the directions must be tangent to its rest shape.
    directions : (n, N, 3) array_like
        Vectors in object space, in any order. Where one of the N vectors is zero, the field is undefined.
    source : str
        Name of the file or attribute, for messages.
    policy : VectorPolicy
        What to do about directions that are not finite, or off the surface.
    domain : {"face", "vertex"}, optional
        The mesh elements to which the rows belong; by default determined from their number.

    Returns
    -------
    RosyField
        The field, with `direction_ratios` if the directions are not a RoSy; see `field_from_directions`.

    Raises
    ------
    RosyError
        If there is neither one row for each face nor one for each vertex, if a direction is not finite, or if
        more than `MAX_OUTLIER_FRACTION` of the directions are off the tangent plane.
    """
    directions = np.array(directions, dtype=np.float64)
    count, degree = len(directions), check_degree(directions.shape[1])
    domain = checked_domain(surface, count, domain, source)
    with np.errstate(invalid="ignore"):
        unusable = ~(np.abs(directions) < MAX_COMPONENT).all(axis=(1, 2))
    usable_directions = np.where(unusable[:, None, None], 0.0, directions)
    are_kept = domain == "face" and policy.off_surface == "error"
    source_directions = usable_directions if are_kept else None
    directions[unusable] = np.nan
    normal = tangent_normals(surface, domain)

    def are_rosys(rows: slice) -> bool:
        return is_rosy(coordinates(usable_directions[rows], *tangent_frame(normal[rows])))

    if all(map(are_rosys, row_blocks(count))):
        vectors = directions[:, 0].copy()
        vectors[~unusable & ~directions.any(axis=2).all(axis=1)] = 0
        field = validated_field(surface, vectors, degree, source, policy, domain)
        field = detect_families(surface.in_rest_shape(), field)
        return replace(field, source_directions=source_directions)
    apply_nonfinite_policy(directions.reshape(count, -1), source, domain, policy.nonfinite)
    rows, normals = directions.reshape(-1, 3), np.repeat(normal, degree, axis=0)
    rows = project_to_tangent(rows, normals, source, domain, policy.off_surface)
    directions = rows.reshape(count, degree, 3)
    surface = surface.in_rest_shape()
    if domain == "face":
        field = field_from_directions(surface, directions)
        return replace(field, source_directions=source_directions)
    return detect_families(surface, _average_directions(surface, directions, normal))


def _average_directions(surface: Surface, directions: np.ndarray, normal: np.ndarray) -> RosyField:
    """Return the field on the faces that is the mean of (V, N, 3) directions at the vertices.

    The mean is computed of the representation z and of each harmonic (see `directional_field`). `normal`
    holds the (V, 3) vertex normals.
    """
    degree = directions.shape[1]
    w = coordinates(directions, *tangent_frame(normal))
    first_angle, rho, direction_ratios = by_rows(closest_rosy, w)
    average = _vertex_averages(surface, normal)
    z = average(rho * np.exp(1j * degree * first_angle), degree)
    member = np.exp(1j * np.angle(z) / degree)
    coefficients = {}
    for j, values in ratio_harmonics(direction_ratios).items():
        mean = average(values * np.exp(-1j * j * first_angle), -j)
        coefficients[j] = mean * signed_power(member, j)
    vectors = from_representation(z, *surface.face_frames, degree)
    return RosyField(degree, vectors, ratios_from_harmonics(coefficients, degree))


def _vertex_averages(surface: Surface, normal: np.ndarray) -> Callable[..., np.ndarray]:
    """Return a function that averages (V,) complex values at the vertices onto the faces.

    The second argument of the function is the order k of the values: if a tangent vector is rotated by t,
    its value is multiplied by exp(i k t). `normal` holds the (V, 3) vertex normals.
    """
    rotation = corner_rotations(surface, normal[surface.corner_vertex])

    def average(values: np.ndarray, order: int) -> np.ndarray:
        corner_values = values[surface.corner_vertex] * np.conj(signed_power(rotation, order))
        return mean_per_face(corner_values, surface.face_start)

    return average


def tangent_normals(surface: Surface, domain: str) -> np.ndarray:
    """Return the normals of the tangent planes of faces or vertices, in the rest shape.

    Returns
    -------
    (F, 3) or (V, 3) float64 ndarray
        Unit normals: `Surface.face_normal` for the domain "face", `vertex_normals` for "vertex". Zero on
        faces without area and on vertices without a face.
    """
    surface = surface.in_rest_shape()
    return surface.face_normal if domain == "face" else vertex_normals(surface)


def vertex_normals(surface: Surface) -> np.ndarray:
    """Return vertex normals: the face normals around each vertex, averaged with the corner angles as weights.

    Sharp edges are ignored. The normals are perpendicular to the shape `Surface.vertices`. For the rest
    shape, pass `surface.in_rest_shape()`.

    Returns
    -------
    (V, 3) float64 ndarray
        Unit normals; zero on vertices without a face.
    """
    weighted = surface.face_normal[surface.corner_face] * corner_angles(surface)[:, None]
    return normalize(bincount_rows(surface.corner_vertex, weighted, len(surface.vertices)))


def project_to_tangent(
    vectors: np.ndarray,
    normal: np.ndarray,
    source: str,
    domain: str,
    off_surface: str = "error",
) -> np.ndarray:
    """Project vectors to tangent planes, and scale them to their original length.

    Parameters
    ----------
    vectors, normal : (n, 3) float64 ndarray
        Vectors, and the unit normals of their planes.
    source : str
        Name of the file or attribute, for messages.
    domain : {"face", "vertex", "corner"}
        The mesh elements to which the vectors belong. They decide the largest angle between a vector and its
        plane, `TOLERANCE_DEG`.
    off_surface : {"error", "project", "undefined"}
        What to do about vectors that exceed this angle: raise an error if they are many (see Raises), and
        project them otherwise; always project them; or set them to zero.

    Returns
    -------
    (n, 3) float64 ndarray
        Tangent vectors; zero where the normal is zero or parallel to the vector.

    Raises
    ------
    RosyError
        If `off_surface` is "error" and more than `MAX_OUTLIER_FRACTION` of the vectors exceed the angle.
    """
    tangent, angle, is_zero = by_rows(_project, vectors, normal)
    tolerance = TOLERANCE_DEG[domain]
    outlier = angle > tolerance
    if off_surface == "undefined":
        tangent[outlier] = 0.0
    elif off_surface == "error" and outlier.sum() > MAX_OUTLIER_FRACTION * (~is_zero).sum():
        worst = int(np.argmax(angle))
        raise RosyError(
            f"{source}: {outlier.sum()} of {len(vectors)} vectors are not tangent to the surface: they "
            f"are more than {tolerance:g} degrees off, {domain} {worst} by {angle[worst]:.1f} "
            "degrees. It belongs to another mesh or another shape of it: make or import it again. If only a few "
            "vectors are wrong, choose to project them or to leave them undefined (off_surface, --off-surface)"
        )
    return tangent


def _project(vectors: np.ndarray, normal: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return (n, 3) projections of vectors to planes, with their original length.

    Further results are the (n,) angles from 0 to 90 between vectors and planes, in degrees, and (n,) bool:
    whether each vector is zero. `normal` holds the (n, 3) unit normals of the planes, one for each vector.
    """
    length = np.sqrt(dot(vectors, vectors))
    component = dot(vectors, normal)
    sine = quotient(np.abs(component), length)
    angle = np.degrees(np.arcsin(np.minimum(sine, 1.0)))
    # If a vector is parallel to the normal, its projection is only a rounding error.
    tangent = np.where((sine < 1 - 1e-12)[:, None], vectors - component[:, None] * normal, 0.0)
    projected = normalize(tangent) * length[:, None]
    tangent = np.where((sine > ROUNDING_SINE)[:, None], projected, vectors)
    return np.where(normal.any(axis=1)[:, None], tangent, 0.0), angle, length == 0


def apply_nonfinite_policy(values: np.ndarray, source: str, domain: str, nonfinite: str) -> None:
    """Raise an error if a value is not finite, or set values that are not finite to zero, in place.

    A value is an angle, a vector or a tensor. It is not finite if one of its components is NaN, or has a
    modulus of `MAX_COMPONENT` or more. All of its components are then set to zero. Vectors and tensors whose
    components are all smaller than `MIN_COMPONENT` are set to zero as well.

    Parameters
    ----------
    values : (n,), (n, 3) or (n, 3, 3) float ndarray
        Angles, vectors or tensors. They are changed in place.
    source, domain : str
        Name of the file or attribute, and name of the mesh elements, for the message.
    nonfinite : {"error", "zero"}
        What to do if a value is not finite.

    Raises
    ------
    RosyError
        If `nonfinite` is "error" and a value is not finite.
    """
    modulus = np.abs(values.reshape(len(values), -1))
    if values.ndim > 1:
        values[(modulus < MIN_COMPONENT).all(axis=1)] = 0.0
    unusable = ~(modulus < MAX_COMPONENT).all(axis=1)
    if not unusable.any():
        return
    if nonfinite == "error":
        kind = ("angles", "vectors", "tensors")[values.ndim - 1]
        fault = f"{MAX_COMPONENT:g} or larger" if np.isfinite(modulus).all() else "not finite"
        raise RosyError(
            f"{source}: {unusable.sum()} of {len(values)} {kind} are {fault}, the first on "
            f"{domain} {int(np.argmax(unusable))}: correct them, or choose to treat them as undefined"
        )
    values[unusable] = 0.0
