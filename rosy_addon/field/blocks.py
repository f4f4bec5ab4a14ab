"""Process the rows of arrays in blocks, which bounds memory, and work with ranges of rows."""

from collections.abc import Callable, Iterator, Sequence
from typing import TypeVar

import numpy as np

from ..core.memory import check_memory

#: Number of rows of an array (faces, corners, edges) in a block. A block takes hundredths of a second.
ROWS_PER_BLOCK = 1 << 16

#: Number of elements from which `concatenated_ranges` estimates memory, and bytes that its callers need for each
#: element: measured with `sparse_multigrid.matrix_product`, which has the longest ranges.
MANY_ELEMENTS, BYTES_PER_ELEMENT = 1 << 24, 50

#: One or several arrays, as the result of a function.
Arrays = np.ndarray | tuple[np.ndarray, ...]

Record = TypeVar("Record", bound=tuple[np.ndarray, ...])


def row_blocks(count: int, size: int | None = None) -> list[slice]:
    """Return slices that split `count` rows into consecutive blocks of `size`; an empty slice for no rows.

    By default, blocks have `ROWS_PER_BLOCK` rows.
    """
    size = ROWS_PER_BLOCK if size is None else size
    return [slice(start, min(start + size, count)) for start in range(0, max(count, 1), size)]


def blocks_by_count(count: np.ndarray, limit: int) -> list[slice]:
    """Return slices that split an array of counts into consecutive parts with sums of at most `limit`.

    A single count above the limit gets a slice of its own.
    """
    total = np.cumsum(count, dtype=np.int64)
    blocks, start, done = [], 0, 0
    while start < len(count):
        stop = max(int(np.searchsorted(total, done + limit, side="right")), start + 1)
        blocks.append(slice(start, stop))
        start, done = stop, int(total[stop - 1])
    return blocks


def by_rows(function: Callable[..., Arrays], *arrays: np.ndarray) -> Arrays:
    """Apply a function to blocks of the rows of arrays, and concatenate the results.

    Parameters
    ----------
    function : callable
        Takes a block of each array, and returns one array or a tuple of arrays with the same number of rows.
        Each row of its result must depend only on the same row of the given arrays.
    arrays : (n, ...) ndarray
        Arrays with the same number of rows.
    """
    parts = [function(*(array[block] for array in arrays)) for block in row_blocks(len(arrays[0]))]
    if isinstance(parts[0], tuple):
        return tuple(np.concatenate(columns) for columns in zip(*parts, strict=True))
    return np.concatenate(parts)


def joined(parts: Sequence[Record]) -> Record:
    """Return a named tuple of arrays with the rows of all parts, one part after another."""
    return type(parts[0])(*(np.concatenate(column) for column in zip(*parts, strict=True)))


def mask(count: int, index: np.ndarray) -> np.ndarray:
    """Return a (count,) bool array that is True at the given indices."""
    result = np.zeros(count, dtype=bool)
    result[index] = True
    return result


def bincount_rows(index: np.ndarray, rows: np.ndarray, count: int = 0) -> np.ndarray:
    """Return (count, k) sums of the (m, k) rows of each index: `numpy.bincount` for rows of real weights.

    `count` is raised to the largest index plus 1.
    """
    return np.stack([np.bincount(index, column, count) for column in rows.T], axis=1)


def run_starts(values: np.ndarray) -> np.ndarray:
    """Return the first index of each run of equal values."""
    is_first = np.ones(len(values), dtype=bool)
    np.not_equal(values[1:], values[:-1], out=is_first[1:])
    return np.flatnonzero(is_first)


def neighbors_of_nodes(
    node_count: int, first: np.ndarray, second: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the neighbors of each node of a graph, as flat arrays (compressed sparse rows).

    Parameters
    ----------
    node_count : int
    first, second : (m,) int ndarray
        The nodes that each edge connects.

    Returns
    -------
    start : (n + 1,) intp ndarray
        The neighbors of node i are at positions ``start[i] .. start[i + 1] - 1`` of the other two arrays.
    neighbor : (2 m,) int ndarray
        The neighboring node.
    edge : (2 m,) intp ndarray
        Index of the edge to that neighbor. If the neighbor is the `first` node of the edge, m is added.
    """
    ends, others = np.concatenate([first, second]), np.concatenate([second, first])
    order = np.argsort(ends, kind="stable")
    start = np.concatenate([[0], np.cumsum(np.bincount(ends, minlength=node_count))])
    return start, others[order], order


def concatenated_ranges(first: np.ndarray, count: np.ndarray) -> np.ndarray:
    """Return the concatenation of the integer ranges ``first[i]`` to ``first[i] + count[i] - 1``, as intp.

    Examples
    --------
    >>> concatenated_ranges(np.array([5, 10]), np.array([3, 2])).tolist()
    [5, 6, 7, 10, 11]

    Raises
    ------
    RosyError
        If the work with so many numbers needs more memory than is free. That happens if a face has thousands of
        corners, or a vertex thousands of faces.
    """
    stop = np.cumsum(count)
    if len(stop) and stop[-1] > MANY_ELEMENTS:
        advice = "divide faces with thousands of corners, and vertices with thousands of faces"
        subject = f"a matrix with {stop[-1]:,} terms"
        check_memory(BYTES_PER_ELEMENT * float(stop[-1]), subject, advice)
    shift = first + count
    shift -= stop
    result = np.repeat(shift, count)
    result += np.arange(len(result))
    return result


def numbered_ranges(first: np.ndarray, count: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return two (m,) intp arrays: the index i of the range of each element, and `concatenated_ranges`.

    Examples
    --------
    >>> [array.tolist() for array in numbered_ranges(np.array([5, 10]), np.array([3, 2]))]
    [[0, 0, 0, 1, 1], [5, 6, 7, 10, 11]]
    """
    return np.repeat(np.arange(len(count)), count), concatenated_ranges(first, count)


def blocks_of_ranges(
    first: np.ndarray, count: np.ndarray, limit: int
) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Yield the `numbered_ranges` in blocks of whole ranges, from `blocks_by_count`."""
    for part in blocks_by_count(count, limit):
        number = np.repeat(np.arange(part.start, part.stop), count[part])
        yield number, concatenated_ranges(first[part], count[part])


def as_float64(values: np.ndarray) -> np.ndarray:
    """Return a copy of an array as float64, without numpy's warning for signaling NaN values."""
    with np.errstate(invalid="ignore"):
        return values.astype(np.float64)
