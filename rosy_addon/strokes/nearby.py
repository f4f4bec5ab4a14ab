"""Samples of strokes by place: a hashed grid that is added to as strokes grow."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

#: Numbers that cells are hashed with.
_PRIMES = np.array([73856093, 19349663, 83492791], dtype=np.int64)

#: A query looks at so many rings of cells around its own, at most.
MOST_RINGS = 4

#: Points of a block: those of a cell are a chain of blocks.
SIZE = 8

#: Queries that are answered at once: what they look at then stays in the cache.
AT_ONCE = 1 << 11


class Strip(NamedTuple):
    """Which points within the radius of a query are asked for.

    Attributes
    ----------
    way : (n, 3) ndarray
        Unit, of each query.
    near : float
        All are that are within this share of the radius.
    abeam : float
        Of the others, those not farther ahead or behind than this share of it.
    """

    way: np.ndarray
    near: float = 0.6
    abeam: float = 0.25


class Nearby:
    """Points in cells of a grid.

    Parameters
    ----------
    cell : float
        Its side: about the radius of most queries.
    expected : int
        About how many points there will be: for the size of the table.
    """

    def __init__(self, cell: float, expected: int) -> None:
        self.cell = cell
        bits = int(np.clip(np.ceil(np.log2(max(expected, 2))), 10, 22))
        self.mask = np.int64((1 << bits) - 1)
        # Of each cell the block that was added last, and how much of it is in use.
        self.last = np.full(1 << bits, -1, dtype=np.int32)
        self.filled = np.full(1 << bits, SIZE, dtype=np.int8)
        self.blocks = 0
        self.following = np.empty(128, dtype=np.int32)
        self.number = np.empty((128, SIZE), dtype=np.int32)
        # No comparison with nan is true.
        self.place = np.full((128, 3, SIZE), np.nan)
        self.count = 0
        self.slot = np.empty(1024, dtype=np.int32)

    def add(self, points: np.ndarray) -> np.ndarray:
        """Add (n, 3) points; their numbers, (n,) int32, count on from those before."""
        first = self.count
        self.count += len(points)
        self.slot = _grown(self.slot, self.count, 0)
        number = np.arange(first, self.count, dtype=np.int32)
        key = self._key(self._cells(points))
        order = np.argsort(key, kind="stable")
        key = key[order]
        new = np.ones(len(key), dtype=bool)
        new[1:] = key[1:] != key[:-1]
        begin = np.flatnonzero(new)
        group = np.cumsum(new) - 1
        key = key[begin]
        size = np.diff(np.append(begin, len(points)))
        last, filled = self.last[key], self.filled[key].astype(np.int64)
        # Each cell fills up its last block, and goes on with fresh ones.
        position = filled[group] + np.arange(len(points)) - begin[group]
        fresh = (filled + size - 1) // SIZE
        base = self.blocks + np.cumsum(fresh) - fresh
        ordinal = position // SIZE
        block = np.where(ordinal == 0, last[group], base[group] + ordinal - 1)
        self._chain(base, fresh, last)
        grows = fresh > 0
        self.last[key[grows]] = (base + fresh - 1)[grows]
        self.filled[key] = filled + size - SIZE * fresh
        slot = position % SIZE
        self.number[block, slot] = number[order]
        self.place[block, :, slot] = points[order]
        self.slot[number[order]] = block * SIZE + slot
        return number

    def _chain(self, base: np.ndarray, fresh: np.ndarray, last: np.ndarray) -> None:
        """Put blocks before those that cells had last."""
        first = self.blocks
        self.blocks += int(fresh.sum())
        self.following = _grown(self.following, self.blocks, -1)
        self.number = _grown(self.number, self.blocks, -1)
        self.place = _grown(self.place, self.blocks, np.nan)
        self.following[first : self.blocks] = np.arange(first, self.blocks) - 1
        grows = fresh > 0
        self.following[base[grows]] = last[grows]

    def forget(self, number: np.ndarray) -> None:
        """Take points out again."""
        block, slot = np.divmod(self.slot[number], SIZE)
        self.place[block, :, slot] = np.nan

    def around(
        self, points: np.ndarray, radius: np.ndarray, strip: Strip | None = None
    ) -> tuple[np.ndarray, np.ndarray]:
        """Pairs of a query and a point within its radius.

        Parameters
        ----------
        points : (n, 3) ndarray
        radius : (n,) ndarray
            Cut to `MOST_RINGS` cells.
        strip : Strip, optional
            Not all of those.

        Returns
        -------
        query : (m,) intp ndarray
        found : (m,) int32 ndarray
            Some may come twice.
        """
        rings = np.clip(np.ceil(radius / self.cell), 1, MOST_RINGS).astype(np.int64)
        pairs = []
        for count in range(1, int(rings.max(initial=0)) + 1):
            chosen = np.flatnonzero(rings == count)
            offset = _ring_offsets(count)
            for start in range(0, len(chosen), AT_ONCE):
                part = chosen[start : start + AT_ONCE]
                pairs += self._pairs(points, radius * radius, part, offset, strip)
        if not pairs:
            return np.empty(0, dtype=np.intp), np.empty(0, dtype=np.int32)
        return tuple(np.concatenate(column) for column in zip(*pairs, strict=True))

    def _pairs(
        self,
        points: np.ndarray,
        square: np.ndarray,
        chosen: np.ndarray,
        offset: np.ndarray,
        strip: Strip | None,
    ) -> list[tuple[np.ndarray, np.ndarray]]:
        """Block by block of all cells around some queries."""
        parts = self._cells(points[chosen]) * _PRIMES
        key = parts[:, 0, None] + offset[:, 0]
        key ^= parts[:, 1, None] + offset[:, 1]
        key ^= parts[:, 2, None] + offset[:, 2]
        key &= self.mask
        block = self.last.take(key).ravel()
        occupied = np.flatnonzero(block >= 0)
        block = block[occupied]
        query = chosen[occupied // len(offset)]
        pairs = []
        while len(block):
            apart = self.place.take(block, axis=0)
            apart -= points.take(query, axis=0)[:, :, None]
            distance = np.einsum("nij,nij->nj", apart, apart)
            limit = square.take(query)[:, None]
            near = distance <= limit
            if strip is not None:
                along = np.einsum("nij,ni->nj", apart, strip.way.take(query, axis=0))
                near &= (distance <= strip.near**2 * limit) | (
                    along * along <= strip.abeam**2 * limit
                )
            hit = np.flatnonzero(near)
            row = hit // SIZE
            pairs.append((query.take(row), self.number.take(block.take(row) * SIZE + hit % SIZE)))
            block = self.following.take(block)
            more = np.flatnonzero(block >= 0)
            block, query = block.take(more), query.take(more)
        return pairs

    def _cells(self, points: np.ndarray) -> np.ndarray:
        return np.floor(points / self.cell).astype(np.int64)

    def _key(self, cells: np.ndarray) -> np.ndarray:
        parts = cells * _PRIMES
        return (parts[:, 0] ^ parts[:, 1] ^ parts[:, 2]) & self.mask


def _ring_offsets(rings: int) -> np.ndarray:
    """(cells, 3) int64: what is added to the parts of a key for each of the cells around."""
    side = np.arange(-rings, rings + 1)
    offset = np.stack(np.meshgrid(side, side, side, indexing="ij"), axis=-1).reshape(-1, 3)
    return offset * _PRIMES


def _grown(values: np.ndarray, count: int, fill: float) -> np.ndarray:
    """The same with room for so many rows at least."""
    while count > len(values):
        values = np.concatenate([values, np.full_like(values, fill)])
    return values
