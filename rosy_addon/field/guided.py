"""Smooth fields that follow given guide vectors.

The field minimizes its Dirichlet energy plus a penalty for the difference from the guides, as by
Knöppel, Crane, Pinkall and Schröder, SIGGRAPH 2013, section 4. The weight of the penalty may vary
between faces. Hard guides are constraints instead of penalties.
"""

from __future__ import annotations

import numpy as np

from ..errors import RosyError
from ..memory import raise_mmap_threshold
from ..progress import Progress, Task, run_to_completion, subtask
from .connection import connection_task, laplacian_task
from .representation import complex_bincount, face_frames, from_representation, to_representation
from .rosy_field import RosyField, check_degree
from .smoothest import corner_frame_angles, node_sum_per_face, smoothest_task
from .sparse_multigrid import CSRMatrix, Level, from_coo_task, hierarchy_task, w_cycle
from .surface import Surface

#: Residual norm relative to that of the right-hand side at which conjugate gradients stop, by default.
RELATIVE_TOLERANCE = 1e-9
MAX_ITERATIONS = 400


def guided_field(
    surface: Surface,
    degree: int,
    guides: np.ndarray,
    weight: np.ndarray | float,
    hard: np.ndarray | None = None,
) -> RosyField:
    """Compute a guided field; see `guided_task`."""
    return run_to_completion(guided_task(surface, degree, guides, weight, hard))


def guided_task(
    surface: Surface,
    degree: int,
    guides: np.ndarray,
    weight: np.ndarray | float,
    hard: np.ndarray | None = None,
    tolerance: float = RELATIVE_TOLERANCE,
) -> Task[RosyField]:
    """Compute the smooth field that follows guides.

    Parameters
    ----------
    surface : Surface
    degree : int
    guides : (F, 3) ndarray
        One member vector for each face, in object space; zero where there is no guide. Lengths
        matter: a guide of length 1/2 requests a field of magnitude 1/2.
    weight : (F,) ndarray or float
        Weight of the guide of each face, in units of 1 / area. The influence of a guide of weight w
        falls off over a distance of about 1 / sqrt(w).
    hard : (F,) bool ndarray, optional
        Faces on which the guide is followed exactly.
    tolerance : float
        Residual norm relative to that of the right-hand side at which the solver stops.

    Yields
    ------
    Progress

    Returns
    -------
    RosyField
        Of magnitude 1; zero on connected components without a guide and on faces without area.

    Raises
    ------
    RosyError
        If no face with an area has a guide, or the degree is out of range.
    """
    degree = check_degree(degree)
    raise_mmap_threshold()
    yield Progress(0.0, "building the connection Laplacian")
    x, y = face_frames(surface)
    target = to_representation(np.asarray(guides, dtype=np.float64), x, y, degree)
    hard = np.zeros(surface.face_count, dtype=bool) if hard is None else hard & (target != 0)
    if not target.any():
        raise RosyError(f"{surface.name}: all guides are zero, or on faces without area")
    weight = np.where(target != 0, np.broadcast_to(weight, target.shape), 0.0)
    connection = yield from subtask(connection_task(surface), 0.01, 0.04)
    label = "averaging the guides at the vertices"
    yield Progress(0.04, label)
    frame_angle = corner_frame_angles(surface, connection, x, y)
    yield Progress(0.045, label)
    to_node = np.exp(-1j * degree * frame_angle)
    corner_face = np.repeat(surface.triangle_face, 3)
    corner_area = np.repeat(connection.area / 3, 3)
    node, count = connection.corner_node, connection.node_count
    yield Progress(0.05, label)
    penalty = np.bincount(node, corner_area * weight[corner_face], count)
    rhs = complex_bincount(node, corner_area * (weight * target)[corner_face] * to_node, count)
    yield Progress(0.055, label)
    # Nodes of faces with hard guides are fixed at the mean guide, unless the guides cancel.
    fixed_z = complex_bincount(node, corner_area * (hard * target)[corner_face] * to_node, count)
    max_modulus = np.bincount(node, corner_area * (hard * np.abs(target))[corner_face], count)
    fixed = np.abs(fixed_z) > 1e-6 * max_modulus
    fixed_z[~fixed] = 0
    fixed_z[fixed] /= np.abs(fixed_z[fixed])
    yield Progress(0.06, "building the connection Laplacian")
    z = fixed_z.copy()
    free = np.flatnonzero(~fixed)
    if len(free):
        matrix = yield from subtask(laplacian_task(connection, degree), 0.06, 0.08)
        yield Progress(0.08, "building the connection Laplacian")
        task = _eliminate_fixed_task(matrix, penalty, fixed, fixed_z)
        matrix, fixed_terms = yield from subtask(task, 0.08, 0.09)
        yield Progress(0.09, "building the connection Laplacian")
        solver = conjugate_gradient_task(matrix, (rhs - fixed_terms)[free], tolerance)
        z[free] = yield from subtask(solver, 0.1, 0.95)
    yield Progress(0.95, "averaging the field on the faces")
    face_z = node_sum_per_face(surface, connection, z, frame_angle, degree)
    yield Progress(0.98, "averaging the field on the faces")
    modulus = np.abs(face_z)
    defined = modulus > 1e-9 * max(float(modulus.max()), 1e-300)
    face_z = np.divide(face_z, modulus, out=np.zeros_like(face_z), where=defined)
    face_z[hard] = target[hard] / np.abs(target[hard])
    return RosyField(degree, from_representation(face_z, x, y, degree))


def guided_or_smoothest_task(
    surface: Surface,
    degree: int,
    guides: np.ndarray,
    weight: np.ndarray | float | None = None,
    hard: np.ndarray | None = None,
    tolerance: float = RELATIVE_TOLERANCE,
) -> Task[RosyField]:
    """A guided field, with the smoothest field on connected components without a guide.

    Without `weight`, all guides are followed exactly. The parameters are those of `guided_task`.
    """
    if weight is None:
        weight, hard = 0.0, guides.any(axis=1)
    task = guided_task(surface, degree, guides, weight, hard, tolerance)
    field = yield from subtask(task, 0.0, 0.6)
    unguided = ~field.vectors.any(axis=1) & surface.face_normal.any(axis=1)
    if not unguided.any():
        return field
    smoothest = yield from subtask(smoothest_task(surface, degree), 0.6, 1.0)
    return RosyField(degree, np.where(unguided[:, None], smoothest.vectors, field.vectors))


def _eliminate_fixed_task(
    matrix: CSRMatrix, penalty: np.ndarray, fixed: np.ndarray, fixed_z: np.ndarray
) -> Task[tuple[CSRMatrix, np.ndarray]]:
    """Eliminate the fixed nodes from the linear system.

    Returns
    -------
    matrix : CSRMatrix
        The system matrix of the free nodes, with the penalty on its diagonal.
    fixed_terms : (n,) complex128 ndarray
        The product of the full matrix and `fixed_z`, to subtract from the right-hand side.
    """
    label = "building the connection Laplacian"
    fixed_terms = matrix @ fixed_z
    yield Progress(0.2, label)
    row, column = matrix.row_indices, matrix.indices
    yield Progress(0.25, label)
    is_free = ~fixed[row] & ~fixed[column]
    free_index = np.cumsum(~fixed) - 1
    yield Progress(0.3, label)
    row = free_index[row[is_free]]
    yield Progress(0.35, label)
    column, value = free_index[column[is_free]], matrix.data[is_free]
    yield Progress(0.4, label)
    diagonal = penalty[~fixed] + 1e-12 * matrix.diagonal[~fixed]
    yield Progress(0.6, label)
    diagonal_index = np.arange(len(diagonal))
    task = from_coo_task(
        np.concatenate([row, diagonal_index]),
        np.concatenate([column, diagonal_index]),
        np.concatenate([value, diagonal]),
        len(diagonal),
        len(diagonal),
    )
    return (yield from subtask(task, 0.6, 1.0, label)), fixed_terms


def conjugate_gradient_task(
    matrix: CSRMatrix,
    rhs: np.ndarray,
    tolerance: float = RELATIVE_TOLERANCE,
    levels: list[Level] | None = None,
    label: str = "interpolating between the guides",
) -> Task[np.ndarray]:
    """Solve ``matrix @ solution = rhs`` by conjugate gradients, preconditioned with W-cycles.

    Parameters
    ----------
    matrix : CSRMatrix
        (n, n), Hermitian and positive definite.
    rhs : (n,) complex ndarray
    tolerance : float
        Residual norm relative to that of `rhs` at which the iteration stops.
    levels : list of Level, optional
        `hierarchy_task` of the matrix, if it is known.
    label : str
        Of the progress.

    Yields
    ------
    Progress

    Returns
    -------
    (n,) complex ndarray
        The last iterate, after at most `MAX_ITERATIONS`.
    """
    if levels is None:
        levels = yield from subtask(hierarchy_task(matrix), 0.0, 0.5)
    solution, residual = np.zeros_like(rhs), rhs.copy()
    tolerance *= np.sqrt(_real_inner_product(rhs, rhs))
    direction, previous = None, 1.0
    for iteration in range(MAX_ITERATIONS):
        yield Progress(0.5 + 0.5 * (1 - 0.9**iteration), label)
        if np.sqrt(_real_inner_product(residual, residual)) <= tolerance:
            break
        preconditioned = w_cycle(levels, residual)
        current = _real_inner_product(residual, preconditioned)
        direction = (
            preconditioned if direction is None else preconditioned + current / previous * direction
        )
        image = matrix @ direction
        step = current / _real_inner_product(direction, image)
        solution += step * direction
        residual -= step * image
        previous = current
    return solution


def _real_inner_product(a: np.ndarray, b: np.ndarray) -> float:
    """The real part of the inner product a* b."""
    return float(np.sum(a.real * b.real) + np.sum(a.imag * b.imag))
