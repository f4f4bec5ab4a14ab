"""Sparse Hermitian matrices in numpy, and multigrid for those whose entries are connections.

A connection Laplacian's smooth vectors are not constant but parallel: from one entry to the next
they turn by the phase of the matrix's entry. So each aggregate of a coarser level carries the phases
along a tree within it, and is smoothed: smoothed aggregation (Vanek, Mandel and Brezina 1996).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ..progress import Progress, Work

#: Unknowns below which a level is solved densely.
DENSE = 400

#: Rows that are worked on at once, so that their entries stay in a core's cache.
BLOCK = 1 << 12

#: Entries smaller than this share of the largest of both rows do not join aggregates.
STRONG = 0.08


@dataclass(frozen=True, eq=False)
class Rows:
    """A sparse matrix by its rows, none of them empty.

    Attributes
    ----------
    start : (n + 1,) intp ndarray
    column : (m,) intp ndarray
    value : (m,) complex ndarray
    columns : int
    """

    start: np.ndarray
    column: np.ndarray
    value: np.ndarray
    columns: int

    def __len__(self) -> int:
        return len(self.start) - 1

    def __matmul__(self, vector: np.ndarray) -> np.ndarray:
        found = np.empty(len(self), dtype=np.result_type(self.value, vector))
        for first in range(0, len(self), BLOCK):
            starts = self.start[first : first + BLOCK + 1]
            part = slice(starts[0], starts[-1])
            terms = vector.take(self.column[part])
            terms *= self.value[part]
            np.add.reduceat(terms, starts[:-1] - starts[0], out=found[first : first + BLOCK])
        return found

    @cached_property
    def row(self) -> np.ndarray:
        """(m,) intp: the row of each entry."""
        return np.repeat(np.arange(len(self)), np.diff(self.start))

    @cached_property
    def diagonal(self) -> np.ndarray:
        """(n,) float: real parts of the diagonal."""
        own = self.column == self.row
        return np.bincount(self.row[own], self.value[own].real, len(self))

    @cached_property
    def adjoint(self) -> Rows:
        """The conjugate transpose."""
        return from_entries(self.column, self.row, self.value.conj(), self.columns, len(self))


def from_entries(
    row: np.ndarray, column: np.ndarray, value: np.ndarray, rows: int, columns: int
) -> Rows:
    """A matrix of entries in any order; those at one place count together. No row may be empty."""
    # By digits of 16 bits, the lower first: those alone numpy sorts in linear time.
    order = np.argsort(row.astype(np.uint16), kind="stable")
    if rows > 1 << 16:
        order = order.take(np.argsort((row >> 16).astype(np.uint16).take(order), kind="stable"))
    start = np.zeros(rows + 1, dtype=np.intp)
    np.cumsum(np.bincount(row, minlength=rows), out=start[1:])
    return Rows(start, column.take(order), value.take(order), columns)


def product(a: Rows, b: Rows) -> Rows:
    """a b."""
    return _by_rows(a, b.columns, lambda part: _product_entries(a, b, part))


def _product_entries(a: Rows, b: Rows, part: slice) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Rows, columns and values of what some entries of `a` add to a product."""
    through = a.column[part]
    first = b.start.take(through)
    count = b.start.take(through + 1) - first
    entry = np.repeat(np.arange(len(through)), count)
    first -= np.cumsum(count) - count
    there = first.take(entry)
    there += np.arange(len(entry))
    value = a.value[part].take(entry)
    value *= b.value.take(there)
    return a.row[part].take(entry), b.column.take(there), value


def _by_rows(
    matrix: Rows,
    columns: int,
    entries: Callable[[slice], tuple[np.ndarray, np.ndarray, np.ndarray]],
) -> Rows:
    """A matrix of as many rows, whose entries come from those of some rows at a time.

    Sorting them stays in a core's cache.
    """
    bits = int(columns).bit_length()
    counts, found, values = [], [], []
    for first in range(0, len(matrix), BLOCK):
        last = min(first + BLOCK, len(matrix))
        row, column, value = entries(slice(matrix.start[first], matrix.start[last]))
        key, value = _added_up((row - first) << bits | column, value)
        counts.append(np.bincount(key >> bits, minlength=last - first))
        found.append(key & ((1 << bits) - 1))
        values.append(value)
    start = np.concatenate([[0], np.cumsum(np.concatenate(counts))])
    return Rows(start, np.concatenate(found), np.concatenate(values), columns)


def _added_up(key: np.ndarray, value: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Keys in ascending order, each once, and the sums of their values."""
    order = np.argsort(key, kind="stable")
    key = key.take(order)
    first = np.flatnonzero(np.concatenate([[True], key[1:] != key[:-1]]))
    return key.take(first), np.add.reduceat(value.take(order), first)


@dataclass(frozen=True, eq=False)
class Level:
    """A matrix, what leads from the next coarser level to it, and its Jacobi smoother's weights."""

    matrix: Rows
    prolongation: Rows | None
    weight: np.ndarray
    inverse: np.ndarray | None


def hierarchy(matrix: Rows) -> Work[list[Level]]:
    """Levels from a positive definite matrix to one small enough to be inverted."""
    levels = []
    whole = len(matrix)
    while True:
        yield Progress(1 - len(matrix) / (whole + 1), "building levels")
        weight = _damped(matrix)
        coarse = _aggregates(matrix) if len(matrix) > DENSE else None
        if coarse is None or coarse[1] > 0.8 * len(matrix):
            inverse = _inverse(matrix) if len(matrix) <= 4 * DENSE else None
            levels.append(Level(matrix, None, weight, inverse))
            return levels
        prolongation = _smoothed(matrix, weight, *coarse)
        levels.append(Level(matrix, prolongation, weight, None))
        yield Progress(1 - len(matrix) / (whole + 1), "building levels")
        matrix = product(prolongation.adjoint, product(matrix, prolongation))


def cycle(levels: list[Level], right: np.ndarray) -> np.ndarray:
    """About the solution of the first level's matrix times it equal `right`: one W-cycle.

    Coarser levels are visited twice, which costs little, as each has a ninth of the unknowns, and
    keeps what a cycle achieves the same however many levels there are.
    """
    level = levels[0]
    if level.inverse is not None:
        return level.inverse @ right
    found = level.weight * right
    if level.prolongation is None:
        for _ in range(20):
            found += level.weight * (right - level.matrix @ found)
        return found
    rest = level.prolongation.adjoint @ (right - level.matrix @ found)
    coarse = cycle(levels[1:], rest)
    if levels[1].inverse is None:
        coarse += cycle(levels[1:], rest - levels[1].matrix @ coarse)
    found += level.prolongation @ coarse
    found += level.weight * (right - level.matrix @ found)
    return found


def _damped(matrix: Rows) -> np.ndarray:
    """(n,) weights of a Jacobi step that damps the upper part of the spectrum."""
    diagonal = matrix.diagonal
    largest = np.add.reduceat(np.abs(matrix.value), matrix.start[:-1]) / diagonal
    return 4 / (3 * largest.max() * diagonal)


def _inverse(matrix: Rows) -> np.ndarray:
    """Dense."""
    dense = np.zeros((len(matrix), len(matrix)), dtype=np.complex128)
    np.add.at(dense, (matrix.row, matrix.column), matrix.value)
    return np.linalg.inv(dense)


def _smoothed(
    matrix: Rows, weight: np.ndarray, aggregate: np.ndarray, count: int, phase: np.ndarray
) -> Rows:
    """Aggregates as columns, after a Jacobi step toward what the matrix calls smooth."""
    own = np.arange(len(matrix))

    def entries(part: slice) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        row, column = matrix.row[part], matrix.column[part]
        value = matrix.value[part] * phase.take(column)
        value *= -weight.take(row)
        here = own[row[0] : row[-1] + 1]
        return (
            np.concatenate([row, here]),
            np.concatenate([aggregate.take(column), aggregate.take(here)]),
            np.concatenate([value, phase.take(here)]),
        )

    return _by_rows(matrix, count, entries)


def _aggregates(matrix: Rows) -> tuple[np.ndarray, int, np.ndarray]:
    """The aggregate of each unknown, their number, and phases along which these are smooth."""
    count = len(matrix)
    row, column = matrix.row, matrix.column
    size = np.where(row == column, 0, np.abs(matrix.value))
    largest = np.maximum.reduceat(size, matrix.start[:-1])
    size[size < STRONG * np.minimum(largest[row], largest[column])] = 0
    strong = size > 0

    def over_neighbours(values: np.ndarray) -> np.ndarray:
        return np.maximum.reduceat(
            np.where(strong | (row == column), values.take(column), -1), matrix.start[:-1]
        )

    # Roots are local maxima of random numbers among all that is two steps away and not taken.
    number = np.random.default_rng(0).permutation(count)
    free, root = np.ones(count, dtype=bool), np.zeros(count, dtype=bool)
    while free.any():
        wish = np.where(free, number, -1)
        chosen = free & (over_neighbours(over_neighbours(wish)) == number)
        root |= chosen
        free &= over_neighbours(over_neighbours(chosen.astype(np.intp))) < 1
    aggregate = np.full(count, -1)
    aggregate[root] = np.arange(np.count_nonzero(root))
    phase = np.ones(count, dtype=np.complex128)
    for _ in range(2):
        # Of a free unknown's neighbours in aggregates, that of the largest entry takes it in.
        weight = np.where(aggregate[column] >= 0, size, 0)
        best = np.maximum.reduceat(weight, matrix.start[:-1])
        match = (weight == best[row]) & (best[row] > 0) & (aggregate[row] < 0)
        entry = np.flatnonzero(match)
        here, there = row[entry], column[entry]
        turn = -matrix.value[entry] / np.abs(matrix.value[entry])
        taken = aggregate[there]
        phase[here] = turn * phase[there]
        aggregate[here] = taken
    alone = aggregate < 0
    aggregate[alone] = np.count_nonzero(root) + np.arange(np.count_nonzero(alone))
    return aggregate, int(aggregate.max()) + 1, phase
