"""Vectors that come from outside, checked and brought into the form that a field has."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..errors import RosyError
from .corners import corner_angles, corner_rotations
from .frames import dot, tangent_frame, unit
from .representation import face_frames, from_representation, power, to_representation
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

#: Smaller deviations, as sines, are the last bits of float64: such vectors stay as they are.
ROUNDING = 1e-12


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
    if domain == "face":
        return surface.face_normal
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
    tangent = np.where((sine < 1 - ROUNDING)[:, None], vectors - off[:, None] * normal, 0.0)
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
