"""Angles by which a field turns from face to face, from its singularities.

A field on faces turns by some angle from each face to the next, beyond parallel transport. Around a
vertex, these angles and the angle defect add up to the singularity index. So a field with given indices
solves linear equations for the angles, one for each interior vertex; and on surfaces with handles, or with
several borders, one for each loop that no vertex can contract.

The angles of least squares are those of a potential at the vertices, which solves a Poisson equation; and
those of one harmonic solution for each loop. Around a loop, the field may turn by any multiple of 2 pi / N;
the multiples of least energy are chosen.
"""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np

from ..progress import Progress, Task, subtask
from .conjugate_gradient import conjugate_gradient_task
from .face_graph import LABEL, FaceGraph, SpanningForest, spanning_forest_task
from .sparse_multigrid import CSRMatrix, from_coo_task, hierarchy_task, w_cycle

#: Residual norm relative to that of the right-hand side at which the solver stops.
TOLERANCE = 1e-10

#: Attempts to keep the field from turning too fast between two faces, and the angle up to which edges
#: are left alone, relative to half the angle between two members.
MAX_ATTEMPTS, ANGLE_MARGIN = 8, 0.8

#: Least angle that is left to add, relative to half the angle between two members.
MIN_ROOM = 1e-6

#: Least eigenvalue of the matrix of the loops, relative to the largest one. Smaller ones are rounding errors.
MIN_EIGENVALUE = 1e-8

#: Number of loops up to which their multiples are also changed in pairs.
MAX_PAIRED_LOOPS = 20


def turning_angles_task(
    graph: FaceGraph, degree: int, required: np.ndarray, present: np.ndarray | float = 0.0
) -> Task[tuple[np.ndarray, SpanningForest]]:
    """Compute angles at the edges that have given sums around the vertices.

    Parameters
    ----------
    graph : FaceGraph
    degree : int
        N.
    required : (n,) ndarray
        The sums around interior nodes, in radians; those at other nodes do not count.
    present : (I,) ndarray or float
        Angles of a field to which these are added.

    Yields
    ------
    Progress

    Returns
    -------
    angle : (I,) float64 ndarray
        Of least squares, weighted by 1 / conductance. Around loops, the angles are added to those present
        and to the unfolding, and have a sum that is a multiple of 2 pi / N. Where a field would turn by half
        of that or more between two faces, they get smaller, if that is possible.
    tree : SpanningForest
        Of the faces.
    """
    face_count = len(graph.component)
    tree = yield from subtask(
        spanning_forest_task(face_count, graph.source, graph.target), 0.0, 0.1
    )
    loops = yield from subtask(_loops_task(graph, tree), 0.1, 0.2)
    limit = np.pi / degree
    for attempt in range(MAX_ATTEMPTS):
        start, stop = 1 - 0.8 * 0.2**attempt, 1 - 0.8 * 0.2 ** (attempt + 1)
        task = least_angles_task(graph, degree, required, loops, present)
        angle = yield from subtask(task, start, stop)
        if np.abs(angle + present).max(initial=0.0) < limit:
            break
        # Where the field turns too fast, it turns less with a smaller conductance.
        conductance = graph.conductance / added_resistance(angle, present, limit)
        graph = replace(graph, conductance=conductance)
    return angle, tree


def added_resistance(angle: np.ndarray, present: np.ndarray | float, limit: float) -> np.ndarray:
    """(I,) factors by which edges should resist angles more that are added to those present.

    They are 1 where the sum is clearly below the limit.
    """
    room = np.maximum(limit - np.sign(angle) * present, MIN_ROOM * limit)
    return np.maximum(np.abs(angle) / (ANGLE_MARGIN * room), 1) ** 2


def least_angles_task(
    graph: FaceGraph,
    degree: int,
    required: np.ndarray,
    loops: list[tuple[np.ndarray, np.ndarray]],
    present: np.ndarray | float,
) -> Task[np.ndarray]:
    """(I,) angles of least squares; see `turning_angles_task`."""
    yield Progress(0.0, LABEL)
    matrix = levels = None
    if graph.is_interior.any():
        matrix = yield from subtask(potential_matrix_task(graph), 0.0, 0.1)
        levels = yield from subtask(hierarchy_task(matrix), 0.1, 0.5)

    def potential_task(sums: np.ndarray) -> Task[np.ndarray]:
        """(I,) angles of the potential whose angles have the sums around the nodes."""
        if matrix is None:
            return np.zeros(len(graph.source))
        solution = yield from conjugate_gradient_task(
            matrix,
            sums[graph.is_interior].astype(np.complex128),
            TOLERANCE,
            partial(w_cycle, levels),
            LABEL,
        )
        potential = np.zeros(graph.node_count)
        potential[graph.is_interior] = solution.real
        return graph.conductance * (potential[graph.head] - potential[graph.tail])

    share = 0.5 / (len(loops) + 1)
    angle = yield from subtask(potential_task(required), 0.5, 0.5 + share)
    harmonics = []
    for number, (edges, signs) in enumerate(loops, 1):
        crossing = np.zeros(len(angle))
        np.add.at(crossing, edges, signs)
        crossing *= graph.conductance
        task = potential_task(-graph.turn_around_nodes(crossing))
        start = 0.5 + number * share
        harmonics.append(crossing + (yield from subtask(task, start, start + share)))
    if loops:
        turn = 2 * np.pi / degree
        total = angle + present + graph.unfolding
        sums = np.array([(signs * total[edges]).sum() for edges, signs in loops])
        matrix_of_loops = np.array(
            [[(signs * harmonic[edges]).sum() for harmonic in harmonics] for edges, signs in loops]
        )
        coefficients = _nearest_lattice_coefficients(matrix_of_loops, -sums, turn)
        for coefficient, harmonic in zip(coefficients, harmonics, strict=True):
            angle += coefficient * harmonic
    return angle


def potential_matrix_task(graph: FaceGraph) -> Task[CSRMatrix]:
    """The Laplacian of potentials at interior nodes, which are 0 at the others.

    On closed components, the first node is
    tied to 0 as well; the sums of a solvable equation do not change that node.
    """
    count, unknown = int(graph.is_interior.sum()), np.cumsum(graph.is_interior) - 1
    tail, head, conductance = graph.tail, graph.head, graph.conductance
    diagonal = np.bincount(np.concatenate([tail, head]), np.tile(conductance, 2), graph.node_count)
    _, first = np.unique(graph.node_component, return_index=True)
    is_open = np.zeros(len(first), dtype=bool)
    is_open[graph.node_component[~graph.is_interior]] = True
    tied = first[~is_open]
    diagonal[tied] += diagonal[tied] / 6
    inside = graph.is_interior[tail] & graph.is_interior[head]
    tail, head = unknown[tail[inside]], unknown[head[inside]]
    nodes = np.arange(count)
    value = np.concatenate(
        [-conductance[inside], -conductance[inside], diagonal[graph.is_interior]]
    ).astype(np.complex128)
    row = np.concatenate([tail, head, nodes]).astype(np.intp)
    column = np.concatenate([head, tail, nodes]).astype(np.intp)
    return (yield from from_coo_task(row, column, value, count, count))


def _nearest_lattice_coefficients(matrix: np.ndarray, sums: np.ndarray, turn: float) -> np.ndarray:
    """(m,) coefficients c of least energy for which matrix @ c equals the sums up to multiples of a turn.

    The energy is c @ matrix @ c. The nearest multiples are found by rounding, then one by one and in
    pairs as long as that reduces the energy. This ends: the inverse is made positive definite, so that only
    finitely many multiples have less energy than the first ones.
    """
    eigenvalue, vector = np.linalg.eigh((matrix + matrix.T) / 2)
    largest = max(float(np.abs(eigenvalue).max()), 1e-300)
    inverse = vector / np.maximum(eigenvalue, MIN_EIGENVALUE * largest) @ vector.T
    multiple = np.rint(-sums / turn)

    def energy(multiple: np.ndarray) -> float:
        rest = sums + turn * multiple
        return float(rest @ inverse @ rest)

    steps = [*np.eye(len(sums)), *-np.eye(len(sums))]
    if len(sums) <= MAX_PAIRED_LOOPS:
        steps += [first + second for first in steps for second in steps if (first + second).any()]
    best, improved = energy(multiple), True
    while improved:
        improved = False
        for step in steps:
            value = energy(multiple + step)
            if value < best * (1 - 1e-9):
                best, multiple, improved = value, multiple + step, True
    return inverse @ (sums + turn * multiple)


def _loops_task(
    graph: FaceGraph, tree: SpanningForest
) -> Task[list[tuple[np.ndarray, np.ndarray]]]:
    """Find loops of faces that no vertex can contract: edges that they cross, and 1 or -1 for each.

    They are closed by the edges that are neither in the spanning forest of the faces nor in one of the
    vertices (the tree-cotree decomposition), where all border nodes of a component are one.
    """
    rest = np.flatnonzero(~tree.has_edge)
    # All border nodes of a component are the same node.
    node = np.arange(graph.node_count)
    component = graph.node_component
    border = np.flatnonzero(~graph.is_interior)
    first_border = np.zeros(int(component.max(initial=-1)) + 1, dtype=np.intp)
    first_border[component[border[::-1]]] = border[::-1]
    node[border] = first_border[component[border]]
    task = spanning_forest_task(graph.node_count, node[graph.tail[rest]], node[graph.head[rest]])
    primal = yield from subtask(task, 0.0, 0.5)
    closing = rest[~primal.has_edge]
    loops = []
    for edge in closing.tolist():
        yield Progress(0.5 + 0.5 * len(loops) / len(closing), LABEL)
        edges, signs = [np.array([edge])], [np.array([1.0])]
        for face, sign in ((graph.target[edge], -1.0), (graph.source[edge], 1.0)):
            path = tree.path_to_root(int(face))
            edges.append(tree.parent_edge[path])
            signs.append(sign * tree.parent_sign[path])
        all_edges, all_signs = np.concatenate(edges), np.concatenate(signs)
        used, position = np.unique(all_edges, return_inverse=True)
        total = np.bincount(position, all_signs)
        loops.append((used[total != 0], total[total != 0]))
    return loops
