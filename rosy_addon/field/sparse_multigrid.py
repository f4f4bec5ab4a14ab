"""Algebraic multigrid for connection Laplacians. Levels and solutions have the type of the matrix.

The smooth vectors of a connection Laplacian are parallel, not constant: from one unknown to its neighbor,
their phase changes by the phase of the matrix element. So the prolongation from an aggregate (a group of
neighboring unknowns) contains such phases, which are accumulated along a tree within the aggregate. The
prolongation is then smoothed by a Jacobi step (smoothed aggregation: Vanek, Mandel and Brezina 1996).
"""

from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np

from ..core.progress import progress, report
from .copied_faces import scrambled
from .sparse_matrix import CSRMatrix, assemble_by_rows, matrix_product

#: Relative increase of the diagonal of a singular matrix, and smallest value on a diagonal, relative to the
#: largest value.
SINGULAR_SHIFT = 1e-10

#: A level with at most this number of unknowns is the coarsest one, and is solved with a dense inverse.
DIRECT_SOLVE_SIZE = 100

#: A matrix entry below this fraction of the largest off-diagonal entry, in both of its rows, is weak: it does
#: not connect two unknowns in an aggregate.
STRENGTH_THRESHOLD = 0.08

#: Before hashing, matrix elements are rounded to multiples of this fraction of the mean diagonal element, so that
#: rounding errors change few hashes.
HASH_PRECISION = 1e-6

#: Number of steps from an unknown, along matrix elements, within which the elements enter its hash.
HASH_ROUNDS = 4

#: Largest number of images of an unknown under the symmetries of a mesh: the order of the group of the cube.
MAX_IMAGES = 48

#: Connections whose strengths differ by at most this fraction of the stronger one count as equally strong.
EQUAL_STRENGTH = 1e-9


@dataclass(frozen=True, eq=False)
class Level:
    """A level of the multigrid hierarchy.

    Attributes
    ----------
    matrix : CSRMatrix
        The (n, n) matrix, Hermitian and positive definite.
    prolongation : CSRMatrix or None
        The (n, n_coarse) matrix that interpolates from the next coarser level; None on the coarsest level.
    jacobi_weight : (n,) float64 ndarray
        Factors by which a Jacobi smoothing step multiplies the residual.
    inverse : (n, n) ndarray or None
        Dense inverse of the matrix on the coarsest level, if it is small enough; None on all other levels.
    """

    matrix: CSRMatrix
    prolongation: CSRMatrix | None
    jacobi_weight: np.ndarray
    inverse: np.ndarray | None


def hierarchy(matrix: CSRMatrix, direct_size: int = DIRECT_SOLVE_SIZE) -> list[Level]:
    """Build the multigrid levels of a positive definite matrix.

    Coarsening stops when a level is small enough for a dense inverse, or when aggregation no longer
    reduces the number of unknowns by at least a fifth.

    Parameters
    ----------
    matrix : CSRMatrix
        The (n, n) matrix, Hermitian.
    direct_size : int
        A level with at most this number of unknowns is the coarsest one.

    Returns
    -------
    list of Level
        Levels from the finest to the coarsest.
    """
    levels = []
    unknown_count = len(matrix)
    label = "building multigrid levels"
    while True:
        rest = len(matrix) / (unknown_count + 1)
        parts = [1 - share * rest for share in (1.0, 0.7, 0.6, 0.5, 0.4)]
        report(parts[0], label)
        jacobi_weight = _jacobi_weights(matrix)
        aggregation = None
        if len(matrix) > direct_size:
            with progress(parts[0], parts[1], label):
                aggregation = _aggregates(matrix)
        if aggregation is None or aggregation[1] > 0.8 * len(matrix):
            inverse = (
                dense_inverse(matrix)
                if len(matrix) <= max(4 * DIRECT_SOLVE_SIZE, direct_size)
                else None
            )
            levels.append(Level(matrix, None, jacobi_weight, inverse))
            return levels
        with progress(parts[1], parts[2], label):
            prolongation = _smoothed_prolongation(matrix, jacobi_weight, *aggregation)
        levels.append(Level(matrix, prolongation, jacobi_weight, None))
        with progress(parts[2], parts[3], label):
            product = matrix_product(matrix, prolongation)
        with progress(parts[3], parts[4], label):
            matrix = matrix_product(prolongation.adjoint, product)


def add_diagonal(levels: list[Level], diagonal: np.ndarray) -> list[Level]:
    """Return multigrid levels for a matrix with other values on its diagonal.

    This is much faster than calling `hierarchy` again. On each coarser level, the value added to the diagonal
    of an aggregate is the sum of the values added to its unknowns. This is an upper bound of the exact
    (Galerkin) matrix.

    Parameters
    ----------
    levels : list of Level
        Result of `hierarchy`.
    diagonal : (n,) float64 ndarray
        Values that are added to the diagonal, at least 0.
    """
    result = []
    for level in levels:
        matrix = level.matrix.plus_diagonal(diagonal)
        inverse = None if level.inverse is None else dense_inverse(matrix)
        result.append(Level(matrix, level.prolongation, _jacobi_weights(matrix), inverse))
        if level.prolongation is not None:
            p = level.prolongation
            terms = np.abs(p.data) * diagonal.take(p.row_indices)
            diagonal = np.bincount(p.indices, terms, p.column_count)
    return result


def w_cycle(levels: list[Level], rhs: np.ndarray) -> np.ndarray:
    """Approximate the solution of ``levels[0].matrix @ solution = rhs`` by one multigrid W-cycle.

    From each level, the next coarser level is visited twice. This costs little, because the coarser level has
    about a ninth of the unknowns. It makes the convergence rate independent of the number of levels.

    Parameters
    ----------
    levels : list of Level
        Result of `hierarchy`.
    rhs : (n,) complex or float ndarray
        Right-hand side.

    Returns
    -------
    (n,) complex or float ndarray
        The approximate solution.
    """
    level = levels[0]
    if level.inverse is not None:
        return level.inverse @ rhs
    solution = level.jacobi_weight * rhs
    if level.prolongation is None:
        for _ in range(20):
            solution += level.jacobi_weight * (rhs - level.matrix @ solution)
        return solution
    residual = level.prolongation.adjoint @ (rhs - level.matrix @ solution)
    correction = w_cycle(levels[1:], residual)
    if levels[1].inverse is None:
        correction += w_cycle(levels[1:], residual - levels[1].matrix @ correction)
    solution += level.prolongation @ correction
    solution += level.jacobi_weight * (rhs - level.matrix @ solution)
    return solution


def _jacobi_weights(matrix: CSRMatrix) -> np.ndarray:
    """Return (n,) factors of the residual for a Jacobi step that damps the upper part of the spectrum."""
    diagonal = _positive_diagonal(matrix)
    scaled_row_sum = np.add.reduceat(np.abs(matrix.data), matrix.indptr[:-1]) / diagonal
    return 4 / (3 * scaled_row_sum.max() * diagonal)


def _positive_diagonal(matrix: CSRMatrix) -> np.ndarray:
    """Return the (n,) diagonal of a matrix, with small positive values instead of values near 0.

    Rounding errors can make the diagonal 0 on a connected component with a tiny area.
    """
    diagonal = matrix.diagonal
    return np.maximum(diagonal, SINGULAR_SHIFT * diagonal.max())


def dense_inverse(matrix: CSRMatrix) -> np.ndarray:
    """Return the inverse of a sparse matrix as a dense array.

    If the matrix is singular, or its inverse is too large for floating-point numbers, its diagonal is enlarged a little.
    The inverse is used as a preconditioner, so this changes the rate of convergence and not the solution.
    """
    dense = matrix.dense()
    with suppress(np.linalg.LinAlgError):
        inverse = np.linalg.inv(dense)
        if np.isfinite(inverse).all():
            return inverse
    np.fill_diagonal(dense, (1 + SINGULAR_SHIFT) * _positive_diagonal(matrix))
    return np.linalg.inv(dense)


def _smoothed_prolongation(
    matrix: CSRMatrix,
    jacobi_weight: np.ndarray,
    aggregate: np.ndarray,
    count: int,
    phase: np.ndarray,
) -> CSRMatrix:
    """Return the prolongation matrix: one column for each aggregate, smoothed by a Jacobi step of the matrix.

    `aggregate`, `count` and `phase` are results of `_aggregates`, and `jacobi_weight` of `_jacobi_weights`.
    """
    unknowns = np.arange(len(matrix))

    def entries(block: slice) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        row, column = matrix.row_indices[block], matrix.indices[block]
        value = matrix.data[block] * phase.take(column)
        value *= -jacobi_weight.take(row)
        block_rows = unknowns[row[0] : row[-1] + 1]
        return (
            np.concatenate([row, block_rows]),
            np.concatenate([aggregate.take(column), aggregate.take(block_rows)]),
            np.concatenate([value, phase.take(block_rows)]),
        )

    return assemble_by_rows(matrix, count, entries)


def _orders(matrix: CSRMatrix) -> np.ndarray:
    """Return two orders of the unknowns, as (2, n) ranks, that depend on the matrix and not on the numbering.

    Unknowns are sorted by a hash of the matrix elements in their neighborhood (Weisfeiler and Leman 1968). Unknowns
    with equal hashes are images of each other under symmetries of the mesh. They are in random order in the first
    result, and in the reverse order in the second one, so no image comes last in both. If there are more than
    `MAX_IMAGES` of them, they have the same random order in both results.
    """
    count = len(matrix)
    unit = max(float(matrix.diagonal.mean()), 1e-300) * HASH_PRECISION
    element = scrambled(np.rint(np.abs(matrix.data) / unit).astype(np.int64).view(np.uint64))
    hashes = np.zeros(count, dtype=np.uint64)
    for _ in range(HASH_ROUNDS):
        terms = scrambled(hashes.take(matrix.indices) + element)
        hashes = scrambled(hashes + np.add.reduceat(terms, matrix.indptr[:-1]))
    _, image, images = np.unique(hashes, return_inverse=True, return_counts=True)
    ranks = np.empty((2, count), dtype=np.intp)
    random = np.random.default_rng(0).permutation(count)
    is_few = images[image] <= MAX_IMAGES
    for rank, numbers in zip(ranks, (random, np.where(is_few, -random, random)), strict=True):
        rank[np.lexsort((numbers, image))] = np.arange(count)
    return ranks


def _roots(links: CSRMatrix, orders: np.ndarray) -> np.ndarray:
    """Return the roots of new aggregates, as (n,) bool: unknowns that are at least three links apart.

    Unknowns are *free* until they or a root within two links are chosen. In each round, a free unknown becomes a root
    if it comes last, in both orders, of all free unknowns within two links. An unknown that comes last in only one of
    the orders competes with its images under a symmetry. It is not free any more, so none of them is preferred.

    Parameters
    ----------
    links : (n, n) CSRMatrix
        Its data say which entries are links, as bool.
    orders : (2, n) intp ndarray
        Two orders of the unknowns; see `_orders`.
    """
    count = len(links)
    free, root = np.ones(count, dtype=bool), np.zeros(count, dtype=bool)
    near = links  # the rows of unknowns that are free or linked to free ones
    unknowns = np.arange(count)

    def max_over_links(values: np.ndarray) -> np.ndarray:
        """Return (n,) maxima of values over each unknown and its links; -1 if none of these is free."""
        result = np.full(count, -1)
        result[unknowns] = np.maximum.reduceat(
            np.where(near.data, values.take(near.indices), -1), near.indptr[:-1]
        )
        return result

    while free.any():
        report(1 - np.count_nonzero(free) / count, "building multigrid levels")
        is_last = [
            free & (max_over_links(max_over_links(np.where(free, order, -1))) == order)
            for order in orders
        ]
        new_roots = is_last[0] & is_last[1]
        root |= new_roots
        free &= max_over_links(max_over_links(new_roots.astype(np.intp))) < 1
        free &= ~(is_last[0] | is_last[1])
        is_near = max_over_links(free.astype(np.intp)) > 0
        near = near.rows(np.flatnonzero(is_near[unknowns]))
        unknowns = np.flatnonzero(is_near)
    return root


def _aggregates(matrix: CSRMatrix) -> tuple[np.ndarray, int, np.ndarray]:
    """Group the unknowns into aggregates of strongly connected neighbors.

    Returns
    -------
    aggregate : (n,) int64 ndarray
        Aggregate of each unknown.
    count : int
        Number of aggregates.
    phase : (n,) ndarray
        Numbers of modulus 1. Within each aggregate, a smooth vector is nearly proportional to them.
    """
    count = len(matrix)
    row, column = matrix.row_indices, matrix.indices
    strength = np.where(row == column, 0, np.abs(matrix.data))
    largest = np.maximum.reduceat(strength, matrix.indptr[:-1])
    strength[strength < STRENGTH_THRESHOLD * np.minimum(largest[row], largest[column])] = 0
    links = replace(matrix, data=(strength > 0) | (row == column))
    orders = _orders(matrix)
    root = _roots(links, orders)
    aggregate = np.full(count, -1)
    aggregate[root] = np.arange(np.count_nonzero(root))
    phase = np.ones(count, dtype=matrix.data.dtype)
    root_order = np.where(root, orders, -1)
    for _ in range(2):
        report(1.0, "building multigrid levels")
        # An unknown joins the aggregate of the neighbor with the strongest connection. Of equally strong ones, the
        # neighbor whose root comes last in both orders is taken; if there is none, the unknown does not join.
        weight = np.where(aggregate[column] >= 0, strength, 0)
        strongest = np.maximum.reduceat(weight, matrix.indptr[:-1])[row]
        is_strongest = (weight >= (1 - EQUAL_STRENGTH) * strongest) & (strongest > 0)
        is_best = is_strongest & (aggregate[row] < 0)
        for order in root_order:
            rank = np.where(is_strongest, order[column], -1)
            is_best &= rank == np.maximum.reduceat(rank, matrix.indptr[:-1])[row]
        entry = np.flatnonzero(is_best)
        unknown, neighbor = row[entry], column[entry]
        phase[unknown] = -matrix.data[entry] / np.abs(matrix.data[entry]) * phase[neighbor]
        aggregate[unknown] = aggregate[neighbor]
        root_order[:, unknown] = root_order[:, neighbor]
    singleton = aggregate < 0
    aggregate[singleton] = np.count_nonzero(root) + np.arange(np.count_nonzero(singleton))
    return aggregate, int(aggregate.max()) + 1, phase
