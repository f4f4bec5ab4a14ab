"""Rotate a field toward guides without changing its singularities.

The singularities of a field stay if it is rotated by an angle that is continuous over the surface. If the field
has the least squared turning angles (`turning_angles`), its Dirichlet energy grows by the Dirichlet energy of
this angle. So the angle solves a linear equation, once the multiple of 2 pi / N is known that takes the field to
each guide. The first multiples come from a linear equation for the representation, which may have other
singularities. They are improved until they are the nearest ones.
"""

from __future__ import annotations

from functools import partial

import numpy as np

from ..core.progress import progress
from .conjugate_gradient import conjugate_gradient
from .face_graph import FaceGraph
from .representation import complex_bincount, unit_complex
from .sparse_multigrid import CSRMatrix, Level, from_edges, hierarchy, w_cycle
from .turning_angles import added_resistance

#: Residual norm at which the solver stops, relative to the norm of the right-hand side.
TOLERANCE = 1e-8

#: Number of times that the field is kept from turning too fast between two faces.
MAX_ATTEMPTS = 8

#: Number of times that the multiples of the guides are improved.
MAX_ROUNDS = 12

#: Penalty of the nodes without a guide, relative to the stiffness of their edges, so that all angles are
#: defined.
REGULARIZATION = 1e-9

#: Label of the progress.
LABEL = "turning the field to the guides"


def guided_rotation(
    graph: FaceGraph,
    degree: int,
    turning: np.ndarray,
    z: np.ndarray,
    target: np.ndarray,
    penalty: np.ndarray,
) -> np.ndarray:
    """Compute the angle by which a field turns to follow guides.

    Parameters
    ----------
    graph : FaceGraph
    degree : int
        N.
    turning : (I,) ndarray
        Angles by which the field turns at the edges; see `turning_angles`.
    z : (F,) complex ndarray
        Representation of the field, of modulus 1 or 0.
    target : (F,) complex ndarray
        Representation of the guides, 0 where there is none.
    penalty : (F,) ndarray
        Weight of the squared difference from the guide. Squared angles at edges of conductance 1 have the
        weight 1.

    Returns
    -------
    (F,) float64 ndarray
        Angle in radians. It turns no edge by half the angle between two members or more, unless the guides
        require that.
    """
    offset = target * z.conj()
    is_guide = (offset != 0) & (penalty > 0)
    if not is_guide.any():
        return np.zeros(len(z))
    penalty = np.where(is_guide, penalty, 0.0)
    stiffness = 1 / graph.conductance
    wanted = np.angle(offset) / degree
    sector, limit = 2 * np.pi / degree, np.pi / degree
    angle = None
    for attempt in range(MAX_ATTEMPTS):
        rest = 0.5**attempt
        matrix = _system(graph, stiffness, penalty)
        with progress(1 - rest, 1 - 0.9 * rest):
            levels = hierarchy(matrix)
        if angle is None:
            with progress(1 - 0.9 * rest, 1 - 0.7 * rest):
                angle = _initial_angle(graph, stiffness, matrix, levels, offset, penalty)
            angle /= degree
        for index in range(MAX_ROUNDS):
            multiple = np.rint((angle - wanted) / sector)
            rhs = penalty * (wanted + sector * multiple)
            shares = (0.5 + 0.2 * 0.5**step for step in (index, index + 1))
            with progress(*(1 - share * rest for share in shares)):
                angle = _solve(matrix, rhs, levels)
            if np.array_equal(multiple[is_guide], np.rint((angle - wanted) / sector)[is_guide]):
                break
        added = angle[graph.target] - angle[graph.source]
        if np.abs(turning + added).max(initial=0.0) < limit:
            break
        stiffness = stiffness * added_resistance(added, turning, limit)
    return angle


def _system(graph: FaceGraph, stiffness: np.ndarray, penalty: np.ndarray) -> CSRMatrix:
    """Return the Laplacian of the faces, with the penalty on its diagonal."""
    ends = np.concatenate([graph.source, graph.target])
    diagonal = np.bincount(ends, np.tile(stiffness, 2), len(penalty))
    diagonal += penalty + REGULARIZATION * np.where(diagonal > 0, diagonal, 1.0)
    return from_edges(graph.source, graph.target, -stiffness, diagonal)


def _initial_angle(
    graph: FaceGraph,
    stiffness: np.ndarray,
    matrix: CSRMatrix,
    levels: list[Level],
    offset: np.ndarray,
    penalty: np.ndarray,
) -> np.ndarray:
    """Return (F,) N times an angle near the guides: the least-squares unwrapping of their smoothed phases."""
    unit = unit_complex(offset)
    with progress(0.0, 0.3):
        mean = _solve(matrix, penalty * unit, levels)
    difference = np.angle(mean[graph.target] * mean[graph.source].conj())
    count = len(offset)
    divergence = np.bincount(graph.target, stiffness * difference, count)
    divergence -= np.bincount(graph.source, stiffness * difference, count)
    laplacian = _system(graph, stiffness, np.zeros(count))
    with progress(0.3, 1.0):
        angle = _solve(laplacian, divergence, None)
    rest = penalty * unit * np.exp(-1j * angle)
    parts = int(graph.component.max(initial=-1)) + 1
    return angle + np.angle(complex_bincount(graph.component, rest, parts))[graph.component]


def _solve(matrix: CSRMatrix, rhs: np.ndarray, levels: list[Level] | None) -> np.ndarray:
    """Solve a system; see `conjugate_gradient`."""
    precondition = None if levels is None else partial(w_cycle, levels)
    return conjugate_gradient(matrix, rhs, TOLERANCE, precondition, LABEL)
