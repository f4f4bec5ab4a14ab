"""The representation of an N-RoSy: the complex number z = rho exp(i N t).

An N-RoSy has N *members*: vectors of length rho that are rotations of each other by 2 pi / N. t is the
angle of one member from the x axis of a tangent frame. All N members give the same z. Therefore the mean
of representations is a mean of RoSys (Palacios and Zhang 2007), and the mean of member vectors is not. All
averages, interpolations and comparisons use z.
"""

import numpy as np

from .blocks import by_rows
from .frames import dot, quotient
from .rosy_field import RosyField
from .surface import Surface

#: An edge is a *tie* if two members of the second face are equally near to a member of the first face: the field turns
#: by half of the angle 2 pi / N between members. This is the tolerance, as a fraction of 2 pi / N. The rounding errors
#: of fields in single precision, or with six digits, are up to 2e-6 of 2 pi / N, for degree 12.
TIE_TURNS = 1e-5


def power(base: np.ndarray, degree: int) -> np.ndarray:
    """Return `base` ** `degree` by repeated squaring, which is fast for arrays; `degree` is at least 1."""
    result = None
    while True:
        if degree & 1:
            result = base if result is None else result * base
        degree >>= 1
        if not degree:
            return result
        base = base * base


def signed_power(base: np.ndarray, exponent: int) -> np.ndarray | int:
    """Return `base` ** `exponent` for complex numbers of modulus 1 or 0 and any integer exponent.

    Negative powers are computed as conjugates of positive powers, so negative powers of 0 are 0. The result
    for the exponent 0 is the number 1, not an array.
    """
    if exponent == 0:
        return 1
    result = power(base, abs(exponent))
    return result if exponent > 0 else result.conj()


def unit_complex(z: np.ndarray, otherwise: int = 0) -> np.ndarray:
    """Return complex numbers divided by their moduli. Zeros are replaced by `otherwise`.

    Subnormal numbers count as zeros, because their inverse overflows.
    """
    modulus = np.abs(z)
    is_normal = modulus >= np.finfo(modulus.dtype).tiny
    return np.divide(z, modulus, out=np.full_like(z, otherwise), where=is_normal)


def complex_bincount(index: np.ndarray, weights: np.ndarray, count: int) -> np.ndarray:
    """Return (count,) complex128 sums of the weights of each index: `numpy.bincount` for complex weights."""
    return np.bincount(index, weights.real, count) + 1j * np.bincount(index, weights.imag, count)


def to_representation(vectors: np.ndarray, x: np.ndarray, y: np.ndarray, degree: int) -> np.ndarray:
    """Convert member vectors of N-RoSys to representations z in the frames x, y.

    Parameters
    ----------
    vectors : (..., 3) ndarray
        One of the N member vectors of each RoSy.
    x, y : (..., 3) ndarray
        Orthonormal tangents; y is a quarter turn counter-clockwise from x about the normal.
    degree : int
        N.

    Returns
    -------
    (...) complex ndarray
        rho exp(i N t), where rho is the length of the member and t its angle from x. Zero for a
        zero vector.
    """
    member = dot(vectors, x) + 1j * dot(vectors, y)
    rho = np.abs(member)
    return rho * power(quotient(member, rho), degree)


def from_representation(z: np.ndarray, x: np.ndarray, y: np.ndarray, degree: int) -> np.ndarray:
    """Convert representations z in the frames x, y to member vectors.

    This is the inverse of `to_representation`, except that it returns the member nearest to x.

    Returns
    -------
    (..., 3) ndarray
        Members at angles from -pi / N to pi / N from x.
    """
    rho, angle = np.abs(z)[..., None], (np.angle(z) / degree)[..., None]
    return rho * (np.cos(angle) * x + np.sin(angle) * y)


def face_representation(surface: Surface, field: RosyField) -> np.ndarray:
    """Return (F,) complex128 representations z of a field in the tangent frames of `surface.face_frames`."""
    return to_representation(field.vectors, *surface.face_frames, field.degree)


def edge_unfolding(surface: Surface, a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Return (I,) complex128 factors of modulus 1 that change frames across interior edges.

    If the two faces are unfolded into one plane, a direction (as a complex number in the frame of the first
    face, see `Surface.face_frames`) times the factor is the same direction in the frame of the second face.
    `a` and `b` are the corners of both faces where the edges start, as in `Edges.halfedges`.
    """
    x, y = surface.face_frames
    source_face, target_face = surface.corner_face[a], surface.corner_face[b]
    edge = surface.vertices[surface.corner_vertex[b]] - surface.vertices[surface.corner_vertex[a]]
    edge_in_source = dot(edge, x[source_face]) + 1j * dot(edge, y[source_face])
    edge_in_target = dot(edge, x[target_face]) + 1j * dot(edge, y[target_face])
    unfolding = edge_in_target * edge_in_source.conj()
    return unit_complex(unfolding, otherwise=1)


def matching_angles(
    surface: Surface, z: np.ndarray, degree: int, halfedges: np.ndarray | None = None
) -> np.ndarray:
    """Return the angle between matching members of the two faces at each interior edge.

    The faces are unfolded into one plane. A member of the first face matches the nearest member of
    the second face.

    Parameters
    ----------
    surface : Surface
    z : (F,) complex ndarray
        Representations in the frames `Surface.face_frames`.
    degree : int
        N of the representations.
    halfedges : (I, 2) int ndarray, optional
        Rows of `Edges.halfedges`; by default all of them.

    Returns
    -------
    (I,) float64 ndarray
        For each row: counter-clockwise angle in radians from a member of the first face
        to the nearest member of the second face, from -pi / N to pi / N. At ties (see `TIE_TURNS`), where
        rounding errors would choose the sign, the angle from the face with the smaller index is pi / N.
    """

    def angles(a: np.ndarray, b: np.ndarray) -> np.ndarray:
        source, target = z[surface.corner_face[a]], z[surface.corner_face[b]]
        unfolding = edge_unfolding(surface, a, b)
        angle = np.angle(target * (source * power(unfolding, degree)).conj())
        angle[is_tie(angle)] = np.pi
        return angle / degree

    halfedges = surface.edges.halfedges if halfedges is None else halfedges
    return by_rows(angles, *halfedges.T)


def is_tie(angle: np.ndarray) -> np.ndarray:
    """Return whether angles between two representations, from -pi to pi, are pi or -pi, up to rounding errors.

    The tolerance is `TIE_TURNS`, as a fraction of 2 pi.
    """
    return np.abs(angle) > np.pi * (1 - 2 * TIE_TURNS)
