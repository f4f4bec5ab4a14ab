"""Validate vectors and directions from files or attributes, and make fields from them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..errors import RosyError, counted
from ..progress import progress, report
from .blocks import by_rows, row_blocks
from .corner_fans import corner_angles, corner_rotations
from .directional_field import (
    closest_rosy,
    detect_families,
    field_from_directions,
    is_rosy,
    ratio_harmonics,
    ratios_from_harmonics,
)
from .frames import dot, normalize, tangent_frame
from .representation import (
    face_frames,
    from_representation,
    power,
    signed_power,
    to_representation,
)
from .rosy_field import RosyField, check_degree
from .surface import Surface, mean_per_face

#: Largest angle in degrees between a vector and the plane of its face. Larger angles mean that the
#: field belongs to another mesh or another space. Rounding in text files causes about a thousandth
#: of this.
FACE_TOLERANCE_DEG = 5.0

#: The same for vectors on vertices. Programs define vertex normals differently: on coarse meshes,
#: angle-weighted and area-weighted normals differ by this much.
VERTEX_TOLERANCE_DEG = 20.0

#: Largest fraction of the nonzero vectors that may exceed the tolerance, for example on needle
#: faces whose normals are inaccurate.
MAX_OUTLIER_FRACTION = 0.01

#: Numbers of this modulus or more count as infinite. Products of the lengths of vectors would
#: overflow, and pictures are computed in single precision.
MAX_COMPONENT = 1e30

#: Vectors whose components are all smaller count as zero, because products would underflow.
MIN_COMPONENT = 1e-30

#: Label of the progress of checking vectors.
LABEL = "checking the field"

#: Sine of the angle off the tangent plane below which vectors are left unchanged. It is the
#: rounding error of float32, which Blender stores, so such vectors survive a round trip through
#: files.
ROUNDING_SINE = 3e-7


def validated_field(
    surface: Surface,
    vectors: np.ndarray,
    degree: int,
    source: str,
    nonfinite: str = "error",
    domain: str | None = None,
) -> RosyField:
    """Make a field from one member vector for each face or vertex, after checking them.

    Vectors slightly off the tangent plane are rotated into it and keep their length. Vertex values
    are averaged onto the faces as RoSys (by their representations, not their member vectors).

    Parameters
    ----------
    surface : Surface
        If it is deformed, the vectors belong to its rest shape.
    vectors : (F, 3) or (V, 3) array_like
        Member vectors in object space. The field is undefined where they are zero, and on faces
        without area.
    degree : int
        N.
    source : str
        Name of the file or attribute, for messages.
    nonfinite : {"error", "zero"}
        Raise an error if a vector is not finite, or treat it as undefined.
    domain : {"face", "vertex"}, optional
        The mesh elements of the vectors. If not given, it follows from their number; faces take
        precedence.

    Returns
    -------
    RosyField

    Raises
    ------
    RosyError
        If the number of vectors fits neither faces nor vertices, a vector is not finite, or more
        than `MAX_OUTLIER_FRACTION` of them are off the tangent plane.
    """
    degree = check_degree(degree)
    vectors = np.array(vectors, dtype=np.float64).reshape(-1, 3)
    faces, vertices = surface.face_count, len(surface.vertices)
    domain = infer_domain(surface, len(vectors)) if domain is None else domain
    if len(vectors) != {"face": faces, "vertex": vertices}.get(domain):
        raise RosyError(
            f"{source}: contains {counted(len(vectors), 'vector')}, "
            f"but {surface.name} has {counted(faces, 'face')} and "
            f"{counted(vertices, 'vertex', 'vertices')}"
        )
    apply_nonfinite_policy(vectors, source, domain, nonfinite)
    normal = tangent_normals(surface, domain)
    if domain == "face":
        with progress(0.4, 1.0):
            return RosyField(
                degree, project_to_tangent(vectors, normal, FACE_TOLERANCE_DEG, source, "face")
            )
    with progress(0.4, 0.6):
        vectors = project_to_tangent(vectors, normal, VERTEX_TOLERANCE_DEG, source, "vertex")
    with progress(0.6, 1.0):
        return RosyField(
            degree, _average_to_faces(surface.in_rest_shape(), vectors, normal, degree)
        )


def validated_directions(
    surface: Surface,
    directions: np.ndarray,
    source: str,
    nonfinite: str = "error",
    domain: str | None = None,
) -> RosyField:
    """Make a field from N directions for each face or vertex, after checking them.

    The directions need not be a RoSy.

    Parameters
    ----------
    surface : Surface
    directions : (n, N, 3) array_like
        In object space, in any order. Where one of them is zero, the field is undefined.
    source, nonfinite, domain
        As for `validated_field`.

    Returns
    -------
    RosyField
        With `direction_ratios` if they are not a RoSy; see `field_from_directions`.

    Raises
    ------
    RosyError
        As for `validated_field`.
    """
    directions = np.array(directions, dtype=np.float64)
    count, degree = directions.shape[:2]
    domain = infer_domain(surface, count) if domain is None else domain

    def usable_rows(rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        unusable = ~has_finite_square(rows).all(axis=(1, 2))
        return unusable, np.where(unusable[:, None, None], 0.0, rows)

    with progress(0.0, 0.1):
        unusable, usable_directions = by_rows(usable_rows, directions, label=LABEL)
    source_directions = usable_directions if domain == "face" else None
    directions[unusable] = np.nan
    count_matches = domain is not None and count == _element_count(surface, domain)
    are_rosys = True
    if count_matches:
        normal = tangent_normals(surface, domain)
        for rows in row_blocks(count):
            report(0.2 + 0.1 * rows.start / count, LABEL)
            x, y = tangent_frame(normal[rows])
            usable = usable_directions[rows]
            are_rosys &= is_rosy(dot(usable, x[:, None]) + 1j * dot(usable, y[:, None]))
            if not are_rosys:
                break
    report(0.3, LABEL)
    if are_rosys:
        vectors = directions[:, 0].copy()
        vectors[~unusable & ~directions.any(axis=2).all(axis=1)] = 0
        with progress(0.3, 0.6):
            field = validated_field(surface, vectors, degree, source, nonfinite, domain)
        with progress(0.6, 1.0, LABEL):
            return replace(
                detect_families(surface.in_rest_shape(), field), source_directions=source_directions
            )
    apply_nonfinite_policy(directions.reshape(count, -1), source, domain, nonfinite)
    report(0.3, LABEL)
    tolerance_deg = FACE_TOLERANCE_DEG if domain == "face" else VERTEX_TOLERANCE_DEG
    flat_directions, normals = directions.reshape(-1, 3), np.repeat(normal, degree, axis=0)
    with progress(0.3, 0.5):
        directions = project_to_tangent(
            flat_directions, normals, tolerance_deg, source, domain
        ).reshape(count, degree, 3)
    surface = surface.in_rest_shape()
    if domain == "face":
        with progress(0.5, 1.0, LABEL):
            return replace(
                field_from_directions(surface, directions), source_directions=source_directions
            )
    with progress(0.5, 0.8):
        field = _average_directions_to_faces(surface, directions, normal)
    with progress(0.8, 1.0, LABEL):
        return detect_families(surface, field)


def _average_directions_to_faces(
    surface: Surface, directions: np.ndarray, normal: np.ndarray
) -> RosyField:
    """Average (V, N, 3) directions onto the faces, as means of z and of each harmonic.

    (V, 3) `normal` are the vertex normals.
    """
    degree = directions.shape[1]
    x, y = tangent_frame(normal)
    w = dot(directions, x[:, None]) + 1j * dot(directions, y[:, None])
    with progress(0.0, 0.2):
        first_angle, rho, direction_ratios = by_rows(closest_rosy, w, label=LABEL)
    face_x, face_y = face_frames(surface)
    with progress(0.3, 0.5):
        rotation = corner_rotations(
            surface.face_normal, face_x, surface.corner_face, normal[surface.corner_vertex], LABEL
        )

    def corner_mean(values: np.ndarray, order: int) -> np.ndarray:
        face_values = values[surface.corner_vertex] * np.conj(signed_power(rotation, order))
        return mean_per_face(face_values, surface.face_start)

    z = corner_mean(rho * np.exp(1j * degree * first_angle), degree)
    report(0.6, LABEL)
    member = np.exp(1j * np.angle(z) / degree)
    harmonics = ratio_harmonics(direction_ratios)
    coefficients = {}
    for j, values in harmonics.items():
        report(0.7 + 0.2 * len(coefficients) / len(harmonics), LABEL)
        mean = corner_mean(values * np.exp(-1j * j * first_angle), -j)
        coefficients[j] = mean * signed_power(member, j)
    report(0.9, LABEL)
    vectors = from_representation(z, face_x, face_y, degree)
    return RosyField(degree, vectors, ratios_from_harmonics(coefficients, degree))


def _element_count(surface: Surface, domain: str) -> int:
    """The number of faces or vertices."""
    return surface.face_count if domain == "face" else len(surface.vertices)


def infer_domain(surface: Surface, count: int) -> str | None:
    """The domain, "face" or "vertex", with `count` elements; None for neither.

    Faces take precedence.
    """
    if count == surface.face_count:
        return "face"
    return "vertex" if count == len(surface.vertices) else None


def tangent_normals(surface: Surface, domain: str) -> np.ndarray:
    """The normals of the tangent planes of faces or vertices, in the rest shape.

    Returns
    -------
    (F, 3) or (V, 3) float64 ndarray
        Unit normals; see `Surface.face_normal` and `vertex_normals`. Zero on faces without area and
        on vertices without a face.
    """
    surface = surface.in_rest_shape()
    if domain == "face":
        return surface.face_normal
    return vertex_normals(surface)


def vertex_normals(surface: Surface) -> np.ndarray:
    """Average the face normals around each vertex, weighted by corner angle.

    Sharp edges are ignored. The normals are those of `Surface.vertices`, the deformed shape.

    Returns
    -------
    (V, 3) float64 ndarray
        Unit normals; zero on vertices without a face.
    """
    count = len(surface.vertices)
    angles = corner_angles(surface)
    face_normal = surface.face_normal
    weighted = face_normal[surface.corner_face] * angles[:, None]
    columns = [np.bincount(surface.corner_vertex, column, count) for column in weighted.T]
    return normalize(np.stack(columns, axis=1))


def project_to_tangent(
    vectors: np.ndarray, normal: np.ndarray, tolerance_deg: float, source: str, domain: str
) -> np.ndarray:
    """Project vectors to tangent planes and restore their length.

    Parameters
    ----------
    vectors, normal : (n, 3) float64 ndarray
        Vectors, and the unit normals of their planes.
    tolerance_deg : float
        Largest angle between a vector and its plane, degrees.
    source, domain : str
        Names of the source and the mesh elements, for messages.

    Returns
    -------
    (n, 3) float64 ndarray
        Zero where the normal is zero or parallel to the vector.

    Raises
    ------
    RosyError
        If more than `MAX_OUTLIER_FRACTION` of the vectors exceed the tolerance.
    """
    tangent, angle, is_zero = by_rows(_project, vectors, normal, label=LABEL)
    outlier = angle > tolerance_deg
    if outlier.sum() > MAX_OUTLIER_FRACTION * np.count_nonzero(~is_zero):
        worst = int(np.argmax(angle))
        raise RosyError(
            f"{source}: {outlier.sum()} of {len(vectors)} vectors are not tangent to the surface: they "
            f"are more than {tolerance_deg:g} degrees off, {domain} {worst} by {angle[worst]:.1f} "
            "degrees. It belongs to another mesh or another shape of it: make or import it again"
        )
    return tangent


def _project(vectors: np.ndarray, normal: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return projected vectors, their angles to the planes in degrees, and whether they are zero."""
    length = np.sqrt(dot(vectors, vectors))
    normal_component = dot(vectors, normal)
    sine = np.divide(
        np.abs(normal_component), length, out=np.zeros_like(normal_component), where=length > 0
    )
    angle = np.degrees(np.arcsin(np.minimum(sine, 1.0)))
    # The projection of a vector parallel to the normal is only rounding error.
    tangent = np.where(
        (sine < 1 - 1e-12)[:, None], vectors - normal_component[:, None] * normal, 0.0
    )
    tangent = np.where(
        (sine > ROUNDING_SINE)[:, None], normalize(tangent) * length[:, None], vectors
    )
    return np.where(normal.any(axis=1)[:, None], tangent, 0.0), angle, length == 0


def apply_nonfinite_policy(values: np.ndarray, source: str, domain: str, nonfinite: str) -> None:
    """Raise an error if values are not finite, or set them to zero in place.

    Values from `MAX_COMPONENT` on are treated as infinite. Vectors below `MIN_COMPONENT` are set to
    zero.

    Parameters
    ----------
    values : (n,), (n, 3) or (n, 3, 3) float ndarray
        Angles, vectors or tensors.
    source, domain : str
        Names of the source and the mesh elements, for the message.
    nonfinite : {"error", "zero"}

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


def as_float64(values: np.ndarray) -> np.ndarray:
    """Return a copy of numbers as float64, without a warning for signalling NaN."""
    with np.errstate(invalid="ignore"):
        return values.astype(np.float64)


def has_finite_square(values: np.ndarray) -> np.ndarray:
    """Whether numbers and their squares are finite, element by element."""
    with np.errstate(invalid="ignore"):
        return np.abs(values) < MAX_COMPONENT


def _average_to_faces(
    surface: Surface, vectors: np.ndarray, normal: np.ndarray, degree: int
) -> np.ndarray:
    """(F, 3) members of the mean RoSy of the vertices of each face, transported to its plane.

    (V, 3) `vectors` are members at the vertices, (V, 3) `normal` the vertex normals.
    """
    z = to_representation(vectors, *tangent_frame(normal), degree)[surface.corner_vertex]
    report(0.0, LABEL)
    x, y = face_frames(surface)
    report(0.2, LABEL)
    corner_normal = normal[surface.corner_vertex]
    with progress(0.2, 0.8):
        rotation = corner_rotations(
            surface.face_normal, x, surface.corner_face, corner_normal, LABEL
        )
    mean = mean_per_face(z * power(rotation, degree).conj(), surface.face_start)
    return from_representation(mean, x, y, degree)
