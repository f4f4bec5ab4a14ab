"""A scanline rasterizer in numpy: the nearest triangle at the center of each pixel.

The edges of a triangle are intersected with the horizontal lines through pixel centers. An edge is
always evaluated from its lower to its upper end, so that two triangles with a common edge compute
bit-identical intersections. A row belongs to a triangle if its line is at or above the lowest
vertex and below the highest one. A pixel belongs to a span if its center is at or right of the left
intersection and left of the right one. So adjacent triangles leave no gaps and do not overlap.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from ..core.progress import progress, report
from ..field.blocks import blocks_by_count, concatenated_ranges

#: Triangles, spans or fragments per block. Bounds memory, and fits the caches of the processor.
BLOCK_SIZE = 1 << 14

#: The bits of the column in an integer that packs a row and a column.
COLUMN_MASK = 0xFFFF

#: Largest size of the depth buffer, in pixels. Larger frames are rasterized in bands of rows.
MAX_BAND_PIXELS = 1 << 22

#: Sum of barycentric coordinates that is not due to rounding: the pixel center is outside.
MAX_WEIGHT_SUM = 1 + 1e-4

#: Label of the progress.
LABEL = "finding visible pixels"


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


class SampledTriangles(NamedTuple):
    """The triangles at S x S samples of each of the P covered pixels, in ascending order of pixel.

    Attributes
    ----------
    pixel : (P,) int32 ndarray
        Flat index, ``row * width + column`` from the lower left.
    triangle : (P,) int32 ndarray
        Triangle that is visible at the center, or else at the sample that is nearest to it.
    depth : (P,) float64 ndarray
        Its z / w there.
    own_samples : (P,) uint16 ndarray
        The samples that show this triangle: bit ``row * S + column``.
    other_entry : (E,) int32 ndarray
        Index into `pixel`, for each sample that shows another triangle.
    other_sample : (E,) int32 ndarray
        Flat index of that sample in the frame of all samples.
    other_triangle : (E,) int32 ndarray
    other_depth : (E,) float64 ndarray
    """

    pixel: np.ndarray
    triangle: np.ndarray
    depth: np.ndarray
    own_samples: np.ndarray
    other_entry: np.ndarray
    other_sample: np.ndarray
    other_triangle: np.ndarray
    other_depth: np.ndarray


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


class _ClippedTriangles(NamedTuple):
    """Triangles after clipping at the near plane.

    Attributes
    ----------
    corners : 3 (K,) int32 ndarrays
        Vertex index of each corner.
    triangle : (K,) int32 ndarray
        Index of the original triangle, in ascending order.
    """

    corners: tuple[np.ndarray, np.ndarray, np.ndarray]
    triangle: np.ndarray


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
    clip_vertices: np.ndarray,
    triangles: np.ndarray,
    width: int,
    height: int,
    rows: tuple[int, int] | None = None,
) -> Fragments:
    """Find the nearest triangle at the center of every pixel.

    Both sides of a triangle are drawn. Of triangles at exactly the same depth, the one with the
    smallest index is visible.

    Parameters
    ----------
    clip_vertices : (V, 4) float64 ndarray
        Clip space, in OpenGL's convention.
    triangles : (T, 3) ndarray of int
        Vertex indices. Adjacent triangles are drawn without cracks if they share the vertices of
        the common edge, or these have equal coordinates.
    width, height : int
        Size of the frame in pixels.
    rows : (int, int), optional
        The first row, and the row after the last one, if not all are drawn.

    Returns
    -------
    Fragments
    """
    first_row, stop_row = (0, height) if rows is None else rows
    clip_vertices = np.asarray(clip_vertices, dtype=np.float64)
    triangles = np.ascontiguousarray(triangles, dtype=np.int32).reshape(-1, 3)
    vertices, clipped = _clip_near(clip_vertices, triangles)
    screen = _to_screen(vertices, width, height)
    bands = []
    band_rows = max(1, MAX_BAND_PIXELS // width)
    for row_start in range(first_row, stop_row, band_rows):
        row_stop = min(row_start + band_rows, stop_row)
        with progress(0.7 * row_start / height, 0.7 * row_stop / height):
            triangle, depth = _rasterize_rows(screen, clipped, width, row_start, row_stop)
        pixel = np.flatnonzero(triangle >= 0)
        bands.append(((pixel + row_start * width).astype(np.int32), triangle[pixel], depth[pixel]))
    pixel, triangle, depth = (np.concatenate(values) for values in zip(*bands, strict=True))
    with progress(0.7, 1.0):
        weights, front_facing = barycentrics(
            clip_vertices, triangles, pixel, triangle, width, height
        )
    return Fragments(pixel, triangle, weights, front_facing, depth)


def rasterize_samples(
    clip_vertices: np.ndarray,
    triangles: np.ndarray,
    is_drawn: np.ndarray,
    width: int,
    height: int,
    samples: int,
    rows: tuple[int, int] | None = None,
) -> SampledTriangles:
    """Find the nearest triangle at several samples of each pixel, on a square grid.

    Parameters
    ----------
    clip_vertices, triangles, width, height, rows
        As of `rasterize`.
    is_drawn : (T,) bool ndarray
        Triangles that are not drawn only hide others.
    samples : int
        S, the samples along each side of a pixel.
    """
    first_row, stop_row = (0, height) if rows is None else rows
    vertices, clipped = _clip_near(clip_vertices, triangles)
    screens = [
        (scale, _to_screen(vertices, width * scale, height * scale)) for scale in (1, samples)
    ]
    bands, entry_count = [], 0
    band_rows = max(1, MAX_BAND_PIXELS // (width * samples * samples))
    for row_start in range(first_row, stop_row, band_rows):
        row_stop = min(row_start + band_rows, stop_row)
        buffers = []
        for index, (scale, screen) in enumerate(screens):
            half = (row_stop - row_start) / (2 * height)
            start = row_start / height + index * half
            with progress(start, start + half):
                triangle, depth = _rasterize_rows(
                    screen, clipped, width * scale, row_start * scale, row_stop * scale
                )
            if not is_drawn.all():
                triangle[~is_drawn.take(triangle, mode="clip")] = -1
            buffers += (
                triangle.reshape(-1, scale, width, scale),
                depth.reshape(-1, scale, width, scale),
            )
        band = _group_samples(*buffers, row_start)
        bands.append(band._replace(other_entry=band.other_entry + np.int32(entry_count)))
        entry_count += len(band.pixel)
    return SampledTriangles(*(np.concatenate(values) for values in zip(*bands, strict=True)))


def _group_samples(
    center_triangle: np.ndarray,
    center_depth: np.ndarray,
    triangle: np.ndarray,
    depth: np.ndarray,
    first_row: int,
) -> SampledTriangles:
    """Group the samples of some rows by pixels.

    Parameters
    ----------
    center_triangle : (h, 1, w, 1) int32 ndarray
        Triangle at the center of each pixel, -1 where there is none.
    triangle : (h, S, w, S) int32 ndarray
        The same at samples.
    center_depth, depth : float64 ndarray
        Of the same shapes.
    first_row : int
        The first of the rows.
    """
    samples, width = triangle.shape[1:3]
    offset = np.arange(samples) - (samples - 1) / 2
    order = np.argsort((offset[:, None] ** 2 + offset**2).ravel(), kind="stable").tolist()
    sample_places = [divmod(sample, samples) for sample in order]
    own_triangle, own_depth = center_triangle[:, 0, :, 0].copy(), center_depth[:, 0, :, 0].copy()
    for row, column in sample_places:
        empty = np.nonzero(own_triangle < 0)
        own_triangle[empty] = triangle[:, row, :, column][empty]
        own_depth[empty] = depth[:, row, :, column][empty]
    pixel = np.flatnonzero(own_triangle >= 0)
    own_triangle, own_depth = own_triangle.ravel()[pixel], own_depth.ravel()[pixel]
    own_samples = np.zeros(len(pixel), dtype=np.uint16)
    others = []
    pixel_row, pixel_column = np.divmod(pixel.astype(np.int32), np.int32(width))
    pixel_row += np.int32(first_row)
    for row, column in sample_places:
        sample_triangle = triangle[:, row, :, column].ravel()[pixel]
        is_own = sample_triangle == own_triangle
        own_samples |= is_own.astype(np.uint16) << np.uint16(row * samples + column)
        entry = np.flatnonzero((sample_triangle >= 0) & ~is_own)
        sample_row = pixel_row[entry] * np.int32(samples) + np.int32(row)
        sample_column = pixel_column[entry] * np.int32(samples) + np.int32(column)
        others.append(
            (
                entry.astype(np.int32),
                sample_row * np.int32(width * samples) + sample_column,
                sample_triangle[entry],
                depth[:, row, :, column].ravel()[pixel[entry]],
            )
        )
    return SampledTriangles(
        pixel_row * np.int32(width) + pixel_column,
        own_triangle,
        own_depth,
        own_samples,
        *(np.concatenate(values) for values in zip(*others, strict=True)),
    )


def _clip_near(vertices: np.ndarray, triangles: np.ndarray) -> tuple[np.ndarray, _ClippedTriangles]:
    """Clip triangles at the near plane. Triangles behind it are removed.

    Returns
    -------
    vertices : (V', 4) float64 ndarray
        The given vertices, followed by the intersections with the near plane.
    clipped : _ClippedTriangles
    """
    inside = vertices[:, 2] + vertices[:, 3] >= 0
    a, b, c = np.ascontiguousarray(triangles.T)
    if inside.all():
        return vertices, _ClippedTriangles((a, b, c), np.arange(len(triangles), dtype=np.int32))
    count = inside[a].astype(np.int8) + inside[b] + inside[c]
    unclipped = np.flatnonzero(count == 3).astype(np.int32)
    crossing = np.flatnonzero((count == 1) | (count == 2)).astype(np.int32)
    new_vertices, new_corners, new_triangle = _clip_crossing_triangles(
        vertices, triangles, inside, crossing
    )
    triangle = np.concatenate([unclipped, new_triangle])
    order = np.argsort(triangle, kind="stable")
    corners = np.concatenate([triangles[unclipped], new_corners])[order]
    return (
        np.concatenate([vertices, new_vertices]),
        _ClippedTriangles(tuple(np.ascontiguousarray(corners.T)), triangle[order]),
    )


def _clip_crossing_triangles(
    vertices: np.ndarray, triangles: np.ndarray, inside: np.ndarray, crossing: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Clip K triangles that cross the near plane, and triangulate what is in front of it.

    In each crossing triangle, one vertex (`apex`) is on one side of the plane and two are on the
    other. If the apex is in front, a triangle remains, otherwise a quadrilateral.

    Parameters
    ----------
    vertices : (V, 4) float64 ndarray
    triangles : (T, 3) int32 ndarray
    inside : (V,) bool ndarray
        Whether each vertex is in front of the near plane.
    crossing : (K,) int32 ndarray
        Indices of the crossing triangles.

    Returns
    -------
    new_vertices : (2 K, 4) float64 ndarray
        Intersections with the near plane. Their indices continue those of `vertices`.
    corners : (K', 3) int32 ndarray
        Vertex indices of the new triangles.
    triangle : (K',) int32 ndarray
        Index of the original triangle of each.
    """
    corners = triangles[crossing]
    sides = inside[corners]
    one_inside = sides.sum(axis=1) == 1
    lone_corner = np.argmax(sides == one_inside[:, None], axis=1)
    rotated_corners = (lone_corner[:, None] + np.arange(3)) % 3
    apex, left, right = np.take_along_axis(corners, rotated_corners, axis=1).T
    new_vertices = np.concatenate(
        [_intersect_near(vertices, apex, left), _intersect_near(vertices, apex, right)]
    )
    on_left = np.arange(len(crossing), dtype=np.int32) + len(vertices)
    on_right = on_left + len(crossing)
    tip, base = one_inside, ~one_inside
    new_corners = np.concatenate(
        [
            np.stack([apex, on_left, on_right], axis=1)[tip],
            np.stack([on_left, left, right], axis=1)[base],
            np.stack([on_left, right, on_right], axis=1)[base],
        ]
    )
    return (
        new_vertices,
        new_corners.astype(np.int32),
        np.concatenate([crossing[tip], crossing[base], crossing[base]]),
    )


def _intersect_near(vertices: np.ndarray, first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Return the (K, 4) intersections of edges with the near plane.

    They do not depend on the order of the two vertices of an edge.
    """
    low, high = vertices[np.minimum(first, second)], vertices[np.maximum(first, second)]
    low_distance, high_distance = low[:, 2] + low[:, 3], high[:, 2] + high[:, 3]
    t = (low_distance / (low_distance - high_distance))[:, None]
    return low + t * (high - low)


def _to_screen(vertices: np.ndarray, width: int, height: int) -> _ScreenVertices:
    """Transform (V, 4) vertices from clip space to the screen."""
    x, y, z, w = vertices.T
    inverse_w = np.divide(1.0, w, out=np.zeros(len(w)), where=w > 0)
    x = (x * inverse_w + 1.0) * (0.5 * width)
    y = (y * inverse_w + 1.0) * (0.5 * height)
    column = np.clip(np.ceil(x - 0.5), 0, width).astype(np.int32)
    row = np.clip(np.ceil(y - 0.5), 0, height).astype(np.int32)
    return _ScreenVertices(x, y, z * inverse_w, row << 16 | column)


def _rasterize_rows(
    screen: _ScreenVertices, clipped: _ClippedTriangles, width: int, row_start: int, row_stop: int
) -> tuple[np.ndarray, np.ndarray]:
    """Rasterize the rows from `row_start` up to, but not including, `row_stop`.

    Returns
    -------
    triangle : (rows * width,) int32 ndarray
        -1 where there is none.
    depth : (rows * width,) float64 ndarray
    """
    screen = screen.clamped_to_rows(row_start, row_stop)
    depth_buffer = np.full(
        (row_stop - row_start) * width, np.nextafter(1.0, 2.0)
    )  # just beyond the far plane
    triangle_buffer = np.full((row_stop - row_start) * width, -1, dtype=np.int32)
    for start in range(0, len(clipped.triangle), BLOCK_SIZE):
        block = slice(start, start + BLOCK_SIZE)
        corners = tuple(corner[block] for corner in clipped.corners)
        for spans in _scan_convert(screen, corners, clipped.triangle[block], width):
            spans.start[:] -= row_start * width
            for span_block in blocks_by_count(spans.count, BLOCK_SIZE):
                report(start / len(clipped.triangle), LABEL)
                _depth_test(
                    _Spans(*(values[span_block] for values in spans)), depth_buffer, triangle_buffer
                )
    return triangle_buffer, depth_buffer


def _scan_convert(
    screen: _ScreenVertices, corners: tuple[np.ndarray, ...], triangle: np.ndarray, width: int
) -> Iterator[_Spans]:
    """Yield the spans of a block of triangles, in the order of the triangles."""
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
    for block in blocks_by_count(top - bottom, BLOCK_SIZE):
        first, rows = bottom[block], (top - bottom)[block]
        local_triangle = np.repeat(np.arange(block.start, block.stop), rows)
        row = concatenated_ranges(first, rows)
        short_edge = local_triangle + len(middle) * (row >= middle.take(local_triangle))
        center_y = row + 0.5
        long_x = _edge_x_at_row(long_edge, local_triangle, center_y)
        short_x = _edge_x_at_row(short_edges, short_edge, center_y)
        first, last = _column_range(long_x, short_x, width)
        nonempty = np.flatnonzero(first < last)
        local_triangle, row, first, last = (
            values.take(nonempty) for values in (local_triangle, row, first, last)
        )
        spans = _spans_with_depth(row, local_triangle, first, last, depth_plane, width)
        yield spans._replace(triangle=triangle.take(local_triangle))


def _edge_x_at_row(
    edges: tuple[np.ndarray, np.ndarray, np.ndarray], edge: np.ndarray, center_y: np.ndarray
) -> np.ndarray:
    """Return x where edges intersect horizontal lines.

    `edges` is from `_edge_line`, `edge` holds an index into it for each line at `center_y`.
    """
    x, y, slope = edges
    crossing = center_y - y.take(edge)
    crossing *= slope.take(edge)
    crossing += x.take(edge)
    return crossing


def _column_range(x_a: np.ndarray, x_b: np.ndarray, width: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the first column with its center between two intersections, and the last plus one.

    Both are float64, clamped to 0 to `width`.
    """
    columns = []
    for x in (np.minimum(x_a, x_b), np.maximum(x_a, x_b)):
        x -= 0.5
        np.ceil(x, out=x)
        np.maximum(x, 0, out=x)
        columns.append(np.minimum(x, width, out=x))
    return columns[0], columns[1]


def _spans_with_depth(
    row: np.ndarray,
    local_triangle: np.ndarray,
    first: np.ndarray,
    last: np.ndarray,
    depth_plane: tuple[np.ndarray, ...],
    width: int,
) -> _Spans:
    """Return spans with depth. Their triangles are indices within the block.

    Parameters
    ----------
    row, local_triangle : (S,) ndarray of int
    first, last : (S,) float64 ndarray
        From `_column_range`.
    depth_plane : tuple of ndarray
        From `_depth_plane`.
    width : int
        Width of the frame in pixels.
    """
    slope_x, slope_y, base, min_depth, max_depth = (
        values.take(local_triangle) for values in depth_plane
    )
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
    return _Spans(
        start=row * width + first.astype(np.intp),
        count=pixel_count.astype(np.intp),
        depth=first_depth,
        depth_step=depth_step,
        triangle=local_triangle,
    )


def _depth_test(spans: _Spans, depth_buffer: np.ndarray, triangle_buffer: np.ndarray) -> None:
    """Draw spans into the depth buffer and the triangle buffer, in place.

    If several fragments write to the same pixel in one assignment, an arbitrary one is kept. The
    fragments that are nearer than the kept one write again, until there are none. Few rounds are
    needed, because each removes all fragments that are not in front of the kept one.
    """
    span = np.repeat(np.arange(len(spans.count)), spans.count)
    pixel = concatenated_ranges(spans.start, spans.count)
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
    # In reverse order, so that of equal depths the first triangle is written last and is kept.
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
        depth = slope_x x + slope_y y + base, with x and y in pixels.
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


def barycentrics(
    vertices: np.ndarray,
    triangles: np.ndarray,
    pixel: np.ndarray,
    triangle: np.ndarray,
    width: int,
    height: int,
) -> tuple[np.ndarray, np.ndarray]:
    """Compute perspective-correct barycentric coordinates at pixel centers, in unclipped triangles.

    Uses homogeneous edge functions (Olano and Greer, "Triangle Scan Conversion using 2D Homogeneous
    Coordinates", 1997), which are also valid for triangles that extend behind the eye. They are
    evaluated relative to the pixel center, so that small triangles lose no precision.

    Returns
    -------
    weights : (P, 3) float32 ndarray
        Of a point of the triangle, also if the pixel center is outside of it. 1 / 3 each for triangles
        that have no area on screen.
    front_facing : (P,) bool ndarray
        Whether the corners run counter-clockwise on screen.
    """
    w = vertices[:, 3]
    x, y, w = (vertices[:, 0] + w) * (0.5 * width), (vertices[:, 1] + w) * (0.5 * height), w.copy()
    corners = np.ascontiguousarray(triangles.T)
    weights = np.empty((3, len(pixel)), dtype=np.float32)
    front_facing = np.empty(len(pixel), dtype=bool)
    for start in range(0, len(pixel), BLOCK_SIZE):
        report(start / len(pixel), LABEL)
        block = slice(start, start + BLOCK_SIZE)
        row, column = np.divmod(pixel[block], np.int32(width))
        column, row = column + 0.5, row + 0.5
        offsets = []
        for corner in corners:
            vertex = corner.take(triangle[block]).astype(np.intp)
            depth = w.take(vertex)
            offsets.append((x.take(vertex) - column * depth, y.take(vertex) - row * depth))
        (ax, ay), (bx, by), (cx, cy) = offsets
        area_a, area_b, area_c = bx * cy - cx * by, cx * ay - ax * cy, ax * by - bx * ay
        total = area_a + area_b
        total += area_c
        np.greater_equal(total, 0, out=front_facing[block])
        with np.errstate(divide="ignore"):
            np.divide(1, total, out=total)
        # Triangles without area on screen get weights of 1 / 3 below.
        degenerate = np.isinf(total)
        total[degenerate] = 0
        for area, out in zip((area_a, area_b, area_c), weights[:, block], strict=True):
            area *= total
            np.maximum(area, 0, out=area)
            out[:] = area
        found = weights[:, block]
        # Pixels with several samples may see a triangle beside their centers.
        outside = np.flatnonzero(found.sum(axis=0) > MAX_WEIGHT_SUM)
        found[:, outside] /= found[:, outside].sum(axis=0)
        found[:, degenerate] = 1 / 3
    return weights.T, front_facing
