"""Parts of sparse matrices, and multigrid levels for matrices that differ by their diagonals."""

from functools import partial

import numpy as np
import pytest
from field_helpers import as_scipy, bumpy
from scipy import sparse
from scipy.sparse.linalg import spsolve
from shapes import icosphere, torus

from rosy_addon.field.conjugate_gradient import conjugate_gradient
from rosy_addon.field.connection import build_connection
from rosy_addon.field.connection import laplacian as field_laplacian
from rosy_addon.field.sparse_matrix import from_coo, from_edges, matrix_product
from rosy_addon.field.sparse_multigrid import add_diagonal, hierarchy, w_cycle

TORUS_LAPLACIAN = field_laplacian(build_connection(torus(60, 30)), 4)
LAPLACIAN = TORUS_LAPLACIAN.plus_diagonal(1e-3 * TORUS_LAPLACIAN.diagonal)


def random_matrix(rows, columns, seed):
    random = np.random.default_rng(seed)
    row = np.concatenate([np.arange(rows), random.integers(rows, size=4 * rows)])
    column = random.integers(columns, size=len(row))
    value = random.standard_normal(len(row)) + 1j * random.standard_normal(len(row))
    return from_coo(row, column, value, rows, columns)


def test_products_and_adjoints():
    a, b = random_matrix(60, 40, 0), random_matrix(40, 25, 1)
    product = as_scipy(a) @ as_scipy(b)
    actual = as_scipy(matrix_product(a, b))
    np.testing.assert_allclose(actual.toarray(), product.toarray(), atol=1e-12)
    vector = np.arange(40) * (1 + 2j)
    np.testing.assert_allclose(a @ vector, as_scipy(a) @ vector, atol=1e-10)
    np.testing.assert_array_equal(as_scipy(a.adjoint).toarray(), as_scipy(a).toarray().conj().T)


def test_rows_and_columns():
    chosen = np.random.default_rng(0).permutation(len(LAPLACIAN))[:200]
    expected = as_scipy(LAPLACIAN)[chosen]
    rows = LAPLACIAN.rows(chosen)
    assert abs(as_scipy(rows) - expected).max() == 0
    assert abs(as_scipy(rows.columns(chosen)) - expected[:, chosen]).max() == 0


def test_diagonal_with_several_entries_in_a_row():
    row, column = np.array([0, 1, 1, 0, 1]), np.array([0, 1, 0, 1, 1])
    matrix = from_coo(row, column, np.arange(1, 6) + 0j, 2, 2)
    expected = as_scipy(matrix).toarray() + np.diag([10, 20])
    assert np.array_equal(as_scipy(matrix.plus_diagonal([10, 20])).toarray(), expected)


def test_levels_with_another_diagonal():
    levels = hierarchy(LAPLACIAN)
    random = np.random.default_rng(1)
    diagonal = np.where(random.random(len(LAPLACIAN)) < 0.2, 10.0, 0.0)
    rhs = random.standard_normal(len(LAPLACIAN)) + 0j
    new_levels = add_diagonal(levels, diagonal)
    # 15 iterations would not be enough without a suitable preconditioner.
    cycle = partial(w_cycle, new_levels)
    solution = conjugate_gradient(new_levels[0].matrix, rhs, 1e-12, cycle, max_iterations=20)
    expected = spsolve(as_scipy(LAPLACIAN) + sparse.diags(diagonal), rhs)
    assert np.abs(solution - expected).max() < 1e-6 * np.abs(expected).max()


def test_fixed_unknowns_keep_their_values():
    random = np.random.default_rng(2)
    is_fixed = random.random(len(LAPLACIAN)) < 0.1
    start = random.standard_normal(len(LAPLACIAN)) + 1j * random.standard_normal(len(LAPLACIAN))
    rhs = random.standard_normal(len(LAPLACIAN)) + 0j
    solution = conjugate_gradient(LAPLACIAN, rhs, 1e-11, start=start, is_fixed=is_fixed)
    assert np.array_equal(solution[is_fixed], start[is_fixed])
    matrix, free = as_scipy(LAPLACIAN), ~is_fixed
    known = rhs - matrix[:, is_fixed] @ start[is_fixed]
    expected = spsolve(matrix[free][:, free].tocsc(), known[free])
    assert np.abs(solution[free] - expected).max() < 1e-6


@pytest.mark.parametrize("scale", [0.0, 5e-324, 1e-161, 1e-120])
@pytest.mark.parametrize("start_scale", [1.0, 1e-163])
def test_tiny_right_hand_sides(scale, start_scale):
    random = np.random.default_rng(3)
    rhs = scale * random.standard_normal(len(LAPLACIAN)) + 0j
    start = start_scale * random.standard_normal(len(LAPLACIAN)) + 0j
    jacobi = partial(np.multiply, 1 / LAPLACIAN.diagonal)
    for precondition in jacobi, None:
        solution = conjugate_gradient(LAPLACIAN, rhs, 1e-4, precondition, start=start)
        assert np.abs(solution).max() <= 1e-12 * start_scale + 1e3 * scale + 1e-160


def test_cycles_converge_and_ignore_rows_of_rounding():
    """The row of a component of tiny area can be all rounding, with 0 on the diagonal."""
    matrix = field_laplacian(build_connection(bumpy(icosphere(4))), 4, 0.1)
    count = len(matrix)
    row = np.append(matrix.row_indices, [count, count, 0])
    column = np.append(matrix.indices, [count, 0, count])
    data = np.append(matrix.data, [0, 1e-16, 1e-16])
    with_row = from_coo(row, column, data, count + 1, count + 1)
    rhs = np.append(np.random.default_rng(0).standard_normal(count), 0) + 0j
    expected = spsolve(as_scipy(matrix).tocsc(), rhs[:-1])
    solution, errors = np.zeros_like(rhs), []
    with np.errstate(divide="raise", invalid="raise", over="raise"):
        levels = hierarchy(with_row)
        for _ in range(12):
            solution += w_cycle(levels, rhs - with_row @ solution)
            errors.append(np.linalg.norm(solution[:-1] - expected))
    assert len(levels) > 1 and (np.array(errors[1:]) < 0.8 * np.array(errors[:-1])).all()


def test_unknowns_whose_inverses_overflow_stay_finite():
    """As those of faces far smaller than the others, which are not joined to them."""
    off_diagonal, diagonal = np.array([-1.0, -1e-309]), np.array([2.0, 2.0, 2e-309, 2e-309])
    matrix = from_edges(np.array([0, 2]), np.array([1, 3]), off_diagonal, diagonal)
    solution = conjugate_gradient(matrix, np.array([1.0, 0.0, 1e-300, 0.0]))
    np.testing.assert_allclose(solution[:2], [2 / 3, 1 / 3])
    assert np.isfinite(solution).all()
