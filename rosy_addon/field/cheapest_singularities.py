"""Find the singularities that a field needs besides given ones, at vertices where they add least energy.

First, a connection with the given singularities is computed. The smoothest field of this connection (Knöppel,
Crane, Pinkall and Schröder, SIGGRAPH 2013) has the missing singularities. These are then moved from vertex to
neighboring vertex, as long as the sum of the squared turning angles of the field decreases
(`turning_angles`). This energy is like that of electric charges: each singularity lies in the potential of
all other singularities and of the curvature. Singularities of opposite indices vanish where they meet.
"""

import numpy as np

from ..core.errors import RosyError
from ..core.progress import progress, report
from .blocks import neighbors_of_nodes
from .face_graph import LABEL, FaceGraph, face_graph
from .prescribed import check_index_ranges, index_at_nodes
from .rosy_field import check_degree
from .smoothest import eigenproblem, spectral_shift
from .sparse_matrix import CSRMatrix, from_edges
from .surface import Surface
from .turning_angles import least_angles, potential_solver

#: Tolerance of the eigenvector whose singularities are the first candidates.
START_TOLERANCE = 1e-5

#: Largest number of rounds in which singularities move to neighboring vertices.
MAX_STEPS = 60

#: Residual norm at which the solver for the potential stops, relative to the norm of the right-hand side.
TOLERANCE = 1e-8

#: Effective resistance between two neighbors in a triangulation, relative to the resistance of their edge
#: alone: the mean over all edges, by Foster's theorem.
EDGE_RESISTANCE = 1 / 3

#: Smallest share of the singularities that are moved in one round.
MIN_SHARE = 0.05


def cheapest_singularities(
    surface: Surface, degree: int, vertex: np.ndarray, index: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Add the singularities that a field needs besides given ones, at the vertices where they add least energy.

    Parameters
    ----------
    surface : Surface
    degree : int
        N.
    vertex, index : (K,) int ndarray
        Vertices and indices (in units of 1 / N) of the given singularities.

    Returns
    -------
    vertex, index : (K + L,) int64 ndarray
        The K given singularities, followed by the L added ones, which lie at other vertices. On a closed
        surface, all indices add up to N times the Euler characteristic.

    Raises
    ------
    RosyError
        If a vertex cannot be singular (at a border, or not in the mesh) or is given twice, if there are too
        few faces around it for its index, if no vertex is left for the missing singularities, or if no
        face has an area.
    """
    degree = check_degree(degree)
    if not surface.face_frames[0].any():
        raise RosyError(f"{surface.name}: no face has an area")
    graph = face_graph(surface)
    check_index_ranges(graph, degree, vertex, index)
    given = index_at_nodes(graph, vertex, index)
    required = 2 * np.pi / degree * (given - _spread(graph, given))
    with progress(0.1, 0.3):
        angle = graph.conductance * least_angles(graph, degree, required, [], 0.0)
    mass = np.maximum(surface.face_area, 1e-12 * surface.face_area.mean())
    matrix = _energy(graph, degree, angle, spectral_shift(mass) * mass)
    with progress(0.35, 0.6):
        z, _ = eigenproblem(matrix, mass, graph.component, START_TOLERANCE)
    total = graph.indices(graph.turning(z, degree), degree)
    is_taken = ~graph.can_be_singular | np.isin(graph.node_vertex, vertex)
    with progress(0.6, 1.0):
        added = _settled(graph, degree, given, total - given, is_taken)
    if added[is_taken].any():
        raise RosyError(
            f"{surface.name}: no vertex is left for the singularities that are missing: give fewer singularities, or "
            "subdivide the mesh"
        )
    node = np.flatnonzero(added)
    return np.concatenate([vertex, graph.node_vertex[node]]), np.concatenate([index, added[node]])


def _spread(graph: FaceGraph, given: np.ndarray) -> np.ndarray:
    """Return (n,) float64 indices: on each connected component, the sum of the given ones, spread by area.

    `given` holds the index at each vertex node of the graph. Each node gets a part of the sum in proportion
    to the area around it. On components with a border, the result is 0.
    """
    surface = graph.surface
    corner_area = (surface.face_area / np.diff(surface.face_start))[surface.corner_face]
    node_area = np.bincount(graph.corner_node, corner_area, graph.node_count)
    component = graph.node_component
    count = int(component.max(initial=-1)) + 1
    total = np.bincount(component, given, count)
    total[component[~graph.is_interior]] = 0.0
    component_area = np.bincount(component, node_area, count)
    return node_area * (total / np.where(component_area > 0, component_area, 1))[component]


def _settled(
    graph: FaceGraph, degree: int, given: np.ndarray, added: np.ndarray, is_taken: np.ndarray
) -> np.ndarray:
    """Move added singularities until the energy no longer decreases. Return their indices at all nodes, (n,) int64.

    `given` and `added` hold the (n,) indices of the given singularities, which stay, and of the added ones before they
    are moved. The index is 0 at nodes without a singularity. `is_taken`, (n,) bool, marks the nodes at which no
    singularity may be added. Added singularities that are there leave them, if possible.
    """
    if not added.any():
        return added
    with progress(0.0, 0.2):
        potential_of = potential_solver(graph, TOLERANCE)
    unit = 2 * np.pi / degree
    neighbors = _Neighbors(graph, degree, is_taken)
    best, best_potential, least, share = added, None, np.inf, 1.0
    for step in range(MAX_STEPS):
        report(1 - 0.8 * 0.95**step, LABEL)
        charge = unit * (given + added) - graph.defect
        potential = potential_of(charge)
        energy = float(charge[graph.is_interior] @ potential[graph.is_interior])
        # Added singularities that are still at taken nodes have to leave them, even if that adds energy.
        if energy < least or best[is_taken].any():
            best, best_potential, least = added, potential, energy
        else:
            share *= 0.5
            if share < MIN_SHARE:
                break
        added = neighbors.step(best, given, unit, best_potential, share)
        if np.array_equal(added, best):
            break
    return best


class _Neighbors:
    """The vertices to which the singularity at a vertex can move: its neighbors along mesh edges.

    Vertices are represented by the *vertex nodes* of a `FaceGraph`. `is_taken` says of each node whether no
    singularity can be added there.
    """

    def __init__(self, graph: FaceGraph, degree: int, is_taken: np.ndarray) -> None:
        csr = neighbors_of_nodes(graph.node_count, graph.tail, graph.head)
        self._start, self._neighbor, edge = csr
        self._resistance = EDGE_RESISTANCE / np.tile(graph.conductance, 2)[edge]
        self._is_interior, self._is_taken = graph.is_interior, is_taken
        self._low, self._high = graph.index_range(degree)

    def step(
        self, added: np.ndarray, given: np.ndarray, unit: float, potential: np.ndarray, share: float
    ) -> np.ndarray:
        """Return (n,) int64 indices of the added singularities after one round of moves.

        A singularity is moved to the neighbor at which the energy is least, if this reduces the energy. Added
        singularities at a taken node are moved first, by one unit of the index in each round, even if this adds
        energy. They move to a free neighbor that has no added singularity of the same sign. If there is none, they
        leave over the border, else move to another free neighbor, else to a taken one.

        Parameters
        ----------
        added, given : (n,) int ndarray
            Index of the added and of the given singularity at each vertex node; 0 if there is none.
        unit : float
            Angle in radians that an index of 1 stands for: 2 pi / N.
        potential : (n,) float64 ndarray
            Result of `turning_angles.potential_solver` for the right-hand side ``unit * (given + added)``
            minus the angle defects. Its difference between two nodes says how the energy changes.
        share : float
            Fraction of the possible moves that are made in this round, from 0 to 1; at least one is made. The
            moves that reduce the energy most are made first.
        """
        moves = []
        for node in np.flatnonzero(added).tolist():
            around = slice(self._start[node], self._start[node + 1])
            others = self._neighbor[around]
            must_leave = bool(self._is_taken[node])
            moved = int(np.sign(added[node])) if must_leave else int(added[node])
            charge, sum_there = unit * moved, given[others] + added[others] + moved
            change = 2 * charge * (potential[others] - potential[node])
            change += charge**2 * self._resistance[around]
            fits = (self._low[others] <= sum_there) & (sum_there <= self._high[others])
            is_free = ~self._is_taken[others] & fits
            choices = [is_free & (added[others] * moved <= 0)]
            if must_leave:
                choices += [~self._is_interior[others], is_free, self._is_interior[others]]
            allowed = next((choice for choice in choices if choice.any()), choices[0])
            change[~allowed] = np.inf
            least = float(change.min(initial=np.inf))
            if least < 0 or (must_leave and least < np.inf):
                other = int(others[change.argmin()])
                moves.append((not must_leave, least, node, other, moved))
        moves.sort()
        result = added.copy()
        for *_, node, other, moved in moves[: max(1, round(share * len(moves)))]:
            may_add = result[other] * moved <= 0 or added[other] * moved > 0
            if result[node] == added[node] and may_add:
                result[other] += moved
                result[node] -= moved
        result[~self._is_interior] = 0
        return result


def _energy(graph: FaceGraph, degree: int, angle: np.ndarray, diagonal: np.ndarray) -> CSRMatrix:
    """Return a matrix A such that z* A z is the energy of a field with (F,) representations z.

    It is the Dirichlet energy relative to given turning angles. It is 0 for a field that turns by `angle`
    from the source to the target face of each edge: (I,) counter-clockwise angles in radians. `diagonal`
    holds (F,) values that are added to the diagonal of the matrix.
    """
    source, target, weight = graph.source, graph.target, 1 / graph.conductance
    transport = np.exp(1j * degree * (graph.unfolding + angle))
    ends = np.concatenate([source, target])
    diagonal = diagonal + np.bincount(ends, np.tile(weight, 2), len(diagonal))
    return from_edges(target, source, -weight * transport, diagonal)
