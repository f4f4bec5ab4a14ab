"""The conjugate gradient method for sparse Hermitian matrices, preconditioned by multigrid."""

from collections.abc import Callable
from functools import partial

import numpy as np

from ..core.progress import progress, report
from .sparse_matrix import CSRMatrix
from .sparse_multigrid import hierarchy, w_cycle

#: Residual norm at which the iteration stops by default, relative to the norm of the right-hand side.
RELATIVE_TOLERANCE = 1e-9
MAX_ITERATIONS = 400
#: Smallest norm of the residual that is reached, relative to the norm of the first residual.
ROUNDING_ERROR = float(np.finfo(float).eps)


def conjugate_gradient(
    matrix: CSRMatrix,
    rhs: np.ndarray,
    tolerance: float = RELATIVE_TOLERANCE,
    precondition: Callable[[np.ndarray], np.ndarray] | None = None,
    label: str = "solving a linear system",
    start: np.ndarray | None = None,
    is_fixed: np.ndarray | None = None,
    max_iterations: int = MAX_ITERATIONS,
) -> np.ndarray:
    """Solve ``matrix @ solution = rhs`` by the preconditioned conjugate gradient method.

    Parameters
    ----------
    matrix : CSRMatrix
        The (n, n) matrix, Hermitian and positive definite.
    rhs : (n,) complex or float ndarray
        Right-hand side.
    tolerance : float
        Residual norm at which the iteration stops, relative to the norm of `rhs`. The iteration stops earlier
        if rounding errors prevent progress.
    precondition : callable, optional
        Function that multiplies a vector by a Hermitian, positive definite approximation of the inverse of
        the matrix. By default a multigrid W-cycle.
    label : str
        Text that is shown with the progress bar.
    start : (n,) complex or float ndarray, optional
        Estimate from which the iteration starts; 0 by default.
    is_fixed : (n,) bool ndarray, optional
        Unknowns that keep their values in `start`. Their equations are left out.
    max_iterations : int
        Number of iterations after which the solver stops, without an error.

    Returns
    -------
    (n,) complex or float ndarray
        The solution: the last iterate.
    """
    if precondition is None:
        with progress(0.0, 0.5):
            levels = hierarchy(matrix)
        precondition = partial(w_cycle, levels)
    # Scale all numbers so that their squares stay in the range of floating-point numbers. A power of two
    # changes no digits.
    largest = max(float(np.abs(each).max(initial=0)) for each in (rhs, start) if each is not None)
    scale = 0.5 ** np.clip(np.frexp(largest)[1], -1000, 1000)
    rhs = scale * rhs
    if start is None:
        solution, residual = np.zeros_like(rhs), rhs.copy()
    else:
        start = scale * start
        solution, residual = start.copy(), rhs - matrix @ start
    norm = _norm(rhs)
    if is_fixed is not None and is_fixed.any():
        residual[is_fixed] = 0
        known_terms = rhs - matrix @ np.where(is_fixed, solution, 0)
        norm = _norm(known_terms[~is_fixed])
    else:
        is_fixed = None
    smallest_residual = max(tolerance * norm, ROUNDING_ERROR * _norm(residual))
    direction, previous = np.zeros_like(residual), 1.0
    for iteration in range(max_iterations):
        report(1 - 0.5 * 0.8**iteration, label)
        if _norm(residual) <= smallest_residual:
            break
        preconditioned = precondition(residual)
        if is_fixed is not None:
            preconditioned[is_fixed] = 0
        current = _real_inner_product(residual, preconditioned)
        direction = preconditioned + current / previous * direction
        image = matrix @ direction
        if is_fixed is not None:
            image[is_fixed] = 0
        curvature = _real_inner_product(direction, image)
        if current == 0 or curvature == 0:  # the numbers are too small for their squares
            break
        step = current / curvature
        solution += step * direction
        residual -= step * image
        previous = current
    return solution / scale


def _norm(vector: np.ndarray) -> float:
    """Return the Euclidean norm of a real or complex vector."""
    return float(np.sqrt(_real_inner_product(vector, vector)))


def _real_inner_product(a: np.ndarray, b: np.ndarray) -> float:
    """Return the real part of the inner product a* b of two vectors."""
    product = np.sum(a.real * b.real)
    return float(product + np.sum(a.imag * b.imag) if np.iscomplexobj(a) else product)
