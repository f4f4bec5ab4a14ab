"""The nearest place of a surface to points: what a stroke lies on, and where a field comes from."""

from __future__ import annotations

import numpy as np

from .frames import dot
from .surface import Surface

#: Cells of the grid for each triangle, about.
CELLS = 1.0

#: A triangle is entered into at most so many cells along each axis of the grid; larger ones are
#: looked at for every point.
WIDEST = 8

#: Pairs of points and triangles that are measured at once: bounds memory.
PAIRS = 1 << 18


def nearest_triangles(surface: Surface, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The triangle nearest to each point.

    Parameters
    ----------
    surface : Surface
    points : (n, 3) float64 ndarray
        Object space.

    Returns
    -------
    triangle : (n,) int32 ndarray
        Into `surface.triangles`; of several equally near ones, the first.
    distance : (n,) float64 ndarray
        Blender units.
    """
    grid = _Grid(surface)
    points = np.ascontiguousarray(points, dtype=np.float64).reshape(-1, 3)
    triangle = np.zeros(len(points), dtype=np.int32)
    distance = np.full(len(points), np.inf)
    if len(grid.large):
        every = np.arange(len(points))
        grid.measure(
            points,
            np.repeat(every, len(grid.large)),
            np.tile(grid.large, len(points)),
            triangle,
            distance,
        )
    # Rings of cells around a point's own, until nothing nearer can be in the next.
    left = np.arange(len(points))
    ring = 0
    while len(left):
        grid.look(points, left, ring, triangle, distance)
        ring += 1
        reach = (ring - 1) * grid.size + grid.inside(points[left])
        left = left[(distance[left] > reach) & (ring <= grid.most)]
    return triangle, distance


class _Grid:
    """Triangles by the cells of a grid that their boxes touch."""

    def __init__(self, surface: Surface) -> None:
        corners = surface.vertices[surface.triangle_vertex]
        self.corners = corners
        low, high = corners.min(axis=1), corners.max(axis=1)
        self.origin = low.min(axis=0)
        extent = high.max(axis=0) - self.origin
        longest = max(float(extent.max()), 1e-300)
        # A surface of T triangles passes about as many cells if T cells cover its area.
        self.size = longest / max(np.sqrt(CELLS * len(corners) / 6), 1)
        self.shape = np.maximum((extent / self.size).astype(np.int64) + 1, 1)
        self.most = int(self.shape.max()) + 1
        first, last = self._cell(low), self._cell(high)
        wide = (last - first).max(axis=1) >= WIDEST
        self.large = np.flatnonzero(wide).astype(np.int32)
        small = np.flatnonzero(~wide)
        span = last[small] - first[small] + 1
        count = span.prod(axis=1)
        entry = np.repeat(np.arange(len(small)), count)
        number = np.arange(count.sum()) - np.repeat(np.cumsum(count) - count, count)
        spans = span[entry]
        offset = np.stack(
            [
                number // (spans[:, 1] * spans[:, 2]),
                number // spans[:, 2] % spans[:, 1],
                number % spans[:, 2],
            ],
            axis=1,
        )
        key = self._key(first[small][entry] + offset)
        order = np.argsort(key, kind="stable")
        self.key, self.triangle = key[order], small[entry][order].astype(np.int32)

    def _cell(self, points: np.ndarray) -> np.ndarray:
        cell = np.floor((points - self.origin) / self.size).astype(np.int64)
        return np.clip(cell, 0, self.shape - 1)

    def _key(self, cell: np.ndarray) -> np.ndarray:
        return (cell[:, 0] * self.shape[1] + cell[:, 1]) * self.shape[2] + cell[:, 2]

    def inside(self, points: np.ndarray) -> np.ndarray:
        """How far points are, at least, from the border of their cell; 0 outside of the grid."""
        within = (points - self.origin) / self.size - self._cell(points)
        return np.maximum(np.minimum(within, 1 - within).min(axis=1), 0) * self.size

    def look(
        self,
        points: np.ndarray,
        chosen: np.ndarray,
        ring: int,
        triangle: np.ndarray,
        distance: np.ndarray,
    ) -> None:
        """Measure the chosen points against all in the cells `ring` away from theirs."""
        side = np.arange(-ring, ring + 1)
        offset = np.stack(np.meshgrid(side, side, side, indexing="ij"), axis=-1).reshape(-1, 3)
        offset = offset[np.abs(offset).max(axis=1) == ring]
        block = max(PAIRS // (8 * len(offset)), 1)
        for start in range(0, len(chosen), block):
            some = chosen[start : start + block]
            cell = (self._cell(points[some])[:, None] + offset).reshape(-1, 3)
            exists = ((cell >= 0) & (cell < self.shape)).all(axis=1)
            exists &= self._away(points[some], offset) < np.repeat(distance[some], len(offset))
            key = self._key(cell[exists])
            first = np.searchsorted(self.key, key, side="left")
            count = np.searchsorted(self.key, key, side="right") - first
            owner = np.repeat(some, len(offset))[exists]
            place = np.arange(count.sum()) - np.repeat(np.cumsum(count) - count - first, count)
            self.measure(points, np.repeat(owner, count), self.triangle[place], triangle, distance)

    def _away(self, points: np.ndarray, offset: np.ndarray) -> np.ndarray:
        """(n k,) how far n points are from the k cells at some offset from their own."""
        within = ((points - self.origin) / self.size - self._cell(points))[:, None]
        gap = np.maximum(np.maximum(offset - within, within - offset - 1), 0)
        return np.sqrt(dot(gap, gap)).ravel() * self.size

    def measure(
        self,
        points: np.ndarray,
        owner: np.ndarray,
        candidate: np.ndarray,
        triangle: np.ndarray,
        distance: np.ndarray,
    ) -> None:
        """Note the nearest of candidates for points, given as pairs."""
        for start in range(0, len(owner), PAIRS):
            point, other = owner[start : start + PAIRS], candidate[start : start + PAIRS]
            found = distances(points[point], self.corners[other])
            order = np.lexsort((other, found, point))
            point, other, found = point[order], other[order], found[order]
            first = np.flatnonzero(np.concatenate([[True], point[1:] != point[:-1]]))
            point, other, found = point[first], other[first], found[first]
            nearer = (found < distance[point]) | (
                (found == distance[point]) & (other < triangle[point])
            )
            distance[point[nearer]], triangle[point[nearer]] = found[nearer], other[nearer]


def distances(points: np.ndarray, corners: np.ndarray) -> np.ndarray:
    """(n,) distances of (n, 3) points from (n, 3, 3) triangles."""
    a, b, c = (corners[:, k] for k in range(3))
    normal = np.cross(b - a, c - a)
    size = np.sqrt(dot(normal, normal))
    flat = np.where(size > 0, size, 1)
    above = np.abs(dot(points - a, normal)) / flat
    inside = size > 0
    nearest = np.full(len(points), np.inf)
    for start, stop in ((a, b), (b, c), (c, a)):
        edge, toward = stop - start, points - start
        inside &= dot(np.cross(edge, toward), normal) >= 0
        length = dot(edge, edge)
        share = np.clip(dot(toward, edge) / np.where(length > 0, length, 1), 0, 1)
        off = toward - share[:, None] * edge
        np.minimum(nearest, np.sqrt(dot(off, off)), out=nearest)
    return np.where(inside, above, nearest)
