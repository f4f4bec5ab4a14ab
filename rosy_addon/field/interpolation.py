"""Interpolate between two fields, on meshes with the same polygons."""

import numpy as np

from ..core.errors import RosyError
from .directional_field import closest_rosy, direction_coordinates
from .representation import face_representation, from_representation
from .rosy_field import RosyField
from .surface import Surface


def interpolate_fields(
    first: tuple[Surface, RosyField],
    second: tuple[Surface, RosyField],
    share: float,
    surface: Surface,
) -> RosyField:
    """Return the field at a given share of the way between two fields of the same degree.

    RoSy fields are interpolated by their representations z = rho exp(i N t) in `Surface.face_frames`: the
    result has the directions of (1 - s) z + s z'. So each member turns by at most pi / N, to the nearest
    member of the second field. Singularities move continuously if the magnitude of the fields vanishes at
    them.

    Where members turn by nearly pi / N, the shorter turn may be to the left on one face and to the right on
    the next one. If angles were interpolated, the directions of these two faces would differ by up to
    pi / N during most of the interpolation. With the linear interpolation of z, each face keeps nearly its
    first direction, and then changes to the second one within a short range of s. For turns up to a quarter
    of 2 pi / N, the two interpolations differ by less than 4 / N degrees.

    Magnitudes are interpolated linearly. Where the phase of z turns by more than pi / 2, the direction is
    uncertain, so the magnitude is at most sqrt(2) times the modulus of (1 - s) z + s z'.

    In two cases, each direction is interpolated separately: if a field is not a RoSy, and if its directions
    form separate families, such as the major and minor directions of a tensor field. The directions of the
    two fields are matched so that families are kept, and so that they rotate least.

    Parameters
    ----------
    first, second : (Surface, RosyField)
        The two fields with their meshes, which have the same polygons.
    share : float
        s: 0 for the first field, 1 for the second field.
    surface : Surface
        The mesh with interpolated positions. The returned field lies on it.

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
    x, y = surface.face_frames
    if all(is_plain(field) for _, field in (first, second)):
        z = _between(*(face_representation(*pair) for pair in (first, second)), share)
        return RosyField(degree, from_representation(z, x, y, degree))
    family_count = min(field.family_count for _, field in (first, second))
    start, stop = (direction_coordinates(*pair) for pair in (first, second))
    angle, rho, ratios = closest_rosy(_between(start, _matched(start, stop, family_count), share))
    vectors = rho[:, None] * (np.cos(angle)[:, None] * x + np.sin(angle)[:, None] * y)
    return RosyField(degree, vectors, ratios, family_count)


def is_plain(field: RosyField) -> bool:
    """Return whether a field is a RoSy whose members do not form separate families."""
    return field.direction_ratios is None and field.family_count == 1


def _between(first: np.ndarray, second: np.ndarray, share: float) -> np.ndarray:
    """Interpolate complex numbers: the phase of the linear interpolation, and a larger modulus.

    `first` and `second` have the same shape, and `share` is 0 for the first and 1 for the second. The modulus
    is the linear interpolation of the two moduli, but at most sqrt(2) times the modulus of the linear
    interpolation.
    """
    z = (1 - share) * first + share * second
    modulus = np.abs(z)
    linear = (1 - share) * np.abs(first) + share * np.abs(second)
    # In the middle of a quarter turn, `modulus` is `linear` times the square root of 1/2.
    wanted = np.minimum(linear, np.sqrt(2) * modulus)
    return z * np.divide(wanted, modulus, out=np.zeros_like(modulus), where=modulus > 0)


def _matched(first: np.ndarray, second: np.ndarray, family_count: int) -> np.ndarray:
    """Return the (F, N) directions of the second field in the order in which they match the first field best.

    `first` and `second` hold the (F, N) directions as complex numbers in `Surface.face_frames`. The
    directions of a face are shifted cyclically by a multiple of `family_count`, so that each direction keeps
    its family.
    """
    best, best_order = second, np.full(len(second), -np.inf)
    for shift in range(0, first.shape[1], family_count if family_count > 1 else 1):
        rolled = np.roll(second, -shift, axis=1)
        order = (first * rolled.conj()).real.sum(axis=1)
        is_better = order > best_order
        best = np.where(is_better[:, None], rolled, best)
        best_order = np.where(is_better, order, best_order)
    return best
