"""Samples of strokes by place: a hashed grid that is added to as strokes grow."""

from __future__ import annotations

import numpy as np

#: Numbers that cells are hashed with.
_PRIMES = np.array([73856093, 19349663, 83492791], dtype=np.int64)

#: A query looks at so many rings of cells around its own, at most.
MOST_RINGS = 5


class Nearby:
    """Points in cells of a grid, each cell a chain.

    Parameters
    ----------
    cell : float
        Its side.
    expected : int
        About how many points there will be: for the size of the table.
    """

    def __init__(self, cell: float, expected: int) -> None:
        self.cell = cell
        bits = int(np.clip(np.ceil(np.log2(max(expected, 2))) + 2, 10, 24))
        self.mask = np.int64((1 << bits) - 1)
        self.head = np.full(1 << bits, -1, dtype=np.int32)
        self.following = np.full(1024, -1, dtype=np.int32)
        self.count = 0

    def add(self, points: np.ndarray) -> np.ndarray:
        """Add (n, 3) points; their numbers, (n,) int32, count on from those before."""
        first = self.count
        self.count += len(points)
        while self.count > len(self.following):
            self.following = np.concatenate([self.following, np.full_like(self.following, -1)])
        number = np.arange(first, self.count, dtype=np.int32)
        key = self._key(self._cells(points))
        order = np.argsort(key, kind="stable")
        key, sorted_number = key[order], number[order]
        begins = np.ones(len(key), dtype=bool)
        begins[1:] = key[1:] != key[:-1]
        # Each points at the one before in its cell, the first at what was there.
        before = np.empty(len(key), dtype=np.int32)
        before[1:] = sorted_number[:-1]
        before[begins] = self.head[key[begins]]
        self.following[sorted_number] = before
        ends = np.ones(len(key), dtype=bool)
        ends[:-1] = begins[1:]
        self.head[key[ends]] = sorted_number[ends]
        return number

    def around(
        self,
        points: np.ndarray,
        radius: np.ndarray,
        places: np.ndarray,
        way: np.ndarray | None = None,
        near: float = 0.6,
        abeam: float = 0.25,
    ) -> tuple[np.ndarray, np.ndarray]:
        """Pairs of a query and a point within its radius.

        With unit ways only those that are within a share `near` of the radius, or not farther ahead
        or behind than a share `abeam` of it.

        Parameters
        ----------
        points : (n, 3) ndarray
        radius : (n,) ndarray
            Cut to `MOST_RINGS` cells.
        places : (count, 3) ndarray
            All points that were added.
        way : (n, 3) ndarray, optional
        near, abeam : float

        Returns
        -------
        query : (m,) intp ndarray
        found : (m,) int32 ndarray
            Some may come twice.
        """
        rings = np.clip(np.ceil(radius / self.cell), 1, MOST_RINGS).astype(np.int64)
        pairs = [
            self._pairs(
                points,
                radius,
                places,
                np.flatnonzero(rings == count),
                int(count),
                None if way is None else (way, near, abeam),
            )
            for count in np.unique(rings)
        ]
        if not pairs:
            return np.empty(0, dtype=np.intp), np.empty(0, dtype=np.int32)
        return tuple(np.concatenate(column) for column in zip(*pairs, strict=True))

    def _pairs(
        self,
        points: np.ndarray,
        radius: np.ndarray,
        places: np.ndarray,
        chosen: np.ndarray,
        rings: int,
        strip: tuple[np.ndarray, float, float] | None,
    ) -> tuple[np.ndarray, np.ndarray]:
        side = np.arange(-rings, rings + 1)
        offset = np.stack(np.meshgrid(side, side, side, indexing="ij"), axis=-1).reshape(-1, 3)
        offset_key = (offset * _PRIMES).astype(np.int64)
        parts = self._cells(points[chosen]) * _PRIMES
        key = parts[:, 0, None] + offset_key[:, 0]
        key ^= parts[:, 1, None] + offset_key[:, 1]
        key ^= parts[:, 2, None] + offset_key[:, 2]
        key &= self.mask
        current = self.head.take(key).ravel()
        occupied = np.flatnonzero(current >= 0)
        current = current[occupied]
        query = chosen[occupied // len(offset)]
        square = radius * radius
        queries, found = [], []
        while len(current):
            apart = places.take(current, axis=0)
            apart -= points.take(query, axis=0)
            distance = np.einsum("ni,ni->n", apart, apart)
            limit = square.take(query)
            near = np.flatnonzero(distance <= limit)
            if strip is not None:
                way, share, beam = strip
                some = query.take(near)
                along = np.einsum("ni,ni->n", apart.take(near, axis=0), way.take(some, axis=0))
                limit = limit.take(near)
                near = near[
                    (distance.take(near) <= share**2 * limit) | (along * along <= beam**2 * limit)
                ]
            queries.append(query.take(near))
            found.append(current.take(near))
            current = self.following.take(current)
            more = np.flatnonzero(current >= 0)
            current, query = current.take(more), query.take(more)
        if not queries:
            return np.empty(0, dtype=np.intp), np.empty(0, dtype=np.int32)
        return np.concatenate(queries), np.concatenate(found)

    def _cells(self, points: np.ndarray) -> np.ndarray:
        return np.floor(points / self.cell).astype(np.int64)

    def _key(self, cells: np.ndarray) -> np.ndarray:
        parts = cells * _PRIMES
        return (parts[:, 0] ^ parts[:, 1] ^ parts[:, 2]) & self.mask
