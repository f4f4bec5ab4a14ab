"""Fields made of other fields: another degree, turned, smoothed, with other magnitudes."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ..errors import RosyError
from ..progress import Work, drain
from .connection import connect, laplacian
from .directions import slips
from .frames import unit
from .generate import curvature_magnitude
from .guided import solve
from .representation import complex_sums, face_frames, from_representation, to_representation
from .rosy_field import RosyField, check_degree
from .smoothest import corner_turns, sum_on_faces
from .sparse import from_entries
from .surface import Surface, connected


@dataclass(frozen=True, eq=False)
class Conversion:
    """What a field is converted to, in this order.

    Attributes
    ----------
    degree : int or None
        A multiple or a divisor of the field's.
    turn : float
        Radians.
    smooth : float
        Over which share of the surface's size it diffuses.
    magnitude : str, (F,) ndarray or None
        One of `generate.MAGNITUDES`, or values.
    """

    degree: int | None = None
    turn: float = 0.0
    smooth: float = 0.0
    magnitude: str | np.ndarray | None = None


def convert(surface: Surface, field: RosyField, conversion: Conversion) -> RosyField:
    """Convert a field; see `converting`."""
    return drain(converting(surface, field, conversion))


def converting(surface: Surface, field: RosyField, conversion: Conversion) -> Work[RosyField]:
    """Convert a field: what a conversion leaves out stays as it is."""
    if conversion.degree is not None:
        field = to_degree(surface, field, conversion.degree)
    if conversion.turn:
        field = turned(surface, field, conversion.turn)
    if conversion.smooth:
        field = yield from smoothing(surface, field, (conversion.smooth * surface.size) ** 2)
    magnitude = conversion.magnitude
    if isinstance(magnitude, str):
        magnitude = curvature_magnitude(surface, magnitude)
    return field if magnitude is None else with_magnitude(field, magnitude)


def to_degree(surface: Surface, field: RosyField, degree: int) -> RosyField:
    """A field of a multiple or a divisor of a field's degree.

    A member of degree N is one of a multiple of N, too. Of a divisor each member belongs to one of
    several fields, of which one is followed from face to face as far as it goes: where it comes
    back to a face as another one, around a singularity, a seam stays.

    Parameters
    ----------
    surface : Surface
    field : RosyField
        A RoSy.
    degree : int

    Raises
    ------
    RosyError
        If it is neither a multiple nor a divisor, or the field's directions are no RoSy.
    """
    degree = check_degree(degree)
    _check_rosy(surface, field)
    if degree % field.degree == 0:
        return RosyField(degree, field.vectors)
    if field.degree % degree:
        raise RosyError(
            f"{surface.name}: degree {degree} is neither a multiple nor a divisor of {field.degree}"
        )
    return RosyField(degree, combed(surface, field, field.degree // degree))


def combed(surface: Surface, field: RosyField, kinds: int) -> np.ndarray:
    """(F, 3) the stored members chosen so that they go over into each other.

    Parameters
    ----------
    surface : Surface
    field : RosyField
    kinds : int
        Members whose numbers are the same modulo this are as good as each other; a divisor of N.
    """
    faces, slip = slips(surface, field)
    usable = field.vectors.any(axis=1)[faces].all(axis=1)
    one, other = faces[usable].T
    slip = slip[usable]
    here = np.concatenate([one, other])
    there = np.concatenate([other, one])
    # The chosen member k of `here` goes over into k + slip of `there`.
    step = np.concatenate([slip, -slip])
    order = np.argsort(here, kind="stable")
    here, there, step = here[order], there[order], step[order]
    start = np.searchsorted(here, np.arange(surface.face_count + 1))
    # From one face of each connected piece on, ring by ring.
    number = np.full(surface.face_count, -1)
    piece = connected(surface.face_count, np.stack([one, other], axis=1))
    front = np.unique(piece, return_index=True)[1]
    number[front] = 0
    while len(front):
        count = start[front + 1] - start[front]
        entry = np.repeat(start[front] - np.cumsum(count) + count, count)
        entry += np.arange(count.sum())
        entry = entry[number[there[entry]] < 0]
        front, first = np.unique(there[entry], return_index=True)
        entry = entry[first]
        number[front] = (number[here[entry]] + step[entry]) % kinds
    angle = 2 * np.pi * number / field.degree
    return turned(surface, field, angle).vectors


def turned(surface: Surface, field: RosyField, angle: np.ndarray | float) -> RosyField:
    """The field turned counter-clockwise about the normals.

    Parameters
    ----------
    surface : Surface
    field : RosyField
    angle : (F,) ndarray or float
        Radians.
    """
    angle = np.broadcast_to(angle, (len(field.vectors),))[:, None]
    across = np.cross(surface.face_normal, field.vectors)
    return replace(
        field, vectors=np.cos(angle) * field.vectors + np.sin(angle) * across, given=None
    )


def smoothed(surface: Surface, field: RosyField, time: float) -> RosyField:
    """The field after diffusion; see `smoothing`."""
    return drain(smoothing(surface, field, time))


def smoothing(surface: Surface, field: RosyField, time: float) -> Work[RosyField]:
    """Let the representation of a field diffuse for some time.

    One implicit step of Euler's, ``(M + t L) z = M z_0`` with the connection Laplacian L. Opposite
    values cancel: magnitudes fall where the field varied, and singularities of opposite index meet.

    Parameters
    ----------
    surface : Surface
    field : RosyField
        A RoSy.
    time : float
        Blender units squared: what is finer than about the root of it is smoothed away.

    Raises
    ------
    RosyError
        If the field's directions are no RoSy, or the time is not positive.
    """
    _check_rosy(surface, field)
    if not time > 0 or not np.isfinite(time):
        raise RosyError(f"{surface.name}: a diffusion time is above 0, not {time}")
    x, y = face_frames(surface)
    degree = field.degree
    z = to_representation(field.vectors, x, y, degree)
    connection = connect(surface)
    turn = corner_turns(surface, connection, x, y)
    share = np.repeat(connection.area / 3, 3)
    owner = np.repeat(surface.triangle_face, 3)
    back = np.exp(-1j * degree * turn)
    right = complex_sums(connection.node, share * z[owner] * back, connection.count)
    matrix = laplacian(connection, degree)
    mass = np.maximum(connection.mass, 1e-12 * max(float(connection.mass.mean()), 1e-300))
    every = np.arange(connection.count)
    matrix = from_entries(
        np.concatenate([matrix.row, every]),
        np.concatenate([matrix.column, every]),
        np.concatenate([matrix.value * time, mass.astype(np.complex128)]),
        connection.count,
        connection.count,
    )
    found = yield from solve(matrix, right)
    area = np.bincount(surface.triangle_face, connection.area, surface.face_count)
    mean = sum_on_faces(surface, connection, found, turn, degree) / np.where(area > 0, area, 1) / 3
    return RosyField(degree, from_representation(mean, x, y, degree))


def with_magnitude(field: RosyField, magnitude: np.ndarray | float) -> RosyField:
    """The field with other lengths; it stays undefined where it is.

    Parameters
    ----------
    field : RosyField
    magnitude : (F,) ndarray or float
        Not negative.
    """
    magnitude = np.broadcast_to(magnitude, (len(field.vectors),))[:, None]
    return replace(field, vectors=unit(field.vectors) * magnitude, given=None)


def _check_rosy(surface: Surface, field: RosyField) -> None:
    if field.deviations is not None:
        raise RosyError(f"{surface.name}: the directions of its field are no RoSy")
