"""Which triangle each pixel sees: a scanline rasteriser over flat arrays.

Edges are cut with the lines through the centres of pixels, each edge from its lower to its upper
end, so that two triangles that share an edge compute the same crossing, bit for bit. A pixel
belongs to a span if its centre is at or right of the left crossing and left of the right one, a
row to a triangle if its line is at or above the lowest vertex and below the highest. Neighbouring
triangles therefore leave no pixel between them out and share none.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

#: Triangles, spans and fragments that are worked on at once: bounds memory, and fits the caches.
BLOCK = 1 << 14

#: The bits of a column where one number holds a row and a column.
COLUMN = 0xFFFF

#: Pixels of the frame whose depth is kept at once.
BAND = 1 << 24


class Fragments(NamedTuple):
    """What the P covered pixels see, in ascending order of pixel.

    Attributes
    ----------
    pixel : (P,) int32 ndarray
        Flat index, ``row * width + column`` from the lower left.
    triangle : (P,) int32 ndarray
    barycentric : (P, 3) float32 ndarray
        Perspective-correct weights of the triangle's vertices at the pixel's centre; not below 0,
        sum 1.
    front : (P,) bool ndarray
        Whether the corners of the triangle run counter-clockwise as seen.
    depth : (P,) float64 ndarray
        z / w, from -1 at the near to 1 at the far plane.
    """

    pixel: np.ndarray
    triangle: np.ndarray
    barycentric: np.ndarray
    front: np.ndarray
    depth: np.ndarray


class _Screen(NamedTuple):
    """Vertices on screen: pixels, z / w, and the first pixel centres at or beyond them.

    `centre` is the row of such a centre, times 2^16, plus its column.
    """

    x: np.ndarray
    y: np.ndarray
    depth: np.ndarray
    centre: np.ndarray

    def within(self, low: int, high: int) -> _Screen:
        """With no rows but those from `low` up to before `high`."""
        row = np.clip(self.centre >> 16, low, high)
        return self._replace(centre=row << 16 | self.centre & COLUMN)


class _Pieces(NamedTuple):
    """Triangles in front of the near plane, or what is left of them: vertices, and whose."""

    corners: tuple[np.ndarray, np.ndarray, np.ndarray]
    triangle: np.ndarray


class _Spans(NamedTuple):
    """Runs of covered pixels: the first and their number, depth at the first and its step."""

    start: np.ndarray
    count: np.ndarray
    depth: np.ndarray
    slope: np.ndarray
    triangle: np.ndarray


def rasterise(
    clip_vertices: np.ndarray, triangles: np.ndarray, width: int, height: int
) -> Fragments:
    """Find the nearest triangle at the centre of every pixel.

    Both sides of a triangle are drawn. Of triangles at exactly the same depth the one with the
    smaller index is seen.

    Parameters
    ----------
    clip_vertices : (V, 4) float64 ndarray
        Clip space, OpenGL's convention.
    triangles : (T, 3) ndarray of int
        Vertex indices. Triangles must share vertex indices, or hold equal coordinates, along
        common edges for their coverage to be without cracks.
    width, height : int
        Pixels.

    Returns
    -------
    Fragments
    """
    clip_vertices = np.asarray(clip_vertices, dtype=np.float64)
    triangles = np.ascontiguousarray(triangles, dtype=np.int32).reshape(-1, 3)
    vertices, pieces = _before_near_plane(clip_vertices, triangles)
    screen = _on_screen(vertices, width, height)
    pixel, triangle, depth = [], [], []
    rows = max(1, BAND // width)
    for low in range(0, height, rows):
        high = min(low + rows, height)
        found = _visible_in_rows(screen, pieces, width, low, high)
        for values, kept in zip(found, (pixel, triangle, depth), strict=True):
            kept.append(values)
    pixel, triangle = np.concatenate(pixel), np.concatenate(triangle)
    weights, front = _barycentrics(clip_vertices, triangles, pixel, triangle, width, height)
    return Fragments(pixel, triangle, weights, front, np.concatenate(depth))


def _before_near_plane(vertices: np.ndarray, triangles: np.ndarray) -> tuple[np.ndarray, _Pieces]:
    """Cut triangles that cross the near plane, drop those behind it; more vertices may come out."""
    inside = vertices[:, 2] + vertices[:, 3] >= 0
    a, b, c = np.ascontiguousarray(triangles.T)
    if inside.all():
        return vertices, _Pieces((a, b, c), np.arange(len(triangles), dtype=np.int32))
    count = inside[a].astype(np.int8) + inside[b] + inside[c]
    whole = np.flatnonzero(count == 3).astype(np.int32)
    cut = np.flatnonzero((count == 1) | (count == 2)).astype(np.int32)
    added, new_corners, new_triangle = _cut_triangles(vertices, triangles, inside, cut)
    triangle = np.concatenate([whole, new_triangle])
    order = np.argsort(triangle, kind="stable")
    corners = np.concatenate([triangles[whole], new_corners])[order]
    return (
        np.concatenate([vertices, added]),
        _Pieces(tuple(np.ascontiguousarray(corners.T)), triangle[order]),
    )


def _cut_triangles(
    vertices: np.ndarray, triangles: np.ndarray, inside: np.ndarray, cut: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The parts of crossing triangles inside the near plane, as triangles.

    Each crossing triangle has one vertex alone on its side, and two edges from there to the other
    side. With that vertex inside a triangle remains, else a quadrangle.

    Returns
    -------
    added : (2 K, 4) crossing points; corners : (K', 3) int32; triangle : (K',) int32
    """
    corners = triangles[cut]
    sides = inside[corners]
    keep_one = sides.sum(axis=1) == 1
    alone = np.argmax(sides == keep_one[:, None], axis=1)
    turned = (alone[:, None] + np.arange(3)) % 3
    apex, left, right = np.take_along_axis(corners, turned, axis=1).T
    added = np.concatenate([_crossings(vertices, apex, left), _crossings(vertices, apex, right)])
    on_left = np.arange(len(cut), dtype=np.int32) + len(vertices)
    on_right = on_left + len(cut)
    tip, base = keep_one, ~keep_one
    new_corners = np.concatenate(
        [
            np.stack([apex, on_left, on_right], axis=1)[tip],
            np.stack([on_left, left, right], axis=1)[base],
            np.stack([on_left, right, on_right], axis=1)[base],
        ]
    )
    return added, new_corners.astype(np.int32), np.concatenate([cut[tip], cut[base], cut[base]])


def _crossings(vertices: np.ndarray, first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """(K, 4) where edges meet the near plane, the same whichever way round an edge is given."""
    low, high = vertices[np.minimum(first, second)], vertices[np.maximum(first, second)]
    beyond_low, beyond_high = low[:, 2] + low[:, 3], high[:, 2] + high[:, 3]
    t = (beyond_low / (beyond_low - beyond_high))[:, None]
    return low + t * (high - low)


def _on_screen(vertices: np.ndarray, width: int, height: int) -> _Screen:
    x, y, z, w = vertices.T
    inverse = np.divide(1.0, w, out=np.zeros(len(w)), where=w > 0)
    x = (x * inverse + 1.0) * (0.5 * width)
    y = (y * inverse + 1.0) * (0.5 * height)
    column = np.clip(np.ceil(x - 0.5), 0, width).astype(np.int32)
    row = np.clip(np.ceil(y - 0.5), 0, height).astype(np.int32)
    return _Screen(x, y, z * inverse, row << 16 | column)


def _visible_in_rows(
    screen: _Screen, pieces: _Pieces, width: int, low: int, high: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Pixels, triangles and depths that are seen in the rows from `low` up to before `high`."""
    screen = screen.within(low, high)
    nearest = np.full((high - low) * width, np.nextafter(1.0, 2.0))  # just beyond the far plane
    owner = np.full((high - low) * width, -1, dtype=np.int32)
    for start in range(0, len(pieces.triangle), BLOCK):
        block = slice(start, start + BLOCK)
        corners = tuple(corner[block] for corner in pieces.corners)
        for spans in _spans(screen, corners, pieces.triangle[block], width):
            spans.start[:] -= low * width
            for part in _blocks(spans.count):
                _draw(_Spans(*(values[part] for values in spans)), nearest, owner)
    pixel = np.flatnonzero(owner >= 0)
    return (pixel + low * width).astype(np.int32), owner[pixel], nearest[pixel]


def _spans(
    screen: _Screen, corners: tuple[np.ndarray, ...], triangle: np.ndarray, width: int
) -> Iterator[_Spans]:
    """The spans of a block of triangles, in the order of the triangles."""
    a, b, c = corners
    # Corners with the same first row or column of pixel centres have no centre between them.
    at = screen.centre.take(a)
    apart = at ^ screen.centre.take(b)
    apart |= at ^ screen.centre.take(c)
    holds = np.flatnonzero((apart > COLUMN) & (apart & COLUMN != 0))
    if len(holds) < len(a):
        a, b, c, triangle = (values.take(holds) for values in (a, b, c, triangle))
    a, b, c = _by_height(screen.y, a, b, c)
    bottom, middle, top = (screen.centre.take(corner) >> 16 for corner in (a, b, c))
    low, mid, high = (_corner(screen, corner) for corner in (a, b, c))
    gradient = _depth_gradient(low, mid, high)
    long_edge, lower_edge, upper_edge = _edge(low, high), _edge(low, mid), _edge(mid, high)
    short_edges = tuple(np.concatenate(pair) for pair in zip(lower_edge, upper_edge, strict=True))
    for part in _blocks(top - bottom):
        first, rows = bottom[part], (top - bottom)[part]
        piece = np.repeat(np.arange(part.start, part.stop), rows)
        row = _counted(first, rows)
        short = piece + len(middle) * (row >= middle.take(piece))
        line = row + 0.5
        one, other = _crossing(long_edge, piece, line), _crossing(short_edges, short, line)
        first, last = _between(one, other, width)
        kept = np.flatnonzero(first < last)
        piece, row, first, last = (values.take(kept) for values in (piece, row, first, last))
        spans = _with_depth(row, piece, first, last, gradient, width)
        yield spans._replace(triangle=triangle.take(piece))


class _Corner(NamedTuple):
    """One corner of each of some triangles: pixels, and z / w."""

    x: np.ndarray
    y: np.ndarray
    depth: np.ndarray


def _corner(screen: _Screen, vertex: np.ndarray) -> _Corner:
    return _Corner(screen.x.take(vertex), screen.y.take(vertex), screen.depth.take(vertex))


def _crossing(
    edges: tuple[np.ndarray, np.ndarray, np.ndarray], edge: np.ndarray, line: np.ndarray
) -> np.ndarray:
    """x where edges cross horizontal lines."""
    x, y, slope = edges
    crossing = line - y.take(edge)
    crossing *= slope.take(edge)
    crossing += x.take(edge)
    return crossing


def _between(one: np.ndarray, other: np.ndarray, width: int) -> tuple[np.ndarray, np.ndarray]:
    """The first column whose centre is between two crossings, and that after the last."""
    columns = []
    for x in (np.minimum(one, other), np.maximum(one, other)):
        x -= 0.5
        np.ceil(x, out=x)
        np.maximum(x, 0, out=x)
        columns.append(np.minimum(x, width, out=x))
    return columns[0], columns[1]


def _with_depth(
    row: np.ndarray,
    piece: np.ndarray,
    first: np.ndarray,
    last: np.ndarray,
    gradient: tuple[np.ndarray, ...],
    width: int,
) -> _Spans:
    """Spans, their triangles still counted within the block."""
    along, upward, base, nearest, farthest = (values.take(piece) for values in gradient)
    upward *= row + 0.5
    base += upward
    ends = []
    for column in (first + 0.5, last - 0.5):
        column *= along
        column += base
        # A sliver's gradient may be all rounding: no depth outside the triangle's own comes of it.
        np.maximum(column, nearest, out=column)
        ends.append(np.minimum(column, farthest, out=column))
    start, end = ends
    steps = last - first
    end -= start
    end /= np.maximum(steps - 1, 1)
    return _Spans(
        start=row * width + first.astype(np.intp),
        count=steps.astype(np.intp),
        depth=start,
        slope=end,
        triangle=piece,
    )


def _draw(spans: _Spans, nearest: np.ndarray, owner: np.ndarray) -> None:
    """Put the pixels of spans into the depth buffer.

    Of several depths written to one pixel an arbitrary one stays. Whoever is nearer than what
    stayed writes again, until nobody is: a few rounds, since each leaves only the losers that are
    in front of the winner.
    """
    span = np.repeat(np.arange(len(spans.count)), spans.count)
    pixel = _counted(spans.start, spans.count)
    depth = pixel - spans.start.take(span)
    depth = depth * spans.slope.take(span)
    depth += spans.depth.take(span)
    closer = np.flatnonzero(depth < nearest.take(pixel))
    span, pixel, depth = span.take(closer), pixel.take(closer), depth.take(closer)
    where, what = pixel, depth
    while len(where):
        nearest[where] = what
        closer = np.flatnonzero(what < nearest.take(where))
        where, what = where.take(closer), what.take(closer)
    # Backwards, so that of equal depths the first triangle is written last and stays.
    won = np.flatnonzero(depth == nearest.take(pixel))[::-1]
    owner[pixel.take(won)] = spans.triangle.take(span.take(won))


def _blocks(count: np.ndarray) -> Iterator[slice]:
    """Slices that hold up to `BLOCK` of what `count` counts, or one entry that has more."""
    total = np.cumsum(count, dtype=np.int64)
    start = done = 0
    while start < len(count):
        stop = max(int(np.searchsorted(total, done + BLOCK, side="right")), start + 1)
        yield slice(start, stop)
        start, done = stop, int(total[stop - 1])


def _counted(first: np.ndarray, count: np.ndarray) -> np.ndarray:
    """first[0], first[0] + 1, ... `count[0]` of them, then those of first[1] and so on, intp."""
    stop = np.cumsum(count)
    shift = first + count
    shift -= stop
    number = np.repeat(shift, count)
    number += np.arange(len(number))
    return number


def _by_height(
    y: np.ndarray, a: np.ndarray, b: np.ndarray, c: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Corners from the lowest to the highest."""

    def ordered(one: np.ndarray, other: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        swap = y.take(one) > y.take(other)
        return np.where(swap, other, one), np.where(swap, one, other)

    a, b = ordered(a, b)
    b, c = ordered(b, c)
    a, b = ordered(a, b)
    return a, b, c


def _edge(low: _Corner, high: _Corner) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """x and y of the lower end, and how far x goes for each unit up."""
    rise = high.y - low.y
    rise[rise == 0] = np.inf
    return low.x, low.y, (high.x - low.x) / rise


def _depth_gradient(a: _Corner, b: _Corner, c: _Corner) -> tuple[np.ndarray, ...]:
    """depth = along x + upward y + base, and the least and largest depth of a triangle.

    z / w of a plane is affine on screen, under perspective too.
    """
    xb, yb, depth_b = b.x - a.x, b.y - a.y, b.depth - a.depth
    xc, yc, depth_c = c.x - a.x, c.y - a.y, c.depth - a.depth
    inverse = xb * yc - xc * yb
    inverse[inverse == 0] = np.inf
    np.divide(1, inverse, out=inverse)
    along = (depth_b * yc - depth_c * yb) * inverse
    upward = (depth_c * xb - depth_b * xc) * inverse
    nearest = np.minimum(np.minimum(a.depth, b.depth), c.depth)
    farthest = np.maximum(np.maximum(a.depth, b.depth), c.depth)
    return along, upward, a.depth - along * a.x - upward * a.y, nearest, farthest


def _barycentrics(
    vertices: np.ndarray,
    triangles: np.ndarray,
    pixel: np.ndarray,
    triangle: np.ndarray,
    width: int,
    height: int,
) -> tuple[np.ndarray, np.ndarray]:
    """Perspective-correct weights of whole triangles at the centres of pixels, and which face them.

    Homogeneous edge functions (Olano and Greer, "Triangle Scan Conversion using 2D Homogeneous
    Coordinates", 1997), which hold for triangles that reach behind the eye as well. Taken relative
    to the pixel, so that small triangles lose no digits.
    """
    w = vertices[:, 3]
    x, y, w = (vertices[:, 0] + w) * (0.5 * width), (vertices[:, 1] + w) * (0.5 * height), w.copy()
    corners = np.ascontiguousarray(triangles.T)
    weights = np.empty((3, len(pixel)), dtype=np.float32)
    front = np.empty(len(pixel), dtype=bool)
    for start in range(0, len(pixel), BLOCK):
        part = slice(start, start + BLOCK)
        row, column = np.divmod(pixel[part], np.int32(width))
        column, row = column + 0.5, row + 0.5
        offsets = []
        for corner in corners:
            vertex = corner.take(triangle[part]).astype(np.intp)
            depth = w.take(vertex)
            offsets.append((x.take(vertex) - column * depth, y.take(vertex) - row * depth))
        (ax, ay), (bx, by), (cx, cy) = offsets
        one, two, three = bx * cy - cx * by, cx * ay - ax * cy, ax * by - bx * ay
        total = one + two
        total += three
        np.greater_equal(total, 0, out=front[part])
        with np.errstate(divide="ignore"):
            np.divide(1, total, out=total)
        # A triangle without an area on screen has no weights.
        lost = np.isinf(total)
        total[lost] = 0
        for edge, out in zip((one, two, three), weights[:, part], strict=True):
            edge *= total
            np.maximum(edge, 0, out=edge)
            out[:] = edge
        weights[:, part][:, lost] = 1 / 3
    return weights.T, front
