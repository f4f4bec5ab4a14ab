"""Fields between two others, on meshes with the same polygons."""

from __future__ import annotations

import numpy as np

from ..core.errors import RosyError
from .directional_field import closest_rosy, field_directions
from .frames import coordinates
from .representation import face_frames, face_representation, from_representation
from .rosy_field import RosyField
from .surface import Surface


def interpolate_fields(
    first: tuple[Surface, RosyField],
    second: tuple[Surface, RosyField],
    share: float,
    surface: Surface,
) -> RosyField:
    """Return a field between two others of the same degree.

    The direction of a RoSy field is the direction of (1 - s) z + s z', a linear interpolation of the
    representations z = rho exp(i N t) in `face_frames`. Members turn the shorter way. Singularities move, if the
    magnitude vanishes at them.

    Where members turn by nearly pi / N, the shorter way may be to the left on one face and to the right on the
    next one. If angles were interpolated, directions would differ by up to pi / N between these faces for all
    of the time. With the linear interpolation, each face keeps its first direction, then takes the second one
    within a short time. For turns up to a quarter of 2 pi / N, the two interpolations differ by less than
    4 / N degrees.

    Magnitudes are interpolated linearly. They are reduced where the phase of z turns by more than pi / 2, because
    the direction is uncertain there.

    Fields that are not RoSys, and fields with families, such as the fields of tensors, are interpolated direction
    by direction. Among the matchings that keep the families, the one with the least rotation is used.

    Parameters
    ----------
    first, second : (Surface, RosyField)
        The meshes have the same polygons.
    share : float
        s, 0 for the first field and 1 for the second.
    surface : Surface
        The mesh between the two, on which the field is returned.

    Returns
    -------
    RosyField

    Raises
    ------
    RosyError
        If the degrees differ.
    """
    degree = first[1].degree
    if second[1].degree != degree:
        raise RosyError(
            f"{second[0].name}: the field has degree {second[1].degree}, but the one before it {degree}"
        )
    x, y = face_frames(surface)
    if all(is_plain(field) for _, field in (first, second)):
        z = _between(*(face_representation(*pair) for pair in (first, second)), share)
        return RosyField(degree, from_representation(z, x, y, degree))
    family_count = min(field.family_count for _, field in (first, second))
    start, stop = (
        coordinates(field_directions(*pair), *face_frames(pair[0])) for pair in (first, second)
    )
    angle, rho, ratios = closest_rosy(_between(start, _matched(start, stop, family_count), share))
    vectors = rho[:, None] * (np.cos(angle)[:, None] * x + np.sin(angle)[:, None] * y)
    return RosyField(degree, vectors, ratios, family_count)


def is_plain(field: RosyField) -> bool:
    """Return whether a field is a RoSy whose stored member may be any of them."""
    return field.direction_ratios is None and field.family_count == 1


def _between(first: np.ndarray, second: np.ndarray, share: float) -> np.ndarray:
    """Interpolate complex numbers as in `interpolate_fields`."""
    z = (1 - share) * first + share * second
    modulus = np.abs(z)
    linear = (1 - share) * np.abs(first) + share * np.abs(second)
    # The ratio of the two is the square root of 1/2 in the middle of a quarter turn.
    wanted = np.minimum(linear, np.sqrt(2) * modulus)
    return z * np.divide(wanted, modulus, out=np.zeros_like(modulus), where=modulus > 0)


def _matched(first: np.ndarray, second: np.ndarray, family_count: int) -> np.ndarray:
    """Return the (F, N) directions of the second field in the order of the first ones that are nearest.

    Directions move by a multiple of the number of families, so that each stays on a line of its family.
    """
    best, best_order = second, np.full(len(second), -np.inf)
    for shift in range(0, first.shape[1], family_count if family_count > 1 else 1):
        rolled = np.roll(second, -shift, axis=1)
        order = (first * rolled.conj()).real.sum(axis=1)
        is_better = order > best_order
        best = np.where(is_better[:, None], rolled, best)
        best_order = np.where(is_better, order, best_order)
    return best
