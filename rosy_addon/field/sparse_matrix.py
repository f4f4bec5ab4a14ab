"""Sparse Hermitian matrices in numpy, complex or real. Products have the type of the matrix."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from ..core.progress import report
from .blocks import concatenated_ranges, run_starts

#: Number of rows that are processed at once, so that their entries fit in the cache of a CPU core.
BLOCK_ROWS = 1 << 12

#: Number of blocks of rows of a new matrix that are assembled between two reports of the progress.
BLOCKS_PER_REPORT = 4


@dataclass(frozen=True, eq=False)
class CSRMatrix:
    """A sparse matrix in compressed row storage (CSR), without empty rows.

    n is the number of rows, and m is the number of stored elements, called *entries*. ``len(matrix)`` is n,
    and ``matrix @ vector`` is the matrix product.

    Attributes
    ----------
    indptr : (n + 1,) intp ndarray
        The entries of row i are at positions ``indptr[i] .. indptr[i + 1] - 1`` of the other arrays.
    indices : (m,) intp ndarray
        Column of each entry.
    data : (m,) complex or float ndarray
        Value of each entry.
    column_count : int
        Number of columns.
    """

    indptr: np.ndarray
    indices: np.ndarray
    data: np.ndarray
    column_count: int

    def __len__(self) -> int:
        return len(self.indptr) - 1

    def __matmul__(self, vector: np.ndarray) -> np.ndarray:
        result = np.empty(len(self), dtype=np.result_type(self.data, vector))
        for first in range(0, len(self), BLOCK_ROWS):
            starts = self.indptr[first : first + BLOCK_ROWS + 1]
            block = slice(starts[0], starts[-1])
            terms = vector.take(self.indices[block])
            terms *= self.data[block]
            np.add.reduceat(terms, starts[:-1] - starts[0], out=result[first : first + BLOCK_ROWS])
        return result

    @cached_property
    def row_indices(self) -> np.ndarray:
        """(m,) intp: the row of each entry."""
        return np.repeat(np.arange(len(self)), np.diff(self.indptr))

    @cached_property
    def diagonal(self) -> np.ndarray:
        """(n,) float64: the real part of the diagonal of the matrix."""
        on_diagonal = self.indices == self.row_indices
        return np.bincount(self.row_indices[on_diagonal], self.data[on_diagonal].real, len(self))

    def plus_diagonal(self, values: np.ndarray) -> CSRMatrix:
        """Return the matrix with (n,) values added to its diagonal. All diagonal elements must be stored."""
        data = self.data.copy()
        data[self.diagonal_entries] += values
        return replace(self, data=data)

    @cached_property
    def diagonal_entries(self) -> np.ndarray:
        """(n,) intp: position of the diagonal entry of each row. All diagonal elements must be stored."""
        entries = np.flatnonzero(self.indices == self.row_indices)
        if len(entries) > len(self):  # some rows have several, which add up
            entries = entries[np.unique(self.row_indices[entries], return_index=True)[1]]
        return entries

    def dense(self) -> np.ndarray:
        """Return the matrix as a dense array, (n, column_count)."""
        result = np.zeros((len(self), self.column_count), dtype=self.data.dtype)
        np.add.at(result, (self.row_indices, self.indices), self.data)
        return result

    def entries_of_rows(self, rows: np.ndarray) -> np.ndarray:
        """Return the positions of the entries of the given rows, row by row, as intp."""
        return concatenated_ranges(self.indptr[:-1][rows], np.diff(self.indptr)[rows])

    def rows(self, rows: np.ndarray) -> CSRMatrix:
        """Return the matrix that consists of the given rows, in the order of their indices `rows`."""
        entries = self.entries_of_rows(rows)
        indptr = np.concatenate([[0], np.cumsum(np.diff(self.indptr)[rows])])
        return CSRMatrix(indptr, self.indices[entries], self.data[entries], self.column_count)

    def columns(self, columns: np.ndarray) -> CSRMatrix:
        """Return the matrix that consists of the given columns, in their order.

        No column may be given twice, and each row of the result must have an entry.
        """
        new_column = np.full(self.column_count, -1)
        new_column[columns] = np.arange(len(columns))
        indices = new_column[self.indices]
        kept = np.flatnonzero(indices >= 0)
        indptr = np.searchsorted(kept, self.indptr)
        return CSRMatrix(indptr, indices[kept], self.data[kept], len(columns))

    @cached_property
    def adjoint(self) -> CSRMatrix:
        """Return the conjugate transpose of the matrix."""
        row, column = self.indices, self.row_indices
        return from_coo(row, column, self.data.conj(), self.column_count, len(self))


def from_coo(
    row: np.ndarray, column: np.ndarray, value: np.ndarray, row_count: int, column_count: int
) -> CSRMatrix:
    """Make a matrix from its entries in coordinate format (COO), in any order.

    Entries with the same row and column are summed. No row may be empty.

    Parameters
    ----------
    row, column : (m,) intp ndarray
        Row and column of each entry.
    value : (m,) complex or float ndarray
        Value of each entry.
    row_count, column_count : int
        Shape of the matrix.
    """
    # A radix sort by digits of 16 bits, the low digit first: numpy's stable sort takes linear time
    # only for integers of at most 16 bits.
    order = np.argsort(row.astype(np.uint16), kind="stable")
    if row_count > 1 << 16:
        order = order.take(np.argsort((row >> 16).astype(np.uint16).take(order), kind="stable"))
    indptr = np.zeros(row_count + 1, dtype=np.intp)
    np.cumsum(np.bincount(row, minlength=row_count), out=indptr[1:])
    return CSRMatrix(indptr, column.take(order), value.take(order), column_count)


def from_edges(
    tail: np.ndarray, head: np.ndarray, value: np.ndarray, diagonal: np.ndarray
) -> CSRMatrix:
    """Make the Hermitian matrix of a graph, with one off-diagonal value for each edge.

    Parameters
    ----------
    tail, head : (E,) int ndarray
        The two nodes of each edge. The value of the edge is at row `tail` and column `head`, and its
        conjugate at row `head` and column `tail`.
    value : (E,) complex or float ndarray
        Value of each edge.
    diagonal : (n,) float64 ndarray
        Values on the diagonal, one for each node.
    """
    count = len(diagonal)
    nodes = np.arange(count)
    row = np.concatenate([tail, head, nodes]).astype(np.intp)
    column = np.concatenate([head, tail, nodes]).astype(np.intp)
    return from_coo(row, column, np.concatenate([value, value.conj(), diagonal]), count, count)


def matrix_product(a: CSRMatrix, b: CSRMatrix) -> CSRMatrix:
    """Return the matrix product a b."""

    def terms(block: slice) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        inner = a.indices[block]
        first = b.indptr.take(inner)
        count = b.indptr.take(inner + 1) - first
        entry = np.repeat(np.arange(len(inner)), count)
        source = concatenated_ranges(first, count)
        value = a.data[block].take(entry)
        value *= b.data.take(source)
        return a.row_indices[block].take(entry), b.indices.take(source), value

    return assemble_by_rows(a, b.column_count, terms)


def assemble_by_rows(
    matrix: CSRMatrix,
    column_count: int,
    entries: Callable[[slice], tuple[np.ndarray, np.ndarray, np.ndarray]],
) -> CSRMatrix:
    """Build a matrix from another matrix in blocks of rows, so that sorting stays in the CPU cache.

    Parameters
    ----------
    matrix : CSRMatrix
        The given matrix. The result has the same number of rows.
    column_count : int
        Number of columns of the result.
    entries : callable
        Function that takes a slice of the entries of `matrix`. It returns the rows, columns and values of the
        entries of the result to which this slice contributes. Values at the same position are summed.
    """
    bits = int(column_count).bit_length()
    row_counts, index_blocks, value_blocks = [], [], []
    for first in range(0, len(matrix), BLOCK_ROWS):
        if first % (BLOCKS_PER_REPORT * BLOCK_ROWS) == 0:
            report(first / len(matrix), "building multigrid levels")
        last = min(first + BLOCK_ROWS, len(matrix))
        row, column, value = entries(slice(matrix.indptr[first], matrix.indptr[last]))
        key = (row - first) << bits | column
        order = np.argsort(key, kind="stable")
        key = key.take(order)
        starts = run_starts(key)
        key = key.take(starts)
        row_counts.append(np.bincount(key >> bits, minlength=last - first))
        index_blocks.append(key & ((1 << bits) - 1))
        value_blocks.append(np.add.reduceat(value.take(order), starts))
    report(1.0, "building multigrid levels")
    indptr = np.concatenate([[0], np.cumsum(np.concatenate(row_counts))])
    indices, data = np.concatenate(index_blocks), np.concatenate(value_blocks)
    return CSRMatrix(indptr, indices, data, column_count)
