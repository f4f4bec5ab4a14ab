"""Parts of sparse matrices, and multigrid levels for matrices that differ by their diagonals."""

from __future__ import annotations

from functools import partial

import numpy as np
import pytest
from scipy import sparse
from scipy.sparse.linalg import spsolve
from shapes import torus

from rosy_addon.field.conjugate_gradient import conjugate_gradient
from rosy_addon.field.connection import build_connection
from rosy_addon.field.connection import laplacian as field_laplacian
from rosy_addon.field.sparse_multigrid import (
    add_diagonal,
    from_coo,
    hierarchy,
    w_cycle,
)


@pytest.fixture(scope="module")
def laplacian():
    connection = build_connection(torus(60, 30))
    matrix = field_laplacian(connection, 4)
    return matrix.plus_diagonal(1e-3 * matrix.diagonal)


def to_scipy(matrix):
    shape = len(matrix), matrix.column_count
    return sparse.csr_matrix((matrix.data, matrix.indices, matrix.indptr), shape)


def test_rows_and_columns(laplacian):
    chosen = np.random.default_rng(0).permutation(len(laplacian))[:200]
    expected = to_scipy(laplacian)[chosen]
    rows = laplacian.rows(chosen)
    assert abs(to_scipy(rows) - expected).max() == 0
    assert abs(to_scipy(rows.columns(chosen)) - expected[:, chosen]).max() == 0


def test_diagonal_with_several_entries_in_a_row():
    row, column = np.array([0, 1, 1, 0, 1]), np.array([0, 1, 0, 1, 1])
    matrix = from_coo(row, column, np.arange(1, 6) + 0j, 2, 2)
    expected = to_scipy(matrix).toarray() + np.diag([10, 20])
    assert np.array_equal(to_scipy(matrix.plus_diagonal([10, 20])).toarray(), expected)


def test_levels_with_another_diagonal(laplacian):
    levels = hierarchy(laplacian)
    random = np.random.default_rng(1)
    diagonal = np.where(random.random(len(laplacian)) < 0.2, 10.0, 0.0)
    rhs = random.standard_normal(len(laplacian)) + 0j
    new_levels = add_diagonal(levels, diagonal)
    # 15 iterations would not be enough without a suitable preconditioner.
    solution = conjugate_gradient(
        new_levels[0].matrix, rhs, 1e-12, partial(w_cycle, new_levels), max_iterations=20
    )
    expected = spsolve(to_scipy(laplacian) + sparse.diags(diagonal), rhs)
    assert np.abs(solution - expected).max() < 1e-6 * np.abs(expected).max()


def test_fixed_unknowns_keep_their_values(laplacian):
    random = np.random.default_rng(2)
    is_fixed = random.random(len(laplacian)) < 0.1
    start = random.standard_normal(len(laplacian)) + 1j * random.standard_normal(len(laplacian))
    rhs = random.standard_normal(len(laplacian)) + 0j
    solution = conjugate_gradient(laplacian, rhs, 1e-11, start=start, is_fixed=is_fixed)
    assert np.array_equal(solution[is_fixed], start[is_fixed])
    matrix, free = to_scipy(laplacian), ~is_fixed
    known = rhs - matrix[:, is_fixed] @ start[is_fixed]
    expected = spsolve(matrix[free][:, free].tocsc(), known[free])
    assert np.abs(solution[free] - expected).max() < 1e-6


@pytest.mark.parametrize("scale", [0.0, 5e-324, 1e-163, 1e-161, 1e-158, 1e-120])
@pytest.mark.parametrize("start_scale", [1.0, 1e-161, 1e-163])
def test_tiny_right_hand_sides(laplacian, scale, start_scale):
    random = np.random.default_rng(3)
    rhs = scale * random.standard_normal(len(laplacian)) + 0j
    start = start_scale * random.standard_normal(len(laplacian)) + 0j
    jacobi = partial(np.multiply, 1 / laplacian.diagonal)
    for precondition in jacobi, None:
        solution = conjugate_gradient(laplacian, rhs, 1e-4, precondition, start=start)
        assert np.abs(solution).max() <= 1e-12 * start_scale + 1e3 * scale + 1e-160
