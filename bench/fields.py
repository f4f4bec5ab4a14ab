"""Measure how long the least eigenvector takes, relative to SciPy's sparse LU, and the smoothest field by mesh size."""

import numpy as np

from rosy_addon.field.connection import build_connection, laplacian
from rosy_addon.field.smoothest import eigenproblem, smoothest_field, spectral_shift

from . import cases
from .timing import Bench, main, peer

DEGREE = 4

#: Steps of inverse iteration with SciPy, enough for the energy to converge to a thousandth.
ITERATIONS = 20


def measure(bench: Bench) -> None:
    """Time both solvers, which start from the same discrete connection of the mesh."""
    sparse, linalg = peer("scipy.sparse"), peer("scipy.sparse.linalg")
    connection = build_connection(cases.ball(200_000))
    mass = connection.positive_mass
    # The shift makes the matrix positive definite.
    rosy = laplacian(connection, DEGREE, spectral_shift(mass))
    matrix = sparse.csr_matrix((rosy.data, rosy.indices, rosy.indptr), (len(rosy),) * 2)

    def solve_with_scipy() -> None:
        inverse = linalg.splu(matrix.tocsc())
        z = np.random.default_rng(0).standard_normal(connection.node_count).astype(complex)
        for _ in range(ITERATIONS):
            z = inverse.solve(mass * z)
            z /= np.sqrt(mass @ np.abs(z) ** 2)

    bench.compare(
        f"least eigenvector / SciPy's LU and {ITERATIONS} iterations, 200K triangles, N = {DEGREE}",
        lambda: eigenproblem(rosy, mass, connection.component, 1e-4),
        solve_with_scipy,
        at_most=1.5,
    )
    bench.compare(
        f"smoothest field, 800K / 200K triangles, N = {DEGREE}",
        lambda: smoothest_field(cases.ball(800_000), DEGREE),
        lambda: smoothest_field(cases.ball(200_000), DEGREE),
        at_most=5.0,
    )


if __name__ == "__main__":
    main(__doc__, measure)
