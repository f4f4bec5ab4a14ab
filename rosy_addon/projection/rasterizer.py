"""A scanline rasterizer in numpy: the nearest triangle at the center of each pixel.

The edges of a triangle are intersected with the horizontal lines through pixel centers. An edge is
always evaluated from its lower to its upper end, so that two triangles with a common edge compute
bit-identical intersections. A row belongs to a triangle if its line is at or above the lowest
vertex and below the highest one. A pixel belongs to a span if its center is at or right of the left
intersection and left of the right one. So adjacent triangles leave no gaps and do not overlap.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import NamedTuple

import numpy as np

from ..core.progress import progress, report
from ..field.blocks import blocks_by_count, blocks_of_ranges, numbered_ranges, row_blocks
from .barycentrics import LABEL, barycentrics
from .near_clipping import ClippedTriangles, clip_near

#: Triangles, spans or fragments per block. Bounds memory, and fits the caches of the processor.
BLOCK_SIZE = 1 << 14

#: The bits of the column in an integer that packs a row and a column.
COLUMN_MASK = 0xFFFF

#: The first row of a range of rows, and the row after the last one; None for all rows of the frame.
Rows = tuple[int, int] | None

#: Largest size of the depth buffer, in pixels. Larger frames are rasterized in bands of rows.
MAX_BAND_PIXELS = 1 << 22


class Fragments(NamedTuple):
    """The nearest triangle at each of the P covered pixels, in ascending order of pixel.

    Attributes
    ----------
    pixel : (P,) int32 ndarray
        Flat index, ``row * width + column`` from the lower left.
    triangle : (P,) int32 ndarray
        Index of the visible triangle.
    barycentric : (P, 3) float32 ndarray
        Perspective-correct barycentric coordinates of the pixel center in the triangle. Not
        negative, with sum 1.
    front_facing : (P,) bool ndarray
        Whether the corners of the triangle run counter-clockwise on screen.
    depth : (P,) float64 ndarray
        z / w, from -1 at the near plane to 1 at the far plane.
    """

    pixel: np.ndarray
    triangle: np.ndarray
    barycentric: np.ndarray
    front_facing: np.ndarray
    depth: np.ndarray


class _ScreenVertices(NamedTuple):
    """Vertices on screen.

    Attributes
    ----------
    x, y : (V,) float64 ndarray
        Position in pixels, from the lower left corner of the frame.
    depth : (V,) float64 ndarray
        z / w.
    packed_center : (V,) int32 ndarray
        The first pixel center at or above, and at or right of, the vertex: row times 2^16, plus
        column. Clamped to the frame.
    """

    x: np.ndarray
    y: np.ndarray
    depth: np.ndarray
    packed_center: np.ndarray

    def at(self, vertex: np.ndarray) -> _ScreenVertices:
        """Return the vertices with (n,) indices."""
        return _ScreenVertices(*(values.take(vertex) for values in self))

    def clamped_to_rows(self, row_start: int, row_stop: int) -> _ScreenVertices:
        """Return the vertices with the rows of `packed_center` clamped to a range of rows."""
        row = np.clip(self.packed_center >> 16, row_start, row_stop)
        return self._replace(packed_center=row << 16 | self.packed_center & COLUMN_MASK)


class _Spans(NamedTuple):
    """Horizontal runs of covered pixels.

    Attributes
    ----------
    start : (S,) intp ndarray
        Flat index of the first pixel.
    count : (S,) intp ndarray
        Number of pixels.
    depth, depth_step : (S,) float64 ndarray
        z / w at the first pixel, and its change from pixel to pixel.
    triangle : (S,) ndarray of int
        Index of the triangle.
    """

    start: np.ndarray
    count: np.ndarray
    depth: np.ndarray
    depth_step: np.ndarray
    triangle: np.ndarray


def rasterize(
    clip_vertices: np.ndarray, triangles: np.ndarray, width: int, height: int, rows: Rows = None
) -> Fragments:
    """Find the nearest triangle at the center of every pixel.

    Both sides of a triangle are drawn. Of triangles at exactly the same depth, the one with the
    smallest index is visible.

    Parameters
    ----------
    clip_vertices : (V, 4) float64 ndarray
        Clip space, in OpenGL's convention.
    triangles : (T, 3) ndarray of int
        Vertex indices. Adjacent triangles are drawn without cracks if the vertices of the common edge
        are the same, or have equal coordinates.
    width, height : int
        Size of the frame in pixels.
    rows : (int, int) or None
        First row to draw, and the row after the last one. None for all rows.

    Returns
    -------
    Fragments
    """
    first_row, stop_row = (0, height) if rows is None else rows
    clip_vertices = np.asarray(clip_vertices, dtype=np.float64)
    triangles = np.ascontiguousarray(triangles, dtype=np.int32).reshape(-1, 3)
    vertices, clipped = clip_near(clip_vertices, triangles)
    screen = to_screen(vertices, width, height)
    bands = []
    band_rows = max(1, MAX_BAND_PIXELS // width)
    for row_start in range(first_row, stop_row, band_rows):
        row_stop = min(row_start + band_rows, stop_row)
        with progress(0.7 * row_start / height, 0.7 * row_stop / height):
            triangle, depth = rasterize_rows(screen, clipped, width, row_start, row_stop)
        pixel = np.flatnonzero(triangle >= 0)
        bands.append(((pixel + row_start * width).astype(np.int32), triangle[pixel], depth[pixel]))
    pixel, triangle, depth = (np.concatenate(values) for values in zip(*bands, strict=True))
    with progress(0.7, 1.0):
        weights, front_facing = barycentrics(
            clip_vertices, triangles, pixel, triangle, width, height
        )
    return Fragments(pixel, triangle, weights, front_facing, depth)


def to_screen(vertices: np.ndarray, width: int, height: int) -> _ScreenVertices:
    """Transform (V, 4) vertices from clip space to the screen."""
    x, y, z, w = vertices.T
    inverse_w = np.divide(1.0, w, out=np.zeros(len(w)), where=w > 0)
    x = (x * inverse_w + 1.0) * (0.5 * width)
    y = (y * inverse_w + 1.0) * (0.5 * height)
    column = np.clip(np.ceil(x - 0.5), 0, width).astype(np.int32)
    row = np.clip(np.ceil(y - 0.5), 0, height).astype(np.int32)
    return _ScreenVertices(x, y, z * inverse_w, row << 16 | column)


def rasterize_rows(
    screen: _ScreenVertices, clipped: ClippedTriangles, width: int, row_start: int, row_stop: int
) -> tuple[np.ndarray, np.ndarray]:
    """Rasterize the rows from `row_start` up to, but not including, `row_stop`.

    Returns
    -------
    triangle : (rows * width,) int32 ndarray
        The visible triangle at each pixel, -1 where there is none.
    depth : (rows * width,) float64 ndarray
        Its z / w; a value just beyond the far plane where there is none.
    """
    screen = screen.clamped_to_rows(row_start, row_stop)
    # Just beyond the far plane.
    depth_buffer = np.full((row_stop - row_start) * width, np.nextafter(1.0, 2.0))
    triangle_buffer = np.full((row_stop - row_start) * width, -1, dtype=np.int32)
    for block in row_blocks(len(clipped.triangle), BLOCK_SIZE):
        corners = tuple(corner[block] for corner in clipped.corners)
        for spans in _scan_convert(screen, corners, clipped.triangle[block], width):
            spans.start[:] -= row_start * width
            for span_block in blocks_by_count(spans.count, BLOCK_SIZE):
                report(block.start / len(clipped.triangle), LABEL)
                part = _Spans(*(values[span_block] for values in spans))
                _depth_test(part, depth_buffer, triangle_buffer)
    return triangle_buffer, depth_buffer


def _scan_convert(
    screen: _ScreenVertices, corners: tuple[np.ndarray, ...], triangle: np.ndarray, width: int
) -> Iterator[_Spans]:
    """Yield the spans of a block of n triangles, in the order of the triangles.

    `corners` are 3 (n,) arrays of vertex indices. `triangle`, (n,), is the index that the spans get, and
    `width` the width of the frame in pixels.
    """
    a, b, c = corners
    # If all corners have the same row or the same column in `packed_center`, the triangle covers no
    # pixel center.
    packed = screen.packed_center.take(a)
    differing_bits = packed ^ screen.packed_center.take(b)
    differing_bits |= packed ^ screen.packed_center.take(c)
    covering = np.flatnonzero((differing_bits > COLUMN_MASK) & (differing_bits & COLUMN_MASK != 0))
    if len(covering) < len(a):
        a, b, c, triangle = (values.take(covering) for values in (a, b, c, triangle))
    a, b, c = _sorted_by_y(screen.y, a, b, c)
    low, mid, high = (screen.at(corner) for corner in (a, b, c))
    bottom, middle, top = (corner.packed_center >> 16 for corner in (low, mid, high))
    depth_plane = _depth_plane(low, mid, high)
    long_edge = _edge_line(low, high)
    edge_pairs = zip(_edge_line(low, mid), _edge_line(mid, high), strict=True)
    short_edges = tuple(np.concatenate(pair) for pair in edge_pairs)
    for local_triangle, row in blocks_of_ranges(bottom, top - bottom, BLOCK_SIZE):
        short_edge = local_triangle + len(middle) * (row >= middle.take(local_triangle))
        center_y = row + 0.5
        long_x = _edge_x_at_row(long_edge, local_triangle, center_y)
        short_x = _edge_x_at_row(short_edges, short_edge, center_y)
        first, last = _column_range(long_x, short_x, width)
        nonempty = np.flatnonzero(first < last)
        local_triangle, row, first, last = (
            values.take(nonempty) for values in (local_triangle, row, first, last)
        )
        plane = (values.take(local_triangle) for values in depth_plane)
        spans = _spans_with_depth(row, first, last, plane, width)
        yield _Spans(*spans, triangle.take(local_triangle))


def _edge_x_at_row(
    edges: tuple[np.ndarray, np.ndarray, np.ndarray], edge: np.ndarray, center_y: np.ndarray
) -> np.ndarray:
    """Return the x coordinates where edges intersect the horizontal lines at `center_y`.

    `edges` has x and y of the lower ends of all edges, and their slopes dx / dy. `edge` holds the index of an
    edge for each horizontal line. All coordinates are in pixels.
    """
    x, y, slope = edges
    crossing = center_y - y.take(edge)
    crossing *= slope.take(edge)
    crossing += x.take(edge)
    return crossing


def _column_range(x_a: np.ndarray, x_b: np.ndarray, width: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the columns whose centers lie between two intersections: the first, and the last plus one.

    Both are float64, clamped to the range from 0 to `width`.
    """
    columns = []
    for x in (np.minimum(x_a, x_b), np.maximum(x_a, x_b)):
        x -= 0.5
        np.ceil(x, out=x)
        np.maximum(x, 0, out=x)
        columns.append(np.minimum(x, width, out=x))
    return columns[0], columns[1]


def _spans_with_depth(
    row: np.ndarray, first: np.ndarray, last: np.ndarray, plane: Iterable[np.ndarray], width: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return the pixels and the depths of spans, as the first four attributes of `_Spans`.

    Parameters
    ----------
    row : (S,) ndarray of int
        Row of each span.
    first, last : (S,) float64 ndarray
        First column of each span, and the column after its last one.
    plane : 5 (S,) float64 ndarrays
        Depth of the triangle of each span as a linear function on screen, from `_depth_plane`. The arrays may
        be changed in place.
    width : int
        Width of the frame in pixels.
    """
    slope_x, slope_y, base, min_depth, max_depth = plane
    slope_y *= row + 0.5
    base += slope_y
    end_depths = []
    # The centers of the first and last columns become the depths there, in place.
    for depth in (first + 0.5, last - 0.5):
        depth *= slope_x
        depth += base
        # The gradient of a sliver may be dominated by rounding errors, so the depth is clamped to
        # the range of the triangle.
        np.maximum(depth, min_depth, out=depth)
        end_depths.append(np.minimum(depth, max_depth, out=depth))
    first_depth, depth_step = end_depths
    pixel_count = last - first
    # The depth at the last pixel becomes the step from pixel to pixel, in place.
    depth_step -= first_depth
    depth_step /= np.maximum(pixel_count - 1, 1)
    start = row * width + first.astype(np.intp)
    return start, pixel_count.astype(np.intp), first_depth, depth_step


def _depth_test(spans: _Spans, depth_buffer: np.ndarray, triangle_buffer: np.ndarray) -> None:
    """Draw spans into the depth buffer and the triangle buffer, in place.

    The buffers are flat arrays with z / w and the index of the triangle that is visible at each pixel.

    If several fragments write to the same pixel in one assignment, an arbitrary one is kept. The
    fragments that are nearer than the kept one write again, until there are none. Few rounds are
    needed, because each round removes all fragments that are not in front of the kept one.
    """
    span, pixel = numbered_ranges(spans.start, spans.count)
    depth = pixel - spans.start.take(span)
    depth = depth * spans.depth_step.take(span)
    depth += spans.depth.take(span)
    closer = np.flatnonzero(depth < depth_buffer.take(pixel))
    span, pixel, depth = span.take(closer), pixel.take(closer), depth.take(closer)
    pending_pixel, pending_depth = pixel, depth
    while len(pending_pixel):
        depth_buffer[pending_pixel] = pending_depth
        closer = np.flatnonzero(pending_depth < depth_buffer.take(pending_pixel))
        pending_pixel, pending_depth = pending_pixel.take(closer), pending_depth.take(closer)
    # The last value that is written stays. In reverse order, this is the first of the triangles that
    # have equal depths.
    winners = np.flatnonzero(depth == depth_buffer.take(pixel))[::-1]
    triangle_buffer[pixel.take(winners)] = spans.triangle.take(span.take(winners))


def _sorted_by_y(
    y: np.ndarray, a: np.ndarray, b: np.ndarray, c: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the vertex indices of each triangle, sorted from the lowest to the highest y."""

    def ordered(first: np.ndarray, second: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        swap = y.take(first) > y.take(second)
        return np.where(swap, second, first), np.where(swap, first, second)

    a, b = ordered(a, b)
    b, c = ordered(b, c)
    a, b = ordered(a, b)
    return a, b, c


def _edge_line(
    low: _ScreenVertices, high: _ScreenVertices
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return x and y of the lower end of edges, and their slope dx / dy."""
    rise = high.y - low.y
    rise[rise == 0] = np.inf
    return low.x, low.y, (high.x - low.x) / rise


def _depth_plane(
    a: _ScreenVertices, b: _ScreenVertices, c: _ScreenVertices
) -> tuple[np.ndarray, ...]:
    """Return the depth of triangles as linear functions on screen, and their depth range.

    z / w is affine on screen for a plane, under perspective too.

    Returns
    -------
    slope_x, slope_y, base, min_depth, max_depth : (n,) float64 ndarray
        depth = slope_x x + slope_y y + base, with x and y in pixels; and the smallest and the largest depth
        of the three corners.
    """
    xb, yb, depth_b = b.x - a.x, b.y - a.y, b.depth - a.depth
    xc, yc, depth_c = c.x - a.x, c.y - a.y, c.depth - a.depth
    inverse_area = xb * yc - xc * yb
    inverse_area[inverse_area == 0] = np.inf
    np.divide(1, inverse_area, out=inverse_area)
    slope_x = (depth_b * yc - depth_c * yb) * inverse_area
    slope_y = (depth_c * xb - depth_b * xc) * inverse_area
    min_depth = np.minimum(np.minimum(a.depth, b.depth), c.depth)
    max_depth = np.maximum(np.maximum(a.depth, b.depth), c.depth)
    return slope_x, slope_y, a.depth - slope_x * a.x - slope_y * a.y, min_depth, max_depth
