"""The representation of an N-RoSy: the complex number z = rho exp(i N t).

All N members share it, and averages of it are averages of RoSys (Palacios and Zhang 2007), which
averages of members are not. Every average, interpolation and comparison goes through z.
"""

from __future__ import annotations

import numpy as np

from .frames import dot, unit
from .rosy_field import RosyField
from .surface import Surface, face_blocks, next_corners


def power(numbers: np.ndarray, degree: int) -> np.ndarray:
    """`numbers` ** `degree` by repeated squaring: exact in the phase, and quick for arrays."""
    result = None
    while True:
        if degree & 1:
            result = numbers if result is None else result * numbers
        degree >>= 1
        if not degree:
            return result
        numbers = numbers * numbers


def signed_power(numbers: np.ndarray, order: int) -> np.ndarray | int:
    """`numbers`, of modulus 1 or 0, to a whole power; to a negative one by their conjugates."""
    if order == 0:
        return 1
    found = power(numbers, abs(order))
    return found if order > 0 else found.conj()


def complex_sums(group: np.ndarray, numbers: np.ndarray, count: int) -> np.ndarray:
    """(count,) complex sums of the numbers of each group: `bincount`, of complex weights."""
    real = np.bincount(group, numbers.real, count)
    return real + 1j * np.bincount(group, numbers.imag, count)


def to_representation(vectors: np.ndarray, x: np.ndarray, y: np.ndarray, degree: int) -> np.ndarray:
    """z of member vectors in the frames x, y.

    Parameters
    ----------
    vectors : (..., 3) ndarray
        A member each.
    x, y : (..., 3) ndarray
        Orthonormal tangents, counter-clockwise about the normal.
    degree : int

    Returns
    -------
    (...) complex ndarray
        rho exp(i N t): the member's length, and N times its angle from x. Zero for a zero vector.
    """
    member = dot(vectors, x) + 1j * dot(vectors, y)
    rho = np.abs(member)
    phase = np.divide(member, rho, out=np.zeros_like(member), where=rho > 0)
    return rho * power(phase, degree)


def from_representation(z: np.ndarray, x: np.ndarray, y: np.ndarray, degree: int) -> np.ndarray:
    """The member vector nearest to x that has the representation z; the inverse of the above.

    Returns
    -------
    (..., 3) ndarray
    """
    rho, angle = np.abs(z)[..., None], (np.angle(z) / degree)[..., None]
    return rho * (np.cos(angle) * x + np.sin(angle) * y)


def face_frames(surface: Surface) -> tuple[np.ndarray, np.ndarray]:
    """(F, 3) unit tangents of each face: x along its first edge that has a length, y = normal x x.

    For faces without area both are zero, so that a field's representation is zero there too.
    """
    normal = surface.face_normal
    x = np.empty_like(normal)
    for faces, corners, starts in face_blocks(surface.face_start):
        points = surface.vertices.take(surface.corner_vertex[corners], axis=0)
        across = np.repeat(normal[faces], np.diff(starts), axis=0)
        edge = points[next_corners(starts)] - points
        edge -= dot(edge, across)[:, None] * across
        length = np.sqrt(dot(edge, edge))
        last = np.repeat(starts[1:] - 1, np.diff(starts))
        usable = np.where(length > 0, np.arange(len(length)), last)
        x[faces] = unit(edge[np.minimum.reduceat(usable, starts[:-1])])
    x[~normal.any(axis=1)] = 0.0
    return x, np.cross(normal, x)


def face_representation(surface: Surface, field: RosyField) -> np.ndarray:
    """(F,) complex128: z of a field in `face_frames`."""
    x, y = face_frames(surface)
    return to_representation(field.vectors, x, y, field.degree)


def matching_angles(
    surface: Surface,
    x: np.ndarray,
    y: np.ndarray,
    z: np.ndarray,
    degree: int,
    a: np.ndarray,
    b: np.ndarray,
) -> np.ndarray:
    """(I,) radians from a member on side a to the nearest on side b, the two faces unfolded."""
    from_face, to_face = surface.corner_face[a], surface.corner_face[b]
    edge = surface.vertices[surface.corner_vertex[b]] - surface.vertices[surface.corner_vertex[a]]
    here = dot(edge, x[from_face]) + 1j * dot(edge, y[from_face])
    there = dot(edge, x[to_face]) + 1j * dot(edge, y[to_face])
    unfold = there * here.conj()
    size = np.abs(unfold)
    unfold = np.divide(unfold, size, out=np.ones_like(unfold), where=size > 0)
    return np.angle(z[to_face] * (z[from_face] * power(unfold, degree)).conj()) / degree
