"""Vertex buffers and triangle records: a surface and its field in the layout of the shaders."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from ..compositor.color_values import ValueRange, value_range
from ..core.errors import RosyError
from ..field.blocks import row_blocks
from ..field.frames import transform_components
from ..field.polygon_arrays import box_corners
from ..field.rosy_field import RosyField
from ..field.symmetry import FieldSymmetry
from ..projection.corner_field import CornerField, field_at_corners
from ..projection.face_values import relative_channels, similarity_scale
from ..projection.field_channel import FieldChannel, rotation_order
from ..projection.gbuffer import MeshInstance
from ..projection.rest_coordinates import rest_positions
from ..projection.surface_tone import MipMap

#: Exponent of the number of texels in a row of the record texture, a power of two (`ROW_TEXELS`).
ROW_BITS = 13
ROW_TEXELS = 1 << ROW_BITS

#: Number of triangles whose records are written at once. More would not fit the processor's cache.
RECORDS_PER_BLOCK = 1 << 17

#: Maximum triangles of a mesh: shaders handle their ids in single precision.
MAX_TRIANGLES = 1 << 24

#: First texels of the positions, normals, magnitudes and representation in a record. A record has 3 texels of
#: positions, 3 of normals, 1 of magnitudes, 2 of the representation, 2 for each further channel, 1 of the
#: values for the color map if there are any, 2 of the tone if there is one, and a last one for z of the rest
#: positions.
POSITION_TEXEL, NORMAL_TEXEL, MAGNITUDE_TEXEL, VALUE_TEXEL = 0, 3, 6, 7


@dataclass(frozen=True, eq=False)
class MeshBuffers:
    """A surface in the layout of the shaders. Its rotation, uniform scale and translation are not applied.

    Attributes
    ----------
    corners : (3 T, 4) float32 ndarray
        Position of each corner of each triangle relative to `center`, and the id of the triangle.
    center : (3,) float64 ndarray
        Origin of all positions, so that surfaces far from the origin keep their precision.
    bounds : (8, 3) float64 ndarray
        Corners of the bounding box, relative to `center`.
    triangle_records : (rows, ROW_TEXELS, 4) float32 ndarray or None
        The record of each triangle: `texels_per_record` consecutive texels, see
        `_write_records`. None without a field.
    texels_per_record : int
        Number of texels in the record of a triangle.
    channel_count : int
        Number of channels of the field besides its representation.
    has_tone : bool
        Whether the records contain a tone of the surface.
    value_range : (float, float) or None
        Range of the surface's values for the color map; see `color_values.value_range`.
    values_texel : int
        The texel of a record that contains these values; -1 if there are none.
    """

    corners: np.ndarray
    center: np.ndarray
    bounds: np.ndarray
    triangle_records: np.ndarray | None = None
    texels_per_record: int = 0
    channel_count: int = 0
    has_tone: bool = False
    value_range: ValueRange = None
    values_texel: int = -1

    @property
    def triangle_count(self) -> int:
        """Number of triangles."""
        return len(self.corners) // 3

    def model_matrix(self, matrix: np.ndarray) -> np.ndarray:
        """Return the (4, 4) map from `corners` to world space, given the map from object space."""
        return split_matrix(matrix)[1] @ translation_matrix(self.center)


def split_matrix(matrix: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Split a matrix into a linear map that changes the shape, followed by a similarity.

    Parameters
    ----------
    matrix : (4, 4) ndarray
        Object to world space.

    Returns
    -------
    linear : (3, 3) ndarray
        The map that changes the shape. It is the identity if the matrix is a similarity, so that a
        mesh that is only moved, rotated or scaled need not be sent to the device again.
    model_matrix : (4, 4) ndarray
        A rotation, a uniform scale and a translation.
    """
    matrix = np.asarray(matrix, dtype=np.float64)
    linear = matrix[:3, :3]
    mirrored = np.cross(linear[0], linear[1]) @ linear[2] <= 0
    if mirrored or similarity_scale(linear) is None:
        return linear, translation_matrix(matrix[:3, 3])
    return np.eye(3), matrix


def translation_matrix(vector: np.ndarray) -> np.ndarray:
    """Return the (4, 4) matrix of a translation."""
    matrix = np.eye(4)
    matrix[:3, 3] = vector
    return matrix


@dataclass(frozen=True)
class FieldKind:
    """The properties that all fields of one degree share in shaders, as constants.

    Attributes
    ----------
    degree : int
        N.
    channels : tuple of FieldChannel
        Layers of the image of field channels: the harmonics of the deviation from a RoSy (see
        `field.directional_field`) of all orders from the first to the last, then the families.
    symmetry : FieldSymmetry
    """

    degree: int
    channels: tuple[FieldChannel, ...]
    symmetry: FieldSymmetry

    @property
    def harmonic_orders(self) -> list[int]:
        """Orders j of the harmonics in the first layers. Harmonics that no field has are 0 there."""
        return [order for kind, order in self.channels if kind == "deviation"]

    @property
    def line_count(self) -> int:
        """M, the number of line directions at a pixel; opposite members of the field share a line."""
        return self.symmetry.line_count

    @property
    def family_count(self) -> int:
        """Number of families of labeled directions; 1 if the directions have no labels."""
        return self.channels[-1][1] if self.channels and self.channels[-1][0] == "family" else 1


def field_kinds(fields: Iterable[RosyField]) -> dict[int, FieldKind]:
    """Return a dict from each degree to its `FieldKind`, with the channels of all fields of this degree."""
    channels: dict[int, list[FieldChannel]] = {}
    for field in fields:
        channels.setdefault(field.degree, []).extend(relative_channels(field))
    return {degree: _field_kind(degree, found) for degree, found in sorted(channels.items())}


def _field_kind(degree: int, channels: Sequence[FieldChannel]) -> FieldKind:
    """Return the kind of fields with these channels.

    Harmonics between those of `channels` are added, so that their orders have no gaps. Of channels of
    families, only the first one is kept.
    """
    orders = [order for kind, order in channels if kind == "deviation"]
    all_orders = range(min(orders, default=0), max(orders, default=-1) + 1)
    ordered: list[FieldChannel] = [("deviation", order) for order in all_orders]
    ordered += [channel for channel in channels if channel[0] == "family"][:1]
    # The symmetry depends on the harmonics that exist, not on those that fill gaps.
    return FieldKind(degree, tuple(ordered), FieldSymmetry(degree, tuple(orders)))


def mesh_buffers(
    instance: MeshInstance, display: str, channels: Sequence[FieldChannel] = ()
) -> MeshBuffers:
    """Return a surface with its field, tone and values for the color map in the layout of the shaders.

    Parameters
    ----------
    instance : MeshInstance
        The linear part of its matrix, from `split_matrix`, is applied.
    display : {"smooth", "flat"}
        Shading of the surface; see `Look.display`.
    channels : sequence of FieldChannel
        The channel in each layer of the image of field channels, the same for all fields of this degree.

    Raises
    ------
    RosyError
        If the surface has more than `MAX_TRIANGLES`.
    """
    surface, field = instance.surface, instance.field
    if field is not None and len(surface.triangles) > MAX_TRIANGLES:
        raise RosyError(
            f"{surface.name}: has {len(surface.triangles)} triangles, but the graphics card draws at "
            f"most {MAX_TRIANGLES}: choose the processor"
        )
    linear, _ = split_matrix(instance.matrix)
    points = transform_components(np.ascontiguousarray(surface.vertices.T), linear)
    bounds = box_corners(points[:, surface.used_vertices].T)
    center = bounds.mean(axis=0)
    points -= center[:, None]
    positions = points.astype(np.float32).take(surface.triangle_vertex, axis=1)
    count = positions.shape[1]
    corners = np.empty((count, 3, 4), dtype=np.float32)
    corners[:, :, :3] = positions.transpose(1, 2, 0)
    corners[:, :, 3] = np.arange(count, dtype=np.float32)[:, None]
    arrays = corners.reshape(-1, 4), center, bounds - center
    if field is None:
        return MeshBuffers(*arrays)
    corner_field = field_at_corners(surface, linear, field, display)
    has_tone, color_values = instance.tone is not None, instance.color_values
    texels = record_texels(len(channels), has_tone, color_values is not None)
    rows, records = empty_records(count, texels)
    _write_records(records, corners, instance, corner_field, channels)
    values = () if color_values is None else (value_range(color_values), _values_texel(channels))
    return MeshBuffers(*arrays, rows, texels, len(channels), has_tone, *values)


def empty_records(count: int, texels: int) -> tuple[np.ndarray, np.ndarray]:
    """Return new rows of the record texture, all zero, and a (count, texels, 4) view of the same memory.

    `count` is the number of records, and `texels` the number of texels in each.
    """
    row_count = max(-(-count * texels // ROW_TEXELS), 1)
    flat = np.zeros((row_count * ROW_TEXELS, 4), dtype=np.float32)
    return flat.reshape(row_count, ROW_TEXELS, 4), flat[: count * texels].reshape(count, texels, 4)


def _write_records(
    records: np.ndarray,
    corners: np.ndarray,
    instance: MeshInstance,
    corner_field: CornerField,
    channels: Sequence[FieldChannel],
) -> None:
    """Fill the (T, texels, 4) float32 records, block by block of triangles.

    Texels 0 to 2 are the positions of the corners, 3 to 5 the normals there. Texel 6 has
    `CornerField.magnitude`. Texels 7 and 8 contain `CornerField.representation`, and each channel has two
    further texels: six components are the real and imaginary parts at the three corners, the seventh is the
    result of `field_channel.rotation_order`, and the eighth is the layer of the channel (0 for the
    representation). The three values for the color map have one texel. Its last component is 1 if all three
    values are finite. The `SurfaceTone.values` at the corners have two texels: two components per corner.
    Of the `rest_positions`, x is in the fourth components of the positions, y in the fourth components of the
    normals, and z in the last texel. `corners` has the rows of `MeshBuffers.corners`, as (T, 3, 4).
    """
    surface, tone, color_values = instance.surface, instance.tone, instance.color_values
    rest, degree = rest_positions(surface), corner_field.degree
    channel_values = [corner_field.channels.get(channel) for channel in channels]
    for extent in row_blocks(len(records), RECORDS_PER_BLOCK):
        part = records[extent]
        rest_corners = rest.take(surface.triangle_vertex[extent], axis=0)
        part[:, POSITION_TEXEL:NORMAL_TEXEL, :3] = corners[extent, :, :3]
        part[:, POSITION_TEXEL:NORMAL_TEXEL, 3] = rest_corners[..., 0]
        normals = corner_field.corner_normals[..., extent]
        part[:, NORMAL_TEXEL:MAGNITUDE_TEXEL, :3] = normals.transpose(2, 0, 1)
        part[:, NORMAL_TEXEL:MAGNITUDE_TEXEL, 3] = rest_corners[..., 1]
        part[:, MAGNITUDE_TEXEL, :3] = corner_field.magnitude[:, extent].T
        part[:, -1, :3] = rest_corners[..., 2]
        _write_values(part, VALUE_TEXEL, corner_field.representation[:, extent], degree, 0)
        for layer, (channel, values) in enumerate(zip(channels, channel_values, strict=True)):
            # A RoSy has the constant harmonic 1.
            default = np.complex64(1 if channel == ("deviation", 0) else 0)
            part_values = (default,) * 3 if values is None else values[:, extent]
            texel = VALUE_TEXEL + 2 + 2 * layer
            _write_values(part, texel, part_values, rotation_order(channel, degree), layer)
        if color_values is not None:
            texel, numbers = _values_texel(channels), color_values[surface.triangles[extent]]
            known = np.isfinite(numbers).all(axis=1)
            part[known, texel, :3] = numbers[known]
            part[:, texel, 3] = known
        if tone is not None:
            for corner, triangle_corner in enumerate(surface.triangles[extent].T):
                texel, column = records.shape[1] - 3 + corner // 2, corner % 2 * 2
                values = tone.values[triangle_corner]
                part[:, texel, column : column + values.shape[1]] = values


def record_texels(channel_count: int, has_tone: bool = False, has_values: bool = False) -> int:
    """Return the number of texels in the record of a triangle; see `_write_records`."""
    return VALUE_TEXEL + 2 * (1 + channel_count) + has_values + 2 * has_tone + 1


def _values_texel(channels: Sequence[FieldChannel]) -> int:
    """Return the texel of a record that contains the values for the color map, if the mesh has values."""
    return record_texels(len(channels)) - 1


def _write_values(
    records: np.ndarray, first_texel: int, values: Sequence[np.ndarray], order: int, layer: int
) -> None:
    for corner, z in enumerate(values):
        texel, column = first_texel + corner // 2, corner % 2 * 2
        records[:, texel, column], records[:, texel, column + 1] = z.real, z.imag
    records[:, first_texel + 1, 2], records[:, first_texel + 1, 3] = order, layer


def to_texture_rows(values: np.ndarray) -> np.ndarray:
    """Return (n, k) values as (rows, ROW_TEXELS, 4) float32: the first k components of n texels.

    All other components are 0.
    """
    rows, texels = empty_records(len(values), 1)
    texels[:, 0, : values.shape[1]] = values
    return rows


def mip_atlas(mip_map: MipMap, max_side: int) -> tuple[np.ndarray, tuple[int, int], int]:
    """Return all levels of a mip map in one image: smaller levels are stacked on the right of level 0.

    Parameters
    ----------
    mip_map : MipMap
    max_side : int
        Levels with a side of more pixels are left out. The largest other level becomes level 0 of the image.

    Returns
    -------
    texels : (h, w, 4) float32 ndarray
        Image with the values in the first channel.
    size : (int, int)
        Width and height of level 0.
    max_level : int
        Number of the smallest level in the image, counted from its level 0.
    """
    levels = [level for level in mip_map.levels if max(level.shape) <= max_side]
    height, width = levels[0].shape
    atlas_height = max(height, sum(len(level) for level in levels[1:]))
    atlas_width = width + (levels[1].shape[1] if len(levels) > 1 else 0)
    texels = np.zeros((atlas_height, atlas_width, 4), dtype=np.float32)
    texels[:height, :width, 0] = levels[0]
    row = 0
    for level in levels[1:]:
        texels[row : row + len(level), width : width + level.shape[1], 0] = level
        row += len(level)
    return texels, (width, height), len(levels) - 1
