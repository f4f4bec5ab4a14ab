"""Surfaces and their fields as a device takes them: corners to draw, and a record a triangle."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..errors import RosyError
from ..field.directions import harmonics
from ..field.frames import transformed
from ..field.rosy_field import RosyField
from ..field.surface import Surface
from ..progress import drain
from ..projection.carried import SIMILAR, Carried, Trait, carrying, order_of
from ..projection.tone import Pyramid, SurfaceTone

#: Texels of a row of the texture of records, and their number's bits.
ROW_BITS = 13
ROW = 1 << ROW_BITS

#: Triangles of a body: their numbers go through single precision.
MOST_TRIANGLES = 1 << 24

#: Texels of a record: three places, three normals, two of the representation; a trait has two more,
#: a tone of the surface's own two, and the last one belongs to the places at rest.
PLACES, NORMALS, VALUES = 0, 3, 6


@dataclass(frozen=True, eq=False)
class Shape:
    """A surface that a device can draw, without where it stands.

    Attributes
    ----------
    corners : (3 T, 4) float32 ndarray
        Place of each corner of each triangle, and the triangle's number.
    centre : (3,) float64 ndarray
        Relative to which all places are, so that those far from the origin lose no digits.
    records : (rows, ROW, 4) float32 ndarray or None
        What the pixels of a triangle are computed from, `texels` in a row each: see `_records`.
        None without a field.
    texels : int
        Of a record.
    bounds : (8, 3) float64 ndarray
        Corners of the box around it.
    toned : bool
        Whether the records say what tone it has of its own.
    """

    corners: np.ndarray
    centre: np.ndarray
    records: np.ndarray | None
    texels: int
    bounds: np.ndarray
    toned: bool = False

    @property
    def traits(self) -> int:
        """How many its field has."""
        return max(self.texels - texels_of(0, self.toned), 0) // 2


def placement(matrix: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """What of a body's place has a say in its shape, and what merely moves it.

    Parameters
    ----------
    matrix : (4, 4) ndarray
        Object to world space.

    Returns
    -------
    linear : (3, 3) ndarray
        The identity if the matrix does no more than turn, scale and shift: things that are moved
        keep their shapes.
    moving : (4, 4) ndarray
        A rotation, a scale and a shift.
    """
    matrix = np.asarray(matrix, dtype=np.float64)
    linear = matrix[:3, :3]
    square = linear.T @ linear
    scale = np.trace(square) / 3
    mirrored = np.cross(linear[0], linear[1]) @ linear[2] <= 0
    if mirrored or np.abs(square - scale * np.eye(3)).max() > SIMILAR * scale:
        moving = np.eye(4)
        moving[:3, 3] = matrix[:3, 3]
        return linear, moving
    return np.eye(3), matrix


def shifting(vector: np.ndarray) -> np.ndarray:
    """(4, 4) the matrix that shifts by a vector."""
    matrix = np.eye(4)
    matrix[:3, 3] = vector
    return matrix


def traits_of(field: RosyField) -> list[Trait]:
    """What a field has besides the representation."""
    found: list[Trait] = [("deviation", j) for j in harmonics(field)]
    if field.families > 1:
        found.append(("family", field.families))
    return found


def shape_of(
    surface: Surface,
    linear: np.ndarray,
    field: RosyField | None,
    display: str,
    layers: Sequence[Trait] = (),
    tone: SurfaceTone | None = None,
) -> Shape:
    """A surface and its field as a device takes them.

    Parameters
    ----------
    surface : Surface
    linear : (3, 3) ndarray
        Of `placement`.
    field : RosyField or None
        None for what only hides others.
    display : {"smooth", "flat"}
    layers : sequence of Trait
        What each layer of the image of traits holds: that of all fields of this degree.
    tone : SurfaceTone, optional
        Of the surface's own.

    Raises
    ------
    RosyError
        If it has more than `MOST_TRIANGLES`.
    """
    if field is not None and len(surface.triangles) > MOST_TRIANGLES:
        raise RosyError(
            f"{surface.name}: {len(surface.triangles)} triangles are more than the "
            f"{MOST_TRIANGLES} that are drawn on a graphics card"
        )
    points = transformed(np.ascontiguousarray(surface.vertices.T), linear)
    used = np.zeros(points.shape[1], dtype=bool)
    used[surface.triangle_vertex] = True
    bounds = _box(points[:, used])
    centre = bounds.mean(axis=0)
    points -= centre[:, None]
    places = points.astype(np.float32).take(surface.triangle_vertex, axis=1)
    count = places.shape[1]
    corners = np.empty((count, 3, 4), dtype=np.float32)
    corners[:, :, :3] = places.transpose(1, 2, 0)
    corners[:, :, 3] = np.arange(count, dtype=np.float32)[:, None]
    records, texels = None, 0
    if field is not None:
        matrix = np.eye(4)
        matrix[:3, :3] = linear
        carried = drain(carrying(surface, matrix, field, display))
        rest = surface.vertices if surface.rest is None else surface.rest
        rest = rest.take(surface.triangle_vertex, axis=0)
        values = None if tone is None else tone.values[surface.triangles]
        records = _records(corners, rest, carried, field.degree, layers, values)
        texels = records.shape[1]
        records = _in_rows(records)
    toned = field is not None and tone is not None
    return Shape(corners.reshape(-1, 4), centre, records, texels, bounds - centre, toned)


def _records(
    corners: np.ndarray,
    rest: np.ndarray,
    carried: Carried,
    degree: int,
    layers: Sequence[Trait],
    tone: np.ndarray | None,
) -> np.ndarray:
    """(T, texels, 4) float32.

    Texels 0 to 2 are the places of the corners, 3 to 5 the normals there, 6 and 7 the values of the
    representation there as `Carried.z` has them, with the power of the frame that they turn with;
    then two texels a trait, with its power and its layer. With (T, 3, 1 or 2) values of a tone there
    are two texels for them, each corner's beside the next one's. The (T, 3, 3) places of the corners at
    rest have the fourth numbers of places (x) and normals (y), and the last texel (z).
    """
    texels = texels_of(len(layers), tone is not None)
    records = np.zeros((len(corners), texels, 4), dtype=np.float32)
    records[:, PLACES:NORMALS, 3], records[:, NORMALS:VALUES, 3] = rest[..., 0], rest[..., 1]
    records[:, -1, :3] = rest[..., 2]
    records[:, PLACES:NORMALS, :3] = corners[:, :, :3]
    records[:, NORMALS:VALUES, :3] = carried.normal.transpose(2, 0, 1)
    _put_values(records, VALUES, carried.z, degree, 0)
    for layer, trait in enumerate(layers):
        # A RoSy deviates from itself by the factor 1.
        usual = np.full_like(carried.z, 1 if trait == ("deviation", 0) else 0)
        values = carried.traits.get(trait, usual)
        _put_values(records, VALUES + 2 + 2 * layer, values, order_of(trait, degree), layer)
    if tone is not None:
        for corner in range(3):
            texel, column = texels - 3 + corner // 2, corner % 2 * 2
            records[:, texel, column : column + tone.shape[2]] = tone[:, corner]
    return records


def texels_of(traits: int, toned: bool = False) -> int:
    """Of a record with so many traits, and with a tone or without."""
    return VALUES + 2 * (1 + traits) + 2 * toned + 1


def _put_values(records: np.ndarray, at: int, values: np.ndarray, order: int, layer: int) -> None:
    for corner, z in enumerate(values):
        texel, column = at + corner // 2, corner % 2 * 2
        records[:, texel, column], records[:, texel, column + 1] = z.real, z.imag
    records[:, at + 1, 2], records[:, at + 1, 3] = order, layer


def _in_rows(records: np.ndarray) -> np.ndarray:
    """(rows, ROW, 4): the same numbers as a picture."""
    flat = records.reshape(-1, 4)
    rows = np.zeros((max(-(-len(flat) // ROW), 1) * ROW, 4), dtype=np.float32)
    rows[: len(flat)] = flat
    return rows.reshape(-1, ROW, 4)


def _box(points: np.ndarray) -> np.ndarray:
    """(8, 3) corners of the box around (3, V) points."""
    ends = np.stack([points.min(axis=1), points.max(axis=1)])
    which = np.indices((2, 2, 2)).reshape(3, 8)
    return np.stack([ends[which[axis], axis] for axis in range(3)], axis=1)


def atlas_of(pyramid: Pyramid, most: int) -> tuple[np.ndarray, tuple[int, int], int]:
    """An image of all sizes as one: its halves are on its right, on top of each other.

    Parameters
    ----------
    pyramid : Pyramid
    most : int
        Sizes with more pixels along a side are left out.

    Returns
    -------
    texels : (h, w, 4) float32 ndarray
        The values in the first channel.
    size : (int, int)
        Width and height of the largest.
    halved : int
        How often that is halved.
    """
    levels = [level for level in pyramid.levels if max(level.shape) <= most]
    height, width = levels[0].shape
    tall = max(height, sum(len(level) for level in levels[1:]))
    wide = width + (levels[1].shape[1] if len(levels) > 1 else 0)
    texels = np.zeros((tall, wide, 4), dtype=np.float32)
    texels[:height, :width, 0] = levels[0]
    low = 0
    for level in levels[1:]:
        texels[low : low + len(level), width : width + level.shape[1], 0] = level
        low += len(level)
    return texels, (width, height), len(levels) - 1
