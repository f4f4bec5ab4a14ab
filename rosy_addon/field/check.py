"""Vectors that come from outside, checked and brought into the form that a field has."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..errors import RosyError
from .corners import corner_angles, corner_rotations
from .directions import (
    deviations_of,
    directions_field,
    harmonics_of,
    is_rosy,
    nearest_rosy,
    with_families,
)
from .frames import dot, tangent_frame, unit
from .representation import (
    face_frames,
    from_representation,
    power,
    signed_power,
    to_representation,
)
from .rosy_field import RosyField, check_degree
from .surface import Surface, mean_over_faces

#: Vectors further off the face's plane than this, in degrees, mean that they belong to another
#: mesh, or to another space: rounding in text files gives a thousandth of it.
FACE_TOLERANCE = 5.0

#: The same for vectors on vertices. What the normal of a vertex is, is a convention: angle-weighted
#: and area-weighted ones lie this far apart on coarse meshes.
VERTEX_TOLERANCE = 20.0

#: So large a part of the vectors may be off by more (needles whose normal is rounding error, say).
FEW = 0.01

#: Numbers from here on are as good as infinite: a length made of them would be.
HUGE = 5e153

#: Smaller deviations, as sines, are the last bits of float32, in which Blender keeps vectors: such
#: vectors stay as they are, and go through files unchanged.
ROUNDING = 3e-7


def checked_field(
    surface: Surface,
    vectors: np.ndarray,
    degree: int,
    source: str,
    undefined: str = "error",
    domain: str | None = None,
) -> RosyField:
    """Make a field of vectors given on faces or vertices.

    Vectors slightly off the tangent plane are turned into it, keeping their length. Values of
    vertices are averaged onto the faces as RoSys (their representations, not their members).

    Parameters
    ----------
    surface : Surface
        If it is deformed, the vectors belong to its shape at rest.
    vectors : (F, 3) or (V, 3) array_like
        One member each, in object space; zero is undefined. They are undefined on faces without
        area, too.
    degree : int
    source : str
        File or attribute, for messages.
    undefined : {"error", "zero"}
        What to do about NaN and infinite vectors: refuse them, or call them undefined.
    domain : {"face", "vertex"}, optional
        What the vectors are given on. Told by their number if not given, faces first.

    Raises
    ------
    RosyError
        If the number of vectors fits neither faces nor vertices, some are not finite, or more than
        a few are clearly off the tangent plane.
    """
    degree = check_degree(degree)
    vectors = np.array(vectors, dtype=np.float64).reshape(-1, 3)
    faces, vertices = surface.face_count, len(surface.vertices)
    domain = field_domain(surface, len(vectors)) if domain is None else domain
    if len(vectors) != {"face": faces, "vertex": vertices}.get(domain):
        raise RosyError(
            f"{source}: holds {len(vectors)} vectors, "
            f"but the mesh {surface.name} has {faces} faces and {vertices} vertices"
        )
    settle_undefined(vectors, source, domain, undefined)
    normal = tangent_normals(surface, domain)
    if domain == "face":
        return RosyField(degree, into_planes(vectors, normal, FACE_TOLERANCE, source, "face"))
    vectors = into_planes(vectors, normal, VERTEX_TOLERANCE, source, "vertex")
    return RosyField(degree, _onto_faces(_at_rest(surface), vectors, normal, degree))


def checked_directions(
    surface: Surface,
    directions: np.ndarray,
    source: str,
    undefined: str = "error",
    domain: str | None = None,
) -> RosyField:
    """Make a field of N directions given on each face or vertex, a RoSy or not.

    Parameters
    ----------
    surface : Surface
    directions : (n, N, 3) array_like
        In any order. If one of them is zero, all are undefined there.
    source, undefined, domain
        As for `checked_field`.

    Returns
    -------
    RosyField
        With deviations if they are not a RoSy; see `directions_field`.

    Raises
    ------
    RosyError
        As `checked_field`.
    """
    directions = np.array(directions, dtype=np.float64)
    count, degree = directions.shape[:2]
    domain = field_domain(surface, count) if domain is None else domain
    given = directions.copy() if domain == "face" else None
    lost = ~is_usable(directions).all(axis=(1, 2))
    directions[lost] = np.nan
    fits = domain is not None and count == _elements(surface, domain)
    if fits:
        normal = tangent_normals(surface, domain)
        x, y = tangent_frame(normal)
        sound = np.where(lost[:, None, None], 0.0, directions)
        w = dot(sound, x[:, None]) + 1j * dot(sound, y[:, None])
    if not fits or is_rosy(w):
        vectors = directions[:, 0].copy()
        vectors[~lost & ~directions.any(axis=2).all(axis=1)] = 0
        field = checked_field(surface, vectors, degree, source, undefined, domain)
        return replace(with_families(_at_rest(surface), field), given=given)
    settle_undefined(directions.reshape(count, -1), source, domain, undefined)
    tolerance = FACE_TOLERANCE if domain == "face" else VERTEX_TOLERANCE
    flat, normals = directions.reshape(-1, 3), np.repeat(normal, degree, axis=0)
    directions = into_planes(flat, normals, tolerance, source, domain).reshape(count, degree, 3)
    surface = _at_rest(surface)
    if domain == "face":
        return replace(directions_field(surface, directions), given=given)
    return with_families(surface, _directions_onto_faces(surface, directions, normal))


def _directions_onto_faces(
    surface: Surface, directions: np.ndarray, normal: np.ndarray
) -> RosyField:
    """The mean over each face's corners of directions on vertices, of z and of each harmonic."""
    degree = directions.shape[1]
    x, y = tangent_frame(normal)
    w = dot(directions, x[:, None]) + 1j * dot(directions, y[:, None])
    first, rho, deviations = nearest_rosy(w)
    face_x, face_y = face_frames(surface)
    corner_normal = normal[surface.corner_vertex]
    turn = corner_rotations(surface.face_normal, face_x, surface.corner_face, corner_normal)

    def mean(values: np.ndarray, order: int) -> np.ndarray:
        back = values[surface.corner_vertex] * np.conj(signed_power(turn, order))
        return mean_over_faces(back, surface.face_start)

    z = mean(rho * np.exp(1j * degree * first), degree)
    member = np.exp(1j * np.angle(z) / degree)
    found = {
        j: mean(values * np.exp(-1j * j * first), -j) * signed_power(member, j)
        for j, values in harmonics_of(deviations).items()
    }
    vectors = from_representation(z, face_x, face_y, degree)
    return RosyField(degree, vectors, deviations_of(found, degree))


def _elements(surface: Surface, domain: str) -> int:
    return surface.face_count if domain == "face" else len(surface.vertices)


def field_domain(surface: Surface, count: int) -> str | None:
    """Whether so many vectors are one a face or one a vertex; faces first, None for neither."""
    if count == surface.face_count:
        return "face"
    return "vertex" if count == len(surface.vertices) else None


def tangent_normals(surface: Surface, domain: str) -> np.ndarray:
    """(F, 3) or (V, 3) unit normals of the planes in which vectors on faces or vertices lie.

    Of the shape at rest. Zero on faces without area. On vertices they are face normals averaged
    with the angles at the corners, regardless of sharp edges; zero on vertices without a face.
    """
    surface = _at_rest(surface)
    return surface.face_normal if domain == "face" else vertex_normals(surface)


def vertex_normals(surface: Surface) -> np.ndarray:
    """(V, 3) float64 unit normals of the faces around each vertex, averaged with their angles.

    Of the shape as it is, regardless of sharp edges; zero on vertices without a face.
    """
    count = len(surface.vertices)
    weighted = surface.face_normal[surface.corner_face] * corner_angles(surface)[:, None]
    columns = [np.bincount(surface.corner_vertex, column, count) for column in weighted.T]
    return unit(np.stack(columns, axis=1))


def into_planes(
    vectors: np.ndarray, normal: np.ndarray, tolerance: float, source: str, domain: str
) -> np.ndarray:
    """(n, 3) vectors turned into the planes across (n, 3) normals, keeping their length.

    They become zero where the normal is, and where they run along it.

    Raises
    ------
    RosyError
        If more than `FEW` of them are off by more than `tolerance` degrees.
    """
    length = np.sqrt(dot(vectors, vectors))
    off = dot(vectors, normal)
    sine = np.divide(np.abs(off), length, out=np.zeros_like(off), where=length > 0)
    angle = np.degrees(np.arcsin(np.minimum(sine, 1.0)))
    astray = angle > tolerance
    if astray.sum() > FEW * np.count_nonzero(length):
        worst = int(np.argmax(angle))
        raise RosyError(
            f"{source}: {astray.sum()} of {len(vectors)} vectors are more than {tolerance:g} degrees "
            f"off the surface, worst on {domain} {worst} by {angle[worst]:.1f} degrees; "
            "is it the field of another mesh, or in another space?"
        )
    # With a normal along the vector nothing but rounding errors would be left of it.
    tangent = np.where((sine < 1 - 1e-12)[:, None], vectors - off[:, None] * normal, 0.0)
    tangent = np.where((sine > ROUNDING)[:, None], unit(tangent) * length[:, None], vectors)
    return np.where(normal.any(axis=1)[:, None], tangent, 0.0)


def settle_undefined(values: np.ndarray, source: str, domain: str, undefined: str) -> None:
    """Refuse values that are not finite, or make them zero, in place.

    Parameters
    ----------
    values : (n,) or (n, 3) float ndarray
        Angles or vectors.
    source, domain : str
        Where they are from and what they are on, for the message.
    undefined : {"error", "zero"}

    Raises
    ------
    RosyError
    """
    lost = ~np.isfinite(values.reshape(len(values), -1)).all(axis=1)
    if not lost.any():
        return
    if undefined == "error":
        kind = "vectors" if values.ndim > 1 else "angles"
        raise RosyError(
            f"{source}: {lost.sum()} of {len(values)} {kind} are not finite, the first on "
            f"{domain} {int(np.argmax(lost))}; ask for them to be undefined, or mend them"
        )
    values[lost] = 0.0


def is_usable(values: np.ndarray) -> np.ndarray:
    """Which numbers are finite, and their squares too."""
    with np.errstate(invalid="ignore"):
        return np.abs(values) < HUGE


def _onto_faces(
    surface: Surface, vectors: np.ndarray, normal: np.ndarray, degree: int
) -> np.ndarray:
    """(F, 3) members of the mean RoSy of each face's corners, each carried to the face's plane."""
    z = to_representation(vectors, *tangent_frame(normal), degree)[surface.corner_vertex]
    x, y = face_frames(surface)
    corner_normal = normal[surface.corner_vertex]
    turn = corner_rotations(surface.face_normal, x, surface.corner_face, corner_normal)
    mean = mean_over_faces(z * power(turn, degree).conj(), surface.face_start)
    return from_representation(mean, x, y, degree)


def _at_rest(surface: Surface) -> Surface:
    """The surface in the shape that its field's vectors belong to."""
    if surface.rest is None:
        return surface
    return replace(surface, vertices=surface.rest, rest=None)
