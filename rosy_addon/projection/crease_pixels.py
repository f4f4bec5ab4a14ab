"""The pixels at which a line segment in space is visible, such as an edge of a crease."""

from collections.abc import Iterator

import numpy as np

from ..field.blocks import blocks_of_ranges
from ..field.frames import transformed
from .camera import Camera
from .gbuffer import GBuffer
from .pixel_blocks import reported_blocks
from .pixel_neighbors import PixelTable, depth_slopes

#: Smallest depth at which a segment is drawn, as a fraction of the depth of its farther end.
MIN_RELATIVE_DEPTH = 1e-3

#: Edges that are projected at once, and crossings that are tested at once.
BLOCK_EDGES, BLOCK_CROSSINGS = 1 << 14, 1 << 16

#: Tolerance of the depth of a visible segment, in multiples of the tolerance of `depth_slopes`.
LINE_TOLERANCE = 2.0


def crease_pixels(
    gbuffer: GBuffer, instance_id: int, points: np.ndarray, table: PixelTable
) -> np.ndarray:
    """Find the pixels next to visible edges.

    An edge crosses the segments between the centers of adjacent pixels. It is visible at one of the
    two pixels if its depth equals the depth of the surface there, extrapolated to the crossing.

    Parameters
    ----------
    gbuffer : GBuffer
    instance_id : int
        Index of the instance that has the edges. Only pixels of this instance are found.
    points : (n, 2, 3) float64 ndarray
        The ends of the edges in world space.
    table : PixelTable
        The pixels of the G-buffer, with a margin of at least one pixel.

    Returns
    -------
    (P,) bool ndarray
        Whether each pixel of the G-buffer is next to a visible edge.
    """
    marks = np.zeros(len(gbuffer.pixel), dtype=bool)
    for block in reported_blocks(len(points), "drawing outlines", size=BLOCK_EDGES):
        lines = _on_screen(points[block], gbuffer.camera)
        for axis in (0, 1):
            for row, column, offset, depth in _crossings(lines, axis, gbuffer.camera):
                entry = table.at(row, column)
                found = np.flatnonzero(entry >= 0)
                found = found[gbuffer.instance_id[entry[found]] == instance_id]
                entry = entry[found]
                surface_depth, slope_x, slope_y, tolerance = depth_slopes(gbuffer, entry)
                surface_depth = surface_depth + (slope_x, slope_y)[axis] * offset[found]
                is_visible = np.abs(depth[found] - surface_depth) <= LINE_TOLERANCE * tolerance
                marks[entry[is_visible]] = True
    return marks


def _on_screen(points: np.ndarray, camera: Camera) -> np.ndarray:
    """Return the (m, 2, 3) ends of edges on screen: x and y in pixels from the lower left, and depth.

    The depth is linear on screen: z of camera space if orthographic, -1 / z if perspective. `points` are the
    (n, 2, 3) ends in world space. Under perspective, edges are clipped in front of the eye, and edges behind
    it are left out.
    """
    ends = transformed(points, camera.view[:3])
    if camera.is_perspective:
        depth = -ends[..., 2]
        least = MIN_RELATIVE_DEPTH * depth.max(axis=1)
        ends, depth, least = (values[least > 0] for values in (ends, depth, least))
        low = np.argmin(depth, axis=1)
        row = np.arange(len(ends))
        near, far = depth[row, low], depth[row, 1 - low]
        share = np.clip((least - near) / np.maximum(far - near, 1e-300), 0.0, 1.0)[:, None]
        ends[row, low] += share * (ends[row, 1 - low] - ends[row, low])
    clip = transformed(ends, camera.projection)
    screen = np.empty_like(ends)
    screen[..., :2] = 0.5 * (clip[..., :2] / clip[..., 3:] + 1) * camera.size
    screen[..., 2] = -1 / ends[..., 2] if camera.is_perspective else ends[..., 2]
    return screen


def _crossings(
    lines: np.ndarray, axis: int, camera: Camera
) -> Iterator[tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]]:
    """Yield the crossings of segments with the center lines of pixel rows (axis 0) or columns (axis 1).

    `lines` holds the (m, 2, 3) ends of the segments, from `_on_screen`. Each crossing is yielded for the
    pixels on both sides of it.

    Yields
    ------
    row, column : (k,) int64 ndarray
        A pixel next to the crossing. It may be outside of the frame, by one pixel.
    offset : (k,) float64 ndarray
        Signed distance in pixels from the pixel center to the crossing, along x (axis 0) or y (axis 1).
    depth : (k,) float64 ndarray
        Depth of the crossing, linear on screen, as in `lines`.
    """
    along, across = axis, 1 - axis
    size = camera.size
    order = np.argsort(lines[:, :, across], axis=1)
    low, high = (lines[np.arange(len(lines)), order[:, end]] for end in (0, 1))
    first = np.clip(np.ceil(low[:, across] - 0.5), 0, size[across]).astype(np.int64)
    stop = np.clip(np.ceil(high[:, across] - 0.5), 0, size[across]).astype(np.int64)
    count = np.maximum(stop - first, 0)
    slope = (high - low) / np.maximum(high[:, across] - low[:, across], 1e-300)[:, None]
    for line, index in blocks_of_ranges(first, count, BLOCK_CROSSINGS):
        point = low[line] + slope[line] * (index + 0.5 - low[line, across])[:, None]
        inside = (point[:, along] > -0.5) & (point[:, along] < size[along] + 0.5)
        index, position, depth = index[inside], point[inside, along], point[inside, 2]
        before = np.floor(position - 0.5).astype(np.int64)
        for place in (before, before + 1):
            row, column = (index, place) if axis == 0 else (place, index)
            yield row, column, position - (place + 0.5), depth
