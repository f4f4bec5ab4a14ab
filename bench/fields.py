"""Time of the smoothest field relative to SciPy's sparse LU, and how it grows with the mesh."""

from __future__ import annotations

import sys
from collections.abc import Iterator

import numpy as np

from rosy_addon.field.connection import Connection, build_connection, laplacian
from rosy_addon.field.smoothest import smallest_eigenvectors, smoothest_field
from rosy_addon.field.sparse_multigrid import CSRMatrix

from . import cases
from .timing import Case, compare, main

DEGREE = 4

#: Steps of inverse iteration, enough for the energy to converge to a thousandth.
ITERATIONS = 20


def measure(runs: int) -> Iterator[Case]:
    """Time both solvers, starting from the same connection of the mesh."""
    try:
        import scipy.sparse.linalg
    except ImportError:
        print("SciPy's LU: skipped, because scipy is not installed", file=sys.stderr)
        return
    connection = build_connection(cases.ball(200_000))
    matrix = laplacian(connection, DEGREE)

    def solve_with_scipy() -> None:
        shifted = _csc(matrix, connection)
        inverse = scipy.sparse.linalg.splu(shifted)
        z = np.random.default_rng(0).standard_normal(connection.node_count).astype(complex)
        for _ in range(ITERATIONS):
            z = inverse.solve(connection.mass * z)
            z /= np.sqrt(connection.mass @ np.abs(z) ** 2)

    yield compare(
        f"smoothest field / SciPy's LU and {ITERATIONS} iterations, 200K triangles, N = {DEGREE}",
        lambda: smallest_eigenvectors(connection, DEGREE),
        solve_with_scipy,
        target=1.5,
        higher_is_better=False,
        runs=runs,
    )
    yield compare(
        f"smoothest field, 800K / 200K triangles, N = {DEGREE}",
        lambda: smoothest_field(cases.ball(800_000), DEGREE),
        lambda: smoothest_field(cases.ball(200_000), DEGREE),
        target=5.0,
        higher_is_better=False,
        runs=runs,
    )


def _csc(matrix: CSRMatrix, connection: Connection) -> object:
    """Convert a matrix to SciPy, made positive definite."""
    import scipy.sparse

    shape = len(matrix), matrix.column_count
    sparse = scipy.sparse.csr_matrix((matrix.data, matrix.indices, matrix.indptr), shape)
    return (sparse + 1e-8 * scipy.sparse.diags(connection.mass)).tocsc()


if __name__ == "__main__":
    sys.exit(main(__doc__, measure))
