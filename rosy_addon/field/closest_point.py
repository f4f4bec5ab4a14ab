"""Find the triangle of a surface that is closest to each of many points, with a uniform grid."""

import numpy as np

from ..core.progress import report
from .blocks import concatenated_ranges, row_blocks
from .frames import dot
from .surface import Surface

#: Approximate number of grid cells on the surface for each triangle.
CELLS_PER_TRIANGLE = 1.0

#: Largest extent in cells of a triangle in the grid, along each axis. Larger triangles are tested
#: against every point.
MAX_CELLS_PER_AXIS = 8

#: Number of pairs of points and triangles that are processed at once, to bound memory.
MAX_PAIRS = 1 << 18

#: Text that is shown with the progress bar.
LABEL = "finding the closest faces"


def closest_triangles(
    surface: Surface, points: np.ndarray, max_distance: float = np.inf
) -> tuple[np.ndarray, np.ndarray]:
    """Find the triangle closest to each point.

    Parameters
    ----------
    surface : Surface
    points : (n, 3) float64 ndarray
        Positions in object space.
    max_distance : float
        Largest distance that matters, in object space. For a point that is farther away from the surface, the
        result may be a triangle that is not the closest one, or none.

    Returns
    -------
    triangle : (n,) int32 ndarray
        Index into `surface.triangles`; the smallest index if several triangles are equally close, and 0 if no
        triangle was found.
    distance : (n,) float64 ndarray
        Distance of the point from the triangle, in object space; infinite if no triangle was found.
    """
    report(0.0, LABEL)
    search = _ClosestSearch(surface, np.ascontiguousarray(points, dtype=np.float64).reshape(-1, 3))
    points, distance = search.points, search.distance
    is_near = (points >= search.origin - max_distance) & (points <= search.top + max_distance)
    unfinished = np.flatnonzero(is_near.all(axis=1))
    large = search.large_triangles
    search.update(np.repeat(unfinished, len(large)), np.tile(large, len(unfinished)))
    # Search rings of cells around the cell of each point. Stop when all triangles of the next ring are
    # farther away than the closest triangle so far, or farther than the maximum distance.
    ring = 0
    while len(unfinished):
        report(1 - len(unfinished) / len(points), LABEL)
        search.search_ring(unfinished, ring)
        ring += 1
        searched = (ring - 1) * search.cell_size + search.distance_to_cell_border(unfinished)
        is_open = np.minimum(distance[unfinished], max_distance) > searched
        unfinished = unfinished[is_open & (ring <= search.max_ring)]
    return search.triangle, distance


class _ClosestSearch:
    """State of the search for closest triangles: a uniform grid of cubic cells, and the results so far.

    Each cell lists the triangles whose bounding boxes touch the cell.

    Attributes
    ----------
    points : (n, 3) float64 ndarray
        Points for which the closest triangle is searched.
    triangle : (n,) int32 ndarray
        Closest triangle of each point so far.
    distance : (n,) float64 ndarray
        Distance of each point from that triangle; infinite before the first one is found.
    """

    def __init__(self, surface: Surface, points: np.ndarray) -> None:
        self.points = points
        self.triangle = np.zeros(len(points), dtype=np.int32)
        self.distance = np.full(len(points), np.inf)
        self.corners = surface.vertices[surface.triangle_vertex]
        low, high = self.corners.min(axis=1), self.corners.max(axis=1)
        self.origin, self.top = low.min(axis=0), high.max(axis=0)
        extent = self.top - self.origin
        longest = max(float(extent.max()), 1e-300)
        # Choose the cell size so that the surface passes through about CELLS_PER_TRIANGLE * T cells. The area of
        # the surface is estimated by the area of its bounding cube.
        self.cell_size = longest / max(np.sqrt(CELLS_PER_TRIANGLE * len(self.corners) / 6), 1)
        self.shape = np.maximum((extent / self.cell_size).astype(np.int64) + 1, 1)
        self.max_ring = int(self.shape.max()) + 1
        first, last = self._cells_of(low), self._cells_of(high)
        is_large = (last - first).max(axis=1) >= MAX_CELLS_PER_AXIS
        self.large_triangles = np.flatnonzero(is_large).astype(np.int32)
        small = np.flatnonzero(~is_large)
        span = last[small] - first[small] + 1
        count = span.prod(axis=1)
        spans = np.repeat(span, count, axis=0)
        cell_number = concatenated_ranges(np.zeros_like(count), count)
        column, z = np.divmod(cell_number, spans[:, 2])
        offset = np.stack([*np.divmod(column, spans[:, 1]), z], axis=1)
        owner = np.repeat(small, count)
        cell_key = self._keys_of(first[owner] + offset)
        order = np.argsort(cell_key, kind="stable")
        self.key, self.cell_triangle = cell_key[order], owner[order].astype(np.int32)

    def _cells_of(self, points: np.ndarray) -> np.ndarray:
        """Return the (n, 3) int64 cells that contain points, or are nearest to points outside of the grid."""
        return np.clip(np.floor(self._in_cells(points)), 0, self.shape - 1).astype(np.int64)

    def _in_cells(self, points: np.ndarray) -> np.ndarray:
        """Return (n, 3) positions of points in grid coordinates, in which cells have the size 1.

        Points far outside of the grid are moved next to it.
        """
        margin = self.cell_size
        points = np.clip(points, self.origin - margin, self.top + margin)
        return (points - self.origin) / self.cell_size

    def _keys_of(self, cell: np.ndarray) -> np.ndarray:
        """Return one int64 key for each of (n, 3) cells, for sorting."""
        return (cell[:, 0] * self.shape[1] + cell[:, 1]) * self.shape[2] + cell[:, 2]

    def distance_to_cell_border(self, selection: np.ndarray) -> np.ndarray:
        """Return (k,) distances, in object space, of selected points from the nearest side of their cell.

        `selection` holds the (k,) indices of the points. Distances are 0 for points outside of the grid.
        """
        points = self.points[selection]
        fraction = self._in_cells(points) - self._cells_of(points)
        return np.maximum(np.minimum(fraction, 1 - fraction).min(axis=1), 0) * self.cell_size

    def search_ring(self, selection: np.ndarray, ring: int) -> None:
        """Test the selected points against the triangles in one ring of cells around the cell of each point.

        `selection` holds the (k,) indices of the points. `ring` is the distance of the ring in cells; 0 is
        the cell of the point.
        """
        side = np.arange(-ring, ring + 1)
        offset = np.stack(np.meshgrid(side, side, side, indexing="ij"), axis=-1).reshape(-1, 3)
        offset = offset[np.abs(offset).max(axis=1) == ring]
        block, size = max(MAX_PAIRS // (8 * len(offset)), 1), self.cell_size
        for start in range(0, len(selection), block):
            report(1 - (len(selection) - start) / len(self.points), LABEL)
            chunk = selection[start : start + block]
            own_cell = self._cells_of(self.points[chunk])
            cell = (own_cell[:, None] + offset).reshape(-1, 3)
            limit = np.repeat(self.distance[chunk], len(offset))
            exists = ((cell >= 0) & (cell < self.shape)).all(axis=1)
            # The distances of the points from the boxes of the cells.
            position = (self.points[chunk] - self.origin - own_cell * size)[:, None]
            gap = np.maximum(
                np.maximum(offset * size - position, position - (offset + 1) * size), 0
            )
            exists &= np.sqrt(dot(gap, gap)).ravel() < limit
            key = self._keys_of(cell[exists])
            first = np.searchsorted(self.key, key, side="left")
            count = np.searchsorted(self.key, key, side="right") - first
            point = np.repeat(np.repeat(chunk, len(offset))[exists], count)
            self.update(point, self.cell_triangle[concatenated_ranges(first, count)])

    def update(self, owner: np.ndarray, candidate: np.ndarray) -> None:
        """Update the results, given (m,) pairs of a point and a candidate for its closest triangle.

        Pair i consists of the point with the index ``owner[i]`` and the triangle with the index ``candidate[i]``.
        """
        for block in row_blocks(len(owner), MAX_PAIRS):
            point, triangle = owner[block], candidate[block]
            distance = point_triangle_distances(self.points[point], self.corners[triangle])
            is_tied = (distance == self.distance[point]) & (triangle < self.triangle[point])
            is_closer = (distance < self.distance[point]) | is_tied
            point, triangle, distance = point[is_closer], triangle[is_closer], distance[is_closer]
            # Sort so that the best candidate of a point is stored last.
            order = np.lexsort((triangle, distance))[::-1]
            self.distance[point[order]] = distance[order]
            self.triangle[point[order]] = triangle[order]


def point_triangle_distances(points: np.ndarray, corners: np.ndarray) -> np.ndarray:
    """Return the (n,) distances of (n, 3) points from one triangle each, with (n, 3, 3) corners."""
    a, b, c = (corners[:, k] for k in range(3))
    normal = np.cross(b - a, c - a)
    size = np.sqrt(dot(normal, normal))
    plane_distance = np.abs(dot(points - a, normal)) / np.where(size > 0, size, 1)
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
