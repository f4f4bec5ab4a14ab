"""Fields of N directions at free angles and of free lengths, as RoSys and what they deviate by.

Polyvector, frame and conjugate fields are not RoSys: their directions keep no fixed angle. But N
directions in their order around the normal have a nearest RoSy: its member k lies, on average over
k, where direction k does. Its representation is, up to its sign and its length, the product of all
directions, the last coefficient of the polynomial whose roots they are (Diamanti, Vaxman, Panozzo
and Sorkine-Hornung 2014), so that it does not depend on their order, and is smooth where they are.

Direction k is member k times a complex number delta_k. These are values of a trigonometric
polynomial at the members' angles,

    delta_k = sum_j C_j exp(i j theta_k),   theta_k = t + 2 pi k / N,

and its coefficients C_j no longer depend on which member is the first: like z they can be carried
from frame to frame, averaged and interpolated. Of a RoSy, C_0 = 1 and all others are 0.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from .frames import dot
from .representation import face_frames, matching_angles, signed_power, to_representation
from .rosy_field import RosyField, check_degree
from .surface import Surface, surface_edges

#: How far directions may be from a RoSy and pass for one: degrees between neighbours, and relative
#: difference in length. Files with six digits are a hundred times as good.
ANGLE_TOLERANCE, LENGTH_TOLERANCE = 1.0, 0.01

#: Harmonics smaller than this, beside the 1 of a RoSy, are rounding errors of text files.
FAINT = 1e-4

#: Share of the edges across which the first direction goes over into itself, if lines are told
#: apart by their numbers.
CONSISTENT = 0.98


def directions_field(surface: Surface, directions: np.ndarray) -> RosyField:
    """The field of N directions on each face.

    Parameters
    ----------
    surface : Surface
        If it is deformed, the directions belong to its shape at rest, as `surface`.
    directions : (F, N, 3) float64 ndarray
        In the planes of the faces, in any order. A face on which one of them is zero is undefined.

    Returns
    -------
    RosyField
        With `deviations`, unless it is a RoSy within `ANGLE_TOLERANCE` and `LENGTH_TOLERANCE`; of a
        RoSy the first direction is stored as it is. With `families` if the first direction is the
        same line all over the surface.
    """
    x, y = face_frames(surface)
    w = dot(directions, x[:, None]) + 1j * dot(directions, y[:, None])
    rosy = is_rosy(w)
    first, rho, deviations = nearest_rosy(w)
    if rosy:
        vectors, deviations = directions[:, 0] * (rho > 0)[:, None], None
    else:
        vectors = rho[:, None] * (np.cos(first)[:, None] * x + np.sin(first)[:, None] * y)
    return with_families(surface, RosyField(directions.shape[1], vectors, deviations))


def nearest_rosy(w: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The RoSy that N directions deviate from, and by how much.

    Parameters
    ----------
    w : (n, N) complex ndarray
        In frames of their planes, in any order.

    Returns
    -------
    first : (n,) float64 ndarray
        The angle of the member that belongs to the first direction, radians.
    rho : (n,) float64 ndarray
        The mean length; 0 where one of the directions is.
    deviations : (n, N) complex128 ndarray
        By counter-clockwise order from the first.
    """
    degree = check_degree(w.shape[1])
    step = 2 * np.pi * np.arange(degree) / degree
    defined = (w != 0).all(axis=1)
    w = np.where(defined[:, None], w, np.exp(1j * step))
    ahead = _ahead(w)
    order = np.argsort(ahead, axis=1, kind="stable")
    ahead, w = np.take_along_axis(ahead, order, 1), np.take_along_axis(w, order, 1)
    first = np.angle(w[:, 0]) + (ahead - step).mean(axis=1)
    rho = np.abs(w).mean(axis=1)
    deviations = w / (rho[:, None] * np.exp(1j * (first[:, None] + step)))
    return first, rho * defined, deviations


def is_rosy(w: np.ndarray) -> bool:
    """Whether (n, N) directions are RoSys all over, within the tolerances; rows with 0 aside."""
    w = w[(w != 0).all(axis=1)]
    if not len(w):
        return True
    length = np.abs(w)
    gap = np.diff(np.sort(_ahead(w), axis=1), axis=1, append=2 * np.pi) - 2 * np.pi / w.shape[1]
    uneven = 1 - length.min(axis=1) / length.max(axis=1)
    off = np.degrees(np.abs(gap).max(initial=0.0))
    return bool(off <= ANGLE_TOLERANCE and uneven.max(initial=0.0) <= LENGTH_TOLERANCE)


def _ahead(w: np.ndarray) -> np.ndarray:
    """(n, N) angles from the first direction counter-clockwise, from 0 to 2 pi."""
    angle = np.angle(w)
    ahead = (angle - angle[:, :1]) % (2 * np.pi)
    ahead[:, 0] = 0
    return ahead


def with_families(surface: Surface, field: RosyField) -> RosyField:
    """The field, its lines told apart if the stored member is on the same one all over."""
    lines = field.degree // 2 if is_paired(field) else field.degree
    if lines == 1:
        return field
    faces, slip = slips(surface, field)
    known = field.vectors.any(axis=1)[faces].all(axis=1)
    if not known.any() or np.mean(slip[known] % lines == 0) < CONSISTENT:
        return field
    return replace(field, families=lines)


def directions_of(surface: Surface, field: RosyField) -> np.ndarray:
    """(F, N, 3) the directions of a field on each face, counter-clockwise about the normal.

    The first is that which belongs to the stored member, and of a RoSy that member itself.
    """
    across = np.cross(surface.face_normal, field.vectors)
    turn = np.exp(2j * np.pi * np.arange(field.degree) / field.degree)
    if field.deviations is not None:
        turn = turn * field.deviations
    turn = np.broadcast_to(turn, (len(field.vectors), field.degree))[..., None]
    return turn.real * field.vectors[:, None] + turn.imag * across[:, None]


def harmonics(field: RosyField) -> dict[int, np.ndarray]:
    """By j, (F,) complex128 coefficients relative to the stored member, C_j exp(i j t).

    From -(N - 1) // 2 to N // 2, without those that are `FAINT` all over; none of a RoSy.
    """
    return {} if field.deviations is None else harmonics_of(field.deviations)


def harmonics_of(deviations: np.ndarray) -> dict[int, np.ndarray]:
    """`harmonics` of (n, N) deviations."""
    degree = deviations.shape[1]
    step = 2 * np.pi * np.arange(degree) / degree
    found = {}
    for j in range(-((degree - 1) // 2), degree // 2 + 1):
        values = (deviations * np.exp(-1j * j * step)).mean(axis=1)
        if j == 0 or np.abs(values).max(initial=0.0) > FAINT:
            found[j] = values
    return found


def deviations_of(found: dict[int, np.ndarray], degree: int) -> np.ndarray:
    """(n, N) deviations of `harmonics`; the inverse of the above."""
    step = np.exp(2j * np.pi * np.arange(degree) / degree)
    return sum(values[:, None] * signed_power(step, j) for j, values in found.items())


def is_paired(field: RosyField) -> bool:
    """Whether each direction has an opposite one, so that two of them share a line."""
    return field.degree % 2 == 0 and not any(j % 2 for j in harmonics(field))


def tensor_field(surface: Surface, tensors: np.ndarray) -> RosyField:
    """The eigenvectors of symmetric tensors, projected to the faces: a field of degree 4.

    Parameters
    ----------
    surface : Surface
    tensors : (F, 3, 3) float64 ndarray
        Symmetric, object space.

    Returns
    -------
    RosyField
        The stored member is the major eigenvector (of the greater signed eigenvalue), lengths are
        the absolute eigenvalues; `families` 2. Zero where they are equal.
    """
    x, y = face_frames(surface)
    a = np.einsum("fi,fij,fj->f", x, tensors, x)
    b = np.einsum("fi,fij,fj->f", x, tensors, y)
    c = np.einsum("fi,fij,fj->f", y, tensors, y)
    mean, deviator = (a + c) / 2, (a - c) / 2 + 1j * b
    amount = np.abs(deviator)
    angle = np.angle(deviator) / 2
    # An eigenvalue of nearly 0 still has a direction.
    most = np.maximum(np.abs(mean) + amount, 1e-300)
    major = np.maximum(np.abs(mean + amount), 1e-3 * most)
    minor = np.maximum(np.abs(mean - amount), 1e-3 * most)
    rho = np.where(amount > 1e-9 * most, (major + minor) / 2, 0)
    vectors = rho[:, None] * (np.cos(angle)[:, None] * x + np.sin(angle)[:, None] * y)
    share = np.where(rho > 0, major / np.where(rho > 0, rho, 1), 1)
    deviations = np.stack([share, 2 - share, share, 2 - share], axis=1).astype(np.complex128)
    return RosyField(4, vectors, deviations, 2)


def slips(surface: Surface, field: RosyField) -> tuple[np.ndarray, np.ndarray]:
    """The matching: which member goes over into which, across each inner edge.

    Returns
    -------
    faces : (I, 2) int32 ndarray
    slip : (I,) int32 ndarray
        Member k of the first face goes over into member k + slip, modulo N, of the second: into
        the nearest, the two faces unfolded. Members are counted counter-clockwise from the stored
        ones, directions likewise.
    """
    x, y = face_frames(surface)
    edges = surface_edges(surface.corner_vertex, surface.face_start)
    a, b = edges.sides[:, 0], edges.sides[:, 1]
    one = to_representation(field.vectors, x, y, 1)
    z = to_representation(field.vectors, x, y, field.degree)
    nearest = matching_angles(surface, x, y, z, field.degree, a, b)
    stored = matching_angles(surface, x, y, one, 1, a, b)
    slip = np.rint((nearest - stored) * field.degree / (2 * np.pi)).astype(np.int32) % field.degree
    return np.stack([surface.corner_face[a], surface.corner_face[b]], axis=1), slip


def evaluate(coefficients: Sequence[tuple[int, np.ndarray]], member: np.ndarray) -> np.ndarray:
    """(...) complex delta at unit members, from pairs of j and C_j in the same frame."""
    return sum(values * signed_power(member, j) for j, values in coefficients)
