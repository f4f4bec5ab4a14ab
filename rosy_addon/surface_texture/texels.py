"""Find the texels of a UV map, the points of the surface that they show, and the margin around charts.

A map may have several tiles, which are unit squares of the UV plane. The texels of all tiles are in one
frame, an array of rows and columns. The tiles of a UDIM texture are stacked in it. Other textures repeat, so
all their tiles are in the same part of the frame.

Filters of the texture also read texels around charts: the margin. The texels next to a chart
show the surface beyond the seam, so that no seam is visible where texels are interpolated. Farther texels
repeat the nearest color. They are visible only in smaller mipmap levels of the texture.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ..compositor.covering import ALL_NEIGHBORS
from ..compositor.pixel_field import NEIGHBOR_OFFSETS, PixelField
from ..core.cache import Cache
from ..core.errors import RosyError
from ..core.progress import progress, report
from ..field.blocks import bincount_rows, mask
from ..line_drawing.tangent_mesh import TangentMesh
from ..projection.gbuffer import MeshInstance
from ..projection.rasterizer import rasterize
from .charts import UvCharts

#: Largest number of tiles of a UV map.
MAX_TILES = 100

#: In the numbering of UDIM, the number of the tile at the origin, the number of tiles in a row, and the number
#: of rows: Blender has tiles from 1001 to 2000.
FIRST_TILE, TILES_PER_ROW, TILE_ROWS = 1001, 10, 100

#: Label of the progress.
LABEL = "finding texels"


@dataclass(frozen=True)
class TextureFrame:
    """The array of rows and columns that holds all texels of a texture.

    Attributes
    ----------
    size : int
        Number of texels on each side of a tile.
    tiles : tuple of (int, int)
        Coordinates u and v of the lower left corners of the tiles that contain a part of a chart.
    is_udim : bool
        Whether each tile has its own picture (UDIM). Otherwise, all tiles show the same picture.
    """

    size: int
    tiles: tuple[tuple[int, int], ...]
    is_udim: bool = False

    @property
    def width(self) -> int:
        """Number of texels in a row."""
        return self.size

    @property
    def height(self) -> int:
        """Number of rows of texels."""
        return self.size * len(self.tiles) if self.is_udim else self.size

    def tile_names(self) -> list[int]:
        """Return the UDIM numbers of the tiles, from the bottom of the frame."""
        return [FIRST_TILE + u + TILES_PER_ROW * v for u, v in self.tiles]

    def first_row(self, tile: int) -> int:
        """Return the lowest row of texels of the tile `tiles[tile]`; the frame holds all tiles on top of each other."""
        return self.size * tile if self.is_udim else 0

    def flat_indices(self, column: np.ndarray, row: np.ndarray) -> np.ndarray:
        """Return (n,) intp: the flat indices in the frame of texels of the UV plane; -1 outside of all tiles.

        Parameters
        ----------
        column, row : (n,) ndarray of int
            Position of each texel, counted from the origin of the UV plane.
        """
        tile_u, in_column = np.divmod(column, self.size)
        tile_v, in_row = np.divmod(row, self.size)
        index = np.full(len(column), -1, dtype=np.intp)
        for number, (u, v) in enumerate(self.tiles):
            inside = (tile_u == u) & (tile_v == v)
            first_row = self.first_row(number)
            index[inside] = (in_row[inside] + first_row) * self.width + in_column[inside]
        return index


@dataclass(frozen=True, eq=False)
class Texels:
    """The P texels whose centers are on the surface, in ascending order.

    Attributes
    ----------
    frame : TextureFrame
    index : (P,) int32 ndarray
        Flat index into the frame, row by row from the lower left.
    triangle : (P,) int32 ndarray
        Triangle of the surface at the center of each texel.
    barycentric : (P, 3) float32 ndarray
        Barycentric coordinates of the center in this triangle.
    overlap : float
        Fraction of the area of all charts that is not shown because other charts overlap it.
    """

    frame: TextureFrame
    index: np.ndarray
    triangle: np.ndarray
    barycentric: np.ndarray
    overlap: float

    def __len__(self) -> int:
        return len(self.index)


class TexelSurface(NamedTuple):
    """A mesh instance, the texels of its UV map, and the length of the steps of streamlines on it.

    Attributes
    ----------
    instance : MeshInstance
    mesh : TangentMesh
        Its triangles in world space, with frames and the field at their corners.
    charts : UvCharts
    texels : Texels
    step : float
        Length of a step of streamlines, in Blender units.
    cache : Cache or None
        Stores evenly spaced lines, which do not depend on the texels.
    """

    instance: MeshInstance
    mesh: TangentMesh
    charts: UvCharts
    texels: Texels
    step: float
    cache: Cache | None = None

    def interpolated(self, vertex_values: np.ndarray, block: slice) -> np.ndarray:
        """Interpolate (V, K) values at vertices to the n texels of a block. The result is (n, K) float32."""
        corners = self.instance.surface.triangle_vertex.take(self.texels.triangle[block], axis=0).T
        total = np.zeros((corners.shape[1], vertex_values.shape[1]), dtype=np.float32)
        for corner, weight in zip(corners, self.texels.barycentric[block].T, strict=True):
            total += weight[:, None] * vertex_values.take(corner, axis=0)
        return total


def texture_frame(charts: UvCharts, size: int, name: str, is_udim: bool = False) -> TextureFrame:
    """Find the tiles that a UV map uses, and return the frame of their texels.

    Parameters
    ----------
    charts : UvCharts
    size : int
        Number of texels on each side of a tile.
    name : str
        Name of the mesh in error messages.
    is_udim : bool
        Whether each tile has its own picture.

    Raises
    ------
    RosyError
        If there are more than `MAX_TILES` tiles or, for UDIM, tiles outside of its numbering.
    """
    uv = charts.uv[charts.gradient.any(axis=1)]
    # Corners on the border between two tiles belong to the tile that contains the triangle.
    low_u, low_v = (np.floor(part.min(axis=1) + 1e-9).astype(int) for part in (uv.real, uv.imag))
    high_u, high_v = (
        np.maximum(np.ceil(part.max(axis=1) - 1e-9).astype(int) - 1, low)
        for part, low in ((uv.real, low_u), (uv.imag, low_v))
    )
    ranges = np.unique(np.stack([low_u, high_u, low_v, high_v], axis=1), axis=0)
    tiles = set()
    for first_u, last_u, first_v, last_v in ranges.tolist():
        count = (last_u - first_u + 1) * (last_v - first_v + 1)
        if count <= MAX_TILES:
            columns, rows = range(first_u, last_u + 1), range(first_v, last_v + 1)
            tiles |= {(u, v) for u in columns for v in rows}
        if max(count, len(tiles)) > MAX_TILES:
            raise RosyError(
                f"{name}: its UV map reaches over more than {MAX_TILES} tiles: scale it to u and v "
                "from 0 to 1"
            )
    if is_udim and not all(0 <= u < TILES_PER_ROW and 0 <= v < TILE_ROWS for u, v in tiles):
        raise RosyError(
            f"{name}: its UV map reaches beyond the tiles that UDIM numbers: move its charts to "
            f"u from 0 to {TILES_PER_ROW} and v from 0 to {TILE_ROWS}"
        )
    return TextureFrame(size, tuple(sorted(tiles, key=lambda tile: tile[::-1])), is_udim)


def rasterize_charts(charts: UvCharts, frame: TextureFrame, name: str) -> Texels:
    """Find the texels whose centers are on the surface, and the point of the surface at each of them.

    Where charts overlap, a texel shows the triangle with the smallest index. Where tiles overlap, it shows
    the first tile. `name` is the name of the mesh in error messages.

    Raises
    ------
    RosyError
        If there is no such texel.
    """
    corners = charts.uv.ravel()
    triangles = np.arange(len(corners), dtype=np.int32).reshape(-1, 3)
    taken = np.zeros(frame.width * frame.height if len(frame.tiles) > 1 else 0, dtype=bool)
    parts = []
    for number, (u, v) in enumerate(frame.tiles):
        start, stop = number / len(frame.tiles), (number + 1) / len(frame.tiles)
        clip = np.zeros((len(corners), 4))
        clip[:, 0], clip[:, 1] = 2 * (corners.real - u) - 1, 2 * (corners.imag - v) - 1
        clip[:, 3] = 1
        reaches = _reaches_tile(clip[:, :2].reshape(-1, 3, 2))
        with progress(start, stop, LABEL):
            fragments = rasterize(clip, triangles[reaches], frame.size, frame.size)
        index = fragments.pixel + np.int32(frame.first_row(number) * frame.width)
        columns = index, reaches[fragments.triangle].astype(np.int32), fragments.barycentric
        if len(taken):
            is_free = ~taken[index]
            columns = tuple(column[is_free] for column in columns)
            taken[columns[0]] = True
        parts.append(columns)
    report(1.0, LABEL)
    index, triangle, barycentric = (np.concatenate(column) for column in zip(*parts, strict=True))
    if not len(index):
        raise RosyError(
            f"{name}: its UV map has no texel: make the texture larger, or unwrap the mesh"
        )
    if len(parts) > 1:
        order = np.argsort(index, kind="stable")
        index, triangle, barycentric = index[order], triangle[order], barycentric[order]
    edge_a, edge_b = charts.uv[:, 1] - charts.uv[:, 0], charts.uv[:, 2] - charts.uv[:, 0]
    area = 0.5 * np.abs((edge_a.conj() * edge_b).imag).sum() * frame.size**2
    overlap = max(0.0, 1 - len(index) / area)
    return Texels(frame, index, triangle, barycentric, overlap)


def _reaches_tile(corners: np.ndarray) -> np.ndarray:
    """Return the indices of triangles that may overlap a tile.

    `corners`, (T, 3, 2), are relative to the center of the tile, in halves of its side.
    """
    low, high = corners.min(axis=1), corners.max(axis=1)
    return np.flatnonzero(((low < 1) & (high > -1)).all(axis=1))


# --- margin ------------------------------------------------------------------------------------------


def fill_margin(
    frame: TextureFrame, field: PixelField, color: np.ndarray, margin: int, crosses_seams: bool
) -> np.ndarray:
    """Return the picture of a texture: the colors of texels, with a margin around charts.

    Parameters
    ----------
    frame : TextureFrame
    field : PixelField
        Field at the P texels of the charts. It holds the links between texels.
    color : (P, K) float32 ndarray
        Colors of the texels, with K channels.
    margin : int
        Width of the margin, in texels.
    crosses_seams : bool
        Whether colors have the same meaning in all charts. Then the texels next to a chart get the colors of
        the surface beyond the seam.

    Returns
    -------
    (H, W, K) float32 ndarray
        Colors of all texels of the frame. Texels that are neither in a chart nor in a margin have the mean
        color.
    """
    height, width, channels = frame.height, frame.width, color.shape[1]
    mean = color.mean(axis=0, dtype=np.float64)
    image = np.full((height, width, channels), mean, dtype=np.float32)
    flat = image.reshape(-1, channels)
    flat[field.pixel] = color
    filled = mask(height * width, field.pixel)
    if not margin:
        return image
    ring = field.pixel[field.neighbor_mask != ALL_NEIGHBORS]
    if crosses_seams:
        outer, values = _beyond_seams(frame, field, color, filled)
        flat[outer] = values
        filled[outer] = True
        ring = np.union1d(ring, outer)
    for number in range(margin):
        report((number + 1) / (margin + 1), "filling the margin")
        ring = _dilate(frame, flat, filled, ring)
    return image


def _beyond_seams(
    frame: TextureFrame, field: PixelField, color: np.ndarray, filled: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Find the empty texels next to charts, and the colors of the surface beyond the seam there.

    Parameters
    ----------
    frame : TextureFrame
    field : PixelField
        Field at the P texels of the charts, with the steps across seams.
    color : (P, K) float32 ndarray
        Colors of these texels.
    filled : (H W,) bool ndarray
        Whether each texel of the frame has a color.

    Returns
    -------
    outer : (n,) intp ndarray
        Flat indices of the empty texels in the frame.
    values : (n, K) float32 ndarray
        Colors for these texels.
    """
    steps = field.seam_steps
    kept = np.flatnonzero(np.isin(steps.bit, (1, 3, 5, 7)))
    dx, dy = np.array(NEIGHBOR_OFFSETS)[steps.bit[kept]].T
    outer = neighbor_places(frame, field.pixel.take(steps.source[kept]), dx, dy)
    empty = (outer >= 0) & ~filled.take(outer)
    kept, outer = kept[empty], outer[empty]
    values = _color_at(field, color, steps.target[kept], steps.offset[kept])
    outer, place, count = np.unique(outer, return_inverse=True, return_counts=True)
    return outer, (bincount_rows(place, values) / count[:, None]).astype(np.float32)


def _color_at(
    field: PixelField, color: np.ndarray, texel: np.ndarray, offset: np.ndarray
) -> np.ndarray:
    """Return (n, K) float32: colors at positions near texels, interpolated linearly between linked neighbors.

    `color`, (P, K), holds the colors of texels. `texel` holds (n,) indices of texels, and `offset` the
    positions relative to the centers of these texels, as complex numbers in texels. Linked neighbors are
    those that streamlines may step to (`field.neighbor_mask`).
    """
    column, row = np.sign(offset.real).astype(np.intp), np.sign(offset.imag).astype(np.intp)
    x, y = np.minimum(np.abs(offset.real), 1), np.minimum(np.abs(offset.imag), 1)
    links = field.neighbor_mask.take(texel)
    total = np.zeros((len(texel), color.shape[1]), dtype=np.float32)
    weights = np.zeros(len(texel), dtype=np.float32)
    neighbor = field.pixel.take(texel) + row * field.width
    # A linked neighbor in the same row is the texel before or after.
    for dx, dy, place, weight in (
        (0 * column, 0 * row, texel, (1 - x) * (1 - y)),
        (column, 0 * row, texel + column, x * (1 - y)),
        (0 * column, row, np.searchsorted(field.pixel, neighbor), (1 - x) * y),
        (column, row, np.searchsorted(field.pixel, neighbor + column), x * y),
    ):
        linked = links >> (dx + 3 * dy + 4).astype(np.uint16) & 1
        weight = (weight + 1e-6) * linked
        total += weight[:, None] * color.take(place, axis=0, mode="clip")
        weights += weight
    return total / weights[:, None]


def _dilate(
    frame: TextureFrame, flat: np.ndarray, filled: np.ndarray, ring: np.ndarray
) -> np.ndarray:
    """Fill empty texels next to filled ones with the mean color of their filled neighbors, in place.

    Parameters
    ----------
    frame : TextureFrame
    flat : (H W, K) float32 ndarray
        Colors of all texels of the frame.
    filled : (H W,) bool ndarray
        Whether each texel has a color.
    ring : (n,) ndarray of int
        Flat indices of filled texels whose empty neighbors are filled.

    Returns
    -------
    (m,) intp ndarray
        Flat indices of the texels that were filled.
    """
    found = []
    for offset in ((1, 0), (-1, 0), (0, 1), (0, -1)):
        index = neighbor_places(frame, ring, *offset)
        index = index[index >= 0]
        index = index[~filled[index]]
        filled[index] = True
        # No index occurs twice: each texel of the ring has another neighbor there.
        found.append(index)
    beside = np.concatenate(found)
    filled[beside] = False
    total = np.zeros((len(beside), flat.shape[1]), dtype=np.float32)
    count = np.zeros(len(beside), dtype=np.float32)
    for offset in NEIGHBOR_OFFSETS:
        neighbor = neighbor_places(frame, beside, *offset)
        weight = (filled.take(neighbor) & (neighbor >= 0)).astype(np.float32)
        total += weight[:, None] * flat.take(neighbor, axis=0)
        count += weight
    flat[beside] = total / count[:, None]
    filled[beside] = True
    return beside


def neighbor_places(frame: TextureFrame, index: np.ndarray, dx: int, dy: int) -> np.ndarray:
    """Return (n,) intp: flat indices of the neighbors of texels at an offset of (dx, dy) texels.

    `index` holds flat indices of texels in the frame. The result is -1 for neighbors outside of the tile.
    """
    row, column = np.divmod(index.astype(np.intp), frame.width)
    column += dx
    row %= frame.size
    row += dy
    inside = (column >= 0) & (column < frame.width) & (row >= 0) & (row < frame.size)
    return np.where(inside, index + dy * frame.width + dx, -1)
