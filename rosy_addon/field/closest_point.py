"""Find the triangle of a surface that is closest to each of many points, with a uniform grid."""

from __future__ import annotations

import numpy as np

from ..progress import report
from .frames import dot
from .surface import Surface

#: Approximate number of grid cells on the surface for each triangle.
CELLS_PER_TRIANGLE = 1.0

#: Largest extent in cells of a triangle in the grid, along each axis. Larger triangles are tested
#: against every point.
MAX_CELLS_PER_AXIS = 8

#: Pairs of points and triangles processed at once, to bound memory.
MAX_PAIRS = 1 << 18


def closest_triangles(
    surface: Surface, points: np.ndarray, max_distance: float = np.inf
) -> tuple[np.ndarray, np.ndarray]:
    """Find the triangle closest to each point.

    Parameters
    ----------
    surface : Surface
    points : (n, 3) float64 ndarray
        Object space.
    max_distance : float
        The results of points farther away than this are of any triangle, or of none.

    Returns
    -------
    triangle : (n,) int32 ndarray
        Index into `surface.triangles`; the smallest one, if several are equally close.
    distance : (n,) float64 ndarray
        Distance of the point from the triangle, Blender units; infinite if no triangle was found.
    """
    label = "finding the closest faces"
    report(0.0, label)
    grid = _TriangleGrid(surface)
    grid.fill()
    points = np.ascontiguousarray(points, dtype=np.float64).reshape(-1, 3)
    triangle = np.zeros(len(points), dtype=np.int32)
    distance = np.full(len(points), np.inf)
    is_near = (points >= grid.origin - max_distance) & (points <= grid.top + max_distance)
    unfinished = np.flatnonzero(is_near.all(axis=1))
    if len(grid.large_triangles):
        grid.update_closest(
            points,
            np.repeat(unfinished, len(grid.large_triangles)),
            np.tile(grid.large_triangles, len(unfinished)),
            triangle,
            distance,
        )
    # Search rings of cells around the cell of each point, until the next ring cannot hold a closer
    # triangle, or only ones beyond the maximum distance.
    ring = 0
    while len(unfinished):
        report(1 - len(unfinished) / len(points), label)
        grid.search_ring(points, unfinished, ring, triangle, distance)
        ring += 1
        searched_distance = (ring - 1) * grid.cell_size + grid.distance_to_cell_border(
            points[unfinished]
        )
        unfinished = unfinished[
            (np.minimum(distance[unfinished], max_distance) > searched_distance)
            & (ring <= grid.max_ring)
        ]
    return triangle, distance


class _TriangleGrid:
    """A uniform grid of cubic cells, each with the triangles whose bounding boxes touch it."""

    def __init__(self, surface: Surface) -> None:
        corners = surface.vertices[surface.triangle_vertex]
        self.corners = corners
        low, high = corners.min(axis=1), corners.max(axis=1)
        self.origin, self.top = low.min(axis=0), high.max(axis=0)
        extent = self.top - self.origin
        longest = max(float(extent.max()), 1e-300)
        # The surface passes through about T cells if T cell faces have the area of its bounding box,
        # which has six sides.
        self.cell_size = longest / max(np.sqrt(CELLS_PER_TRIANGLE * len(corners) / 6), 1)
        self.shape = np.maximum((extent / self.cell_size).astype(np.int64) + 1, 1)
        self.max_ring = int(self.shape.max()) + 1
        self._low, self._high = low, high

    def fill(self) -> None:
        """Find the cells of the triangles. Call this first."""
        low, high = self._low, self._high
        first = self._cells_of(low)
        last = self._cells_of(high)
        is_large = (last - first).max(axis=1) >= MAX_CELLS_PER_AXIS
        self.large_triangles = np.flatnonzero(is_large).astype(np.int32)
        small = np.flatnonzero(~is_large)
        span = last[small] - first[small] + 1
        count = span.prod(axis=1)
        entry = np.repeat(np.arange(len(small)), count)
        cell_number = np.arange(count.sum()) - np.repeat(np.cumsum(count) - count, count)
        spans = span[entry]
        offset = np.stack(
            [
                cell_number // (spans[:, 1] * spans[:, 2]),
                cell_number // spans[:, 2] % spans[:, 1],
                cell_number % spans[:, 2],
            ],
            axis=1,
        )
        cell_key = self._keys_of(first[small][entry] + offset)
        order = np.argsort(cell_key, kind="stable")
        self.key, self.cell_triangle = cell_key[order], small[entry][order].astype(np.int32)

    def _cells_of(self, points: np.ndarray) -> np.ndarray:
        """(n, 3) int64 cells of points; the nearest cell for points outside of the grid."""
        return np.clip(np.floor(self._in_cells(points)), 0, self.shape - 1).astype(np.int64)

    def _in_cells(self, points: np.ndarray) -> np.ndarray:
        """(n, 3) positions of points in cells; those far outside of the grid are moved beside it."""
        margin = self.cell_size
        points = np.clip(points, self.origin - margin, self.top + margin)
        return (points - self.origin) / self.cell_size

    def _keys_of(self, cell: np.ndarray) -> np.ndarray:
        """(n,) int64: (n, 3) cells as single numbers, to sort by."""
        return (cell[:, 0] * self.shape[1] + cell[:, 1]) * self.shape[2] + cell[:, 2]

    def distance_to_cell_border(self, points: np.ndarray) -> np.ndarray:
        """(n,) distances of points from the border of their cell; 0 outside of the grid."""
        fraction = self._in_cells(points) - self._cells_of(points)
        return np.maximum(np.minimum(fraction, 1 - fraction).min(axis=1), 0) * self.cell_size

    def search_ring(
        self,
        points: np.ndarray,
        selection: np.ndarray,
        ring: int,
        triangle: np.ndarray,
        distance: np.ndarray,
    ) -> None:
        """Test the selected points against the triangles in one ring of cells around their own.

        Parameters
        ----------
        points : (n, 3) float64 ndarray
        selection : (k,) int ndarray
            Points to test.
        ring : int
            Distance of the ring in cells, 0 for the cell of the point.
        triangle, distance : (n,) ndarray
            Closest triangles so far and their distances; updated in place.
        """
        side = np.arange(-ring, ring + 1)
        offset = np.stack(np.meshgrid(side, side, side, indexing="ij"), axis=-1).reshape(-1, 3)
        offset = offset[np.abs(offset).max(axis=1) == ring]
        block = max(MAX_PAIRS // (8 * len(offset)), 1)
        for start in range(0, len(selection), block):
            report(1 - (len(selection) - start) / len(points), "finding the closest faces")
            chunk = selection[start : start + block]
            cell = (self._cells_of(points[chunk])[:, None] + offset).reshape(-1, 3)
            exists = ((cell >= 0) & (cell < self.shape)).all(axis=1)
            exists &= self._cell_distances(points[chunk], offset) < np.repeat(
                distance[chunk], len(offset)
            )
            key = self._keys_of(cell[exists])
            first = np.searchsorted(self.key, key, side="left")
            count = np.searchsorted(self.key, key, side="right") - first
            point = np.repeat(chunk, len(offset))[exists]
            entry = np.arange(count.sum()) - np.repeat(np.cumsum(count) - count - first, count)
            self.update_closest(
                points, np.repeat(point, count), self.cell_triangle[entry], triangle, distance
            )

    def _cell_distances(self, points: np.ndarray, offset: np.ndarray) -> np.ndarray:
        """(n k,) distances of n points from the k cells at the given offsets from their own."""
        size = self.cell_size
        position = (points - self.origin - self._cells_of(points) * size)[:, None]
        gap = np.maximum(np.maximum(offset * size - position, position - (offset + 1) * size), 0)
        return np.sqrt(dot(gap, gap)).ravel()

    def update_closest(
        self,
        points: np.ndarray,
        owner: np.ndarray,
        candidate: np.ndarray,
        triangle: np.ndarray,
        distance: np.ndarray,
    ) -> None:
        """Update the closest triangles with pairs of points and candidate triangles.

        Parameters
        ----------
        points : (n, 3) float64 ndarray
        owner, candidate : (p,) int ndarray
            Point and triangle of each pair.
        triangle, distance : (n,) ndarray
            Closest triangles so far and their distances; updated in place.
        """
        for start in range(0, len(owner), MAX_PAIRS):
            point, triangle_index = (
                owner[start : start + MAX_PAIRS],
                candidate[start : start + MAX_PAIRS],
            )
            candidate_distance = point_triangle_distances(
                points[point], self.corners[triangle_index]
            )
            order = np.lexsort((triangle_index, candidate_distance, point))
            point, triangle_index, candidate_distance = (
                point[order],
                triangle_index[order],
                candidate_distance[order],
            )
            first = np.flatnonzero(np.concatenate([[True], point[1:] != point[:-1]]))
            point, triangle_index, candidate_distance = (
                point[first],
                triangle_index[first],
                candidate_distance[first],
            )
            is_closer = (candidate_distance < distance[point]) | (
                (candidate_distance == distance[point]) & (triangle_index < triangle[point])
            )
            distance[point[is_closer]], triangle[point[is_closer]] = (
                candidate_distance[is_closer],
                triangle_index[is_closer],
            )


def point_triangle_distances(points: np.ndarray, corners: np.ndarray) -> np.ndarray:
    """(n,) distances of (n, 3) points from (n, 3, 3) triangles."""
    a, b, c = (corners[:, k] for k in range(3))
    normal = np.cross(b - a, c - a)
    size = np.sqrt(dot(normal, normal))
    safe_size = np.where(size > 0, size, 1)
    plane_distance = np.abs(dot(points - a, normal)) / safe_size
    inside = size > 0
    edge_distance = np.full(len(points), np.inf)
    for start, stop in ((a, b), (b, c), (c, a)):
        edge, to_point = stop - start, points - start
        inside &= dot(np.cross(edge, to_point), normal) >= 0
        length = dot(edge, edge)
        fraction = np.clip(dot(to_point, edge) / np.where(length > 0, length, 1), 0, 1)
        offset = to_point - fraction[:, None] * edge
        np.minimum(edge_distance, np.sqrt(dot(offset, offset)), out=edge_distance)
    return np.where(inside, plane_distance, edge_distance)
