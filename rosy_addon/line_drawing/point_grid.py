"""Hashed uniform grids for radius queries, to which points can be added and removed.

Points with very different search radii are stored in different levels: grids whose cells have different
sizes. So no cell holds many points, and no query visits many cells.
"""

from functools import cache

import numpy as np

from ..field.blocks import row_blocks
from ..field.formats.polygons import offsets_from_sizes
from ..field.frames import dot

#: Factors of the three cell coordinates, and of the level, in the hash.
_PRIMES = np.array([73856093, 19349663, 83492791], dtype=np.int64)
_LEVEL_PRIME = np.int64(49979687)

#: Ratio of the cell sides of two successive levels. Level 0 is for radii from 1 / 4 to 4 cells.
LEVEL_RATIO = 16.0

#: Largest radius of a query, in cells.
MAX_RINGS = 4

#: Number of points in a block. The points of a cell are stored in a linked list of blocks.
BLOCK_SIZE = 16

#: Queries with a direction find all points within `INNER_RATIO` of their radius. Points farther away are
#: found only if their offset along the direction is at most `BAND_RATIO` of the radius.
INNER_RATIO, BAND_RATIO = 0.6, 0.25

#: Number of queries that are answered at once. Their data fit into the caches of a CPU.
QUERY_BATCH_SIZE = 1 << 11


def grid_levels(radius: np.ndarray, cell: float) -> np.ndarray:
    """Return (n,) int64: the level in which a point with each search radius is stored.

    Levels are grids with cells of different sizes. `cell` is the side of a cell of level 0.
    """
    ratio = np.clip(radius / cell, 1e-300, 1e300)
    return np.floor(np.log(ratio) / np.log(LEVEL_RATIO) + 0.5).astype(np.int64)


class PointGrid:
    """Points in hashed uniform grids, for queries of the points within a radius.

    Parameters
    ----------
    cell : float
        Side of a cell of level 0. Queries are fastest if it is about their typical radius.
    expected_count : int
        Expected number of points. It sets the size of the hash table.

    Examples
    --------
    >>> grid = PointGrid(1.0, 2)
    >>> index = grid.add(np.array([[0.0, 0.0, 0.0], [3.0, 0.0, 0.0]]), np.array([0.5, 0.5]))
    >>> query, point = grid.pairs_within(np.zeros((1, 3)), np.array([0.5]))
    >>> point.tolist()
    [0]
    """

    def __init__(self, cell: float, expected_count: int) -> None:
        self.cell = cell
        #: The levels that have points.
        self.levels: set[int] = set()
        bits = int(np.clip(np.ceil(np.log2(max(expected_count, 2))), 10, 22))
        self.mask = np.int64((1 << bits) - 1)
        # The last block of each cell, and the number of its slots in use.
        self.last_block = np.full(1 << bits, -1, dtype=np.int32)
        self.last_block_fill = np.full(1 << bits, BLOCK_SIZE, dtype=np.int8)
        self.block_count = 0
        self.next_block = np.empty(128, dtype=np.int32)
        self.point_index = np.empty((128, BLOCK_SIZE), dtype=np.int32)
        # Free slots hold NaN, for which all comparisons are false.
        self.position = np.full((128, 3, BLOCK_SIZE), np.nan)
        self.point_count = 0
        self.point_slot = np.empty(1024, dtype=np.int32)

    def add(self, points: np.ndarray, radius: np.ndarray) -> np.ndarray:
        """Add points to the grid.

        Parameters
        ----------
        points : (n, 3) ndarray
        radius : (n,) ndarray
            Typical radius of queries near each point. It sets the level in which the point is stored.

        Returns
        -------
        (n,) int32 ndarray
            Indices of the points. They continue the indices of earlier calls.
        """
        level = grid_levels(radius, self.cell)
        self.levels.update(np.unique(level).tolist())
        first = self.point_count
        self.point_count += len(points)
        self.point_slot = grow_to(self.point_slot, self.point_count, 0)
        index = np.arange(first, self.point_count, dtype=np.int32)
        cell = self.cell * LEVEL_RATIO ** level.astype(np.float64)
        key = self._hash_cells(np.floor(points / cell[:, None]).astype(np.int64), level)
        order = np.argsort(key, kind="stable")
        key, group_start, group, group_size = np.unique(
            key[order], return_index=True, return_inverse=True, return_counts=True
        )
        last_block, block_fill = self.last_block[key], self.last_block_fill[key].astype(np.int64)
        # Fill the last block of each cell, then new blocks.
        chain_position = block_fill[group] + np.arange(len(points)) - group_start[group]
        new_blocks = (block_fill + group_size - 1) // BLOCK_SIZE
        first_new_block = self.block_count + offsets_from_sizes(new_blocks)[:-1]
        block_ordinal = chain_position // BLOCK_SIZE
        new_block = first_new_block[group] + block_ordinal - 1
        block = np.where(block_ordinal == 0, last_block[group], new_block)
        # Link the first new block of a cell to the block that was its last one, and others to the one before.
        count, self.block_count = self.block_count, self.block_count + int(new_blocks.sum())
        self.next_block = grow_to(self.next_block, self.block_count, -1)
        self.point_index = grow_to(self.point_index, self.block_count, -1)
        self.position = grow_to(self.position, self.block_count, np.nan)
        self.next_block[count : self.block_count] = np.arange(count, self.block_count) - 1
        grows = new_blocks > 0
        self.next_block[first_new_block[grows]] = last_block[grows]
        self.last_block[key[grows]] = (first_new_block + new_blocks - 1)[grows]
        self.last_block_fill[key] = block_fill + group_size - BLOCK_SIZE * new_blocks
        slot = chain_position % BLOCK_SIZE
        self.point_index[block, slot] = index[order]
        self.position[block, :, slot] = points[order]
        self.point_slot[index[order]] = block * BLOCK_SIZE + slot
        return index

    def remove(self, index: np.ndarray) -> None:
        """Remove the points with the given indices. Their indices are not used again."""
        block, slot = np.divmod(self.point_slot[index], BLOCK_SIZE)
        self.position[block, :, slot] = np.nan

    def pairs_within(
        self, points: np.ndarray, radius: np.ndarray, direction: np.ndarray | None = None
    ) -> tuple[np.ndarray, np.ndarray]:
        """Find the points of the grid within the radius of each query.

        Parameters
        ----------
        points : (n, 3) ndarray
            Centers of the queries.
        radius : (n,) ndarray
            Radii of the queries. Points that are farther away than `MAX_RINGS` cells of their level may be
            missed.
        direction : (n, 3) ndarray, optional
            Unit direction of each query. The query is then restricted to two parts of its ball: a smaller
            ball of `INNER_RATIO` times the radius, and a slab perpendicular to the direction, `BAND_RATIO`
            times the radius to both sides of the center.

        Returns
        -------
        query : (m,) intp ndarray
            Index of the query in each pair of a query and a point.
        point : (m,) int32 ndarray
            Index of the point. A pair may occur twice, because of hash collisions.
        """
        pairs = []
        for level in sorted(self.levels):
            cell = self.cell * LEVEL_RATIO**level
            rings = np.clip(np.ceil(radius / cell), 1, MAX_RINGS).astype(np.int64)
            for ring_count in np.unique(rings).tolist():
                queries = np.flatnonzero(rings == ring_count)
                for part in row_blocks(len(queries), QUERY_BATCH_SIZE):
                    batch = queries[part], level, ring_count
                    pairs += self._batch_pairs(points, radius * radius, *batch, direction)
        if not pairs:
            return np.empty(0, dtype=np.intp), np.empty(0, dtype=np.int32)
        return tuple(np.concatenate(column) for column in zip(*pairs, strict=True))

    def _batch_pairs(
        self,
        points: np.ndarray,
        radius_squared: np.ndarray,
        queries: np.ndarray,
        level: int,
        rings: int,
        direction: np.ndarray | None,
    ) -> list[tuple[np.ndarray, np.ndarray]]:
        """Find the points of one level within the radius of some queries.

        `points`, `radius_squared` and `direction` describe all queries of `pairs_within`. `queries` holds the
        indices of the queries that are answered here. Their radius is at most `rings` cells of this level.

        The linked lists of all cells are followed at the same time. For each step along the lists, there are
        two arrays in the result: indices of queries, and indices of points within their radius, row by row.
        """
        cell = self.cell * LEVEL_RATIO**level
        scaled = points.take(queries, axis=0) / cell
        corner = np.floor(scaled)
        ratio = np.sqrt(radius_squared.take(queries)) / cell
        if direction is not None:
            direction = direction.take(queries, axis=0)
        is_reached = _reached_cells(scaled - corner, ratio, rings, direction)
        row, column = np.divmod(np.flatnonzero(is_reached), is_reached.shape[1])
        cells = corner.astype(np.int64).take(row, axis=0)
        cells += _ring_offsets(rings).take(column, axis=0)
        block = self.last_block.take(self._hash_cells(cells, np.int64(level)))
        occupied = np.flatnonzero(block >= 0)
        block, row = block.take(occupied), row.take(occupied)
        pairs = []
        while len(block):
            delta = self.position.take(block, axis=0)
            query = queries.take(row)
            delta -= points.take(query, axis=0)[:, :, None]
            distance = np.einsum("nij,nij->nj", delta, delta)
            limit = radius_squared.take(query)[:, None]
            within = distance <= limit
            if direction is not None:
                along = np.einsum("nij,ni->nj", delta, direction.take(row, axis=0))
                is_in_band = along * along <= BAND_RATIO**2 * limit
                within &= (distance <= INNER_RATIO**2 * limit) | is_in_band
            hit_row, slot = np.divmod(np.flatnonzero(within), BLOCK_SIZE)
            point_slot = block.take(hit_row) * BLOCK_SIZE + slot
            pairs.append((query.take(hit_row), self.point_index.take(point_slot)))
            block = self.next_block.take(block)
            has_next = np.flatnonzero(block >= 0)
            block, row = block.take(has_next), row.take(has_next)
        return pairs

    def _hash_cells(self, cells: np.ndarray, level: np.ndarray) -> np.ndarray:
        x, y, z = (cells * _PRIMES).T
        return (x ^ y ^ z ^ level * _LEVEL_PRIME) & self.mask


@cache
def _ring_offsets(rings: int) -> np.ndarray:
    """Return (cells, 3) int64: the offsets of the cells within `rings` rings around a cell."""
    side = np.arange(-rings, rings + 1)
    return np.stack(np.meshgrid(side, side, side, indexing="ij"), axis=-1).reshape(-1, 3)


def _reached_cells(
    position: np.ndarray, radius: np.ndarray, rings: int, direction: np.ndarray | None
) -> np.ndarray:
    """Return (n, cells) bool: which of the cells of `_ring_offsets` may hold points that queries find.

    Parameters
    ----------
    position : (n, 3) ndarray
        Centers of the queries relative to the lowest corner of their cells. The unit is a cell.
    radius : (n,) ndarray
        Radii of the queries, in cells.
    rings : int
        Number of rings of cells around the cell of a query.
    direction : (n, 3) ndarray, optional
        Unit directions of the queries, which restrict them to two parts of their balls; see
        `PointGrid.pairs_within`.
    """
    side = np.arange(-rings, rings + 1)
    beyond = np.maximum(side - position[:, :, None], position[:, :, None] - (side + 1))
    squared = np.maximum(beyond, 0) ** 2
    distance = squared[:, 0, :, None, None] + squared[:, 1, None, :, None]
    distance = (distance + squared[:, 2, None, None, :]).reshape(len(position), -1)
    limit = (radius * radius)[:, None]
    is_reached = distance <= limit
    if direction is None:
        return is_reached
    to_center = direction @ _ring_offsets(rings).T + dot(0.5 - position, direction)[:, None]
    half_width = 0.5 * np.abs(direction).sum(axis=1) + BAND_RATIO * radius
    is_reached &= (np.abs(to_center) <= half_width[:, None]) | (distance <= INNER_RATIO**2 * limit)
    return is_reached


def grow_to(values: np.ndarray, count: int, fill: float) -> np.ndarray:
    """Double the length of an array until it has at least `count` rows; new rows hold `fill`."""
    while count > len(values):
        values = np.concatenate([values, np.full_like(values, fill)])
    return values
