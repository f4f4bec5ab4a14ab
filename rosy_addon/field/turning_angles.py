"""Compute the angles by which a field turns across mesh edges, given the indices of its singularities.

Across each interior edge, a field turns relative to parallel transport. This is its *turning angle* at the
edge. The turning angles around a vertex, plus the angle defect of the vertex, add up to 2 pi times the
singularity index. So a field with given indices satisfies one linear equation for each interior vertex. On
surfaces with handles or with several borders, there is one more equation for each loop of faces that cannot
be contracted to a vertex: around it, the field may turn by any multiple of 2 pi / N in total.

The solution with the least weighted sum of squares is a sum of two parts. The first is the gradient of a
potential at the vertices, which solves a Poisson equation on the triangles (`face_graph.TriangleGraph`). The
second is a combination of harmonic angles, one set for each loop. The multiples of 2 pi / N around the loops
are chosen so that this sum of squares, the *energy*, is small.
"""

from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np

from ..core.progress import progress, report
from .blocks import mask
from .conjugate_gradient import conjugate_gradient
from .connectivity import connected_components
from .face_graph import LABEL, FaceGraph, SpanningForest, spanning_forest, triangle_graph
from .sparse_matrix import CSRMatrix, from_edges
from .sparse_multigrid import DIRECT_SOLVE_SIZE, hierarchy, w_cycle

#: Residual norm at which the solver stops, relative to the norm of the right-hand side.
TOLERANCE = 1e-10

#: A field may not turn by pi / N or more between two faces. Number of attempts to reduce larger angles, and
#: the fraction of pi / N up to which the angle at an edge needs no reduction.
MAX_ATTEMPTS, ANGLE_MARGIN = 24, 0.8

#: Largest factor of a resistance after several attempts. With a larger one, the smallest terms in a sum of conductances
#: would be lost to rounding.
MAX_RESISTANCE = 1e15

#: An attempt changes the angles at all edges within this number of edges of an edge with too large an angle.
REACH = 16

#: Smallest limit for an added angle, as a fraction of pi / N (if the present angle nearly uses up pi / N).
MIN_ROOM = 1e-6

#: Largest change of the sum of the angles around a loop that counts as a rounding error, in radians.
MAX_LOOP_CHANGE = 1e-6

#: Smallest eigenvalue of the matrix of the loops, relative to the largest eigenvalue. Smaller eigenvalues are
#: rounding errors and are replaced by it.
MIN_EIGENVALUE = 1e-8

#: With at most this number of loops, the search also changes the multiples of 2 pi / N of two loops at once.
MAX_PAIRED_LOOPS = 20

#: Largest number of unknowns of a dense inverse: 8 MB, a tenth of a second.
MAX_DENSE_SIZE = 1000

#: Loops of faces. Each is an array of the edges that it crosses, and an array of signs: 1 for an edge that is
#: crossed from its source to its target, -1 otherwise.
Loops = list[tuple[np.ndarray, np.ndarray]]


def turning_angles(
    graph: FaceGraph, degree: int, required: np.ndarray, present: np.ndarray | float = 0.0
) -> tuple[np.ndarray, np.ndarray]:
    """Compute turning angles at the interior edges that have given sums around the vertices.

    Parameters
    ----------
    graph : FaceGraph
        Graph of the faces of a surface. Its n nodes are the vertices (several for a nonmanifold vertex).
    degree : int
        N.
    required : (n,) ndarray
        Sums of the angles around interior nodes, in radians; values at other nodes are ignored.
    present : (I,) ndarray or float
        Turning angles of an existing field, to which the result will be added, in radians: counter-clockwise,
        from the source to the target face of each edge.

    Returns
    -------
    angle : (I,) float64 ndarray
        The angles to add to `present`, in the same form. They have the least weighted sum of squares. Around
        each loop, these angles, the present angles and the angles between the frames of neighboring faces add
        up to a multiple of 2 pi / N. Where the field would turn by pi / N or more between two faces, the
        angles are reduced, if possible.
    direction : (F,) float64 ndarray
        Direction, on each face, of the field with the turning angles ``present + angle``: an angle in radians
        in the frame of the face.
    """
    triangles = triangle_graph(graph)
    present_between = triangles.on_triangles(present)
    tree = spanning_forest(len(triangles.area), triangles.graph.source, triangles.graph.target)
    with progress(0.0, 0.2):
        loops = _loops(triangles.graph, tree)
    with progress(0.2, 0.8):
        drop = least_angles(triangles.graph, degree, required, loops, present_between)
    between, to_center = triangles.graph.conductance * drop, triangles.turns_to_centers(drop)
    limit, angle = np.pi / degree, triangles.on_faces(between, to_center)
    resistance = np.ones(len(angle))
    for attempt in range(MAX_ATTEMPTS):
        if np.abs(angle + present).max(initial=0.0) < limit:
            break
        factor = added_resistance(angle, present, limit)
        edges = np.flatnonzero(factor > 1)
        resistance *= factor
        if not len(edges) or resistance.max() > MAX_RESISTANCE:
            break  # only the present angles are too large, or no angles are small enough
        triangles = triangles.with_resistance(factor)
        with progress(1 - 0.2 * 0.5**attempt, 1 - 0.1 * 0.5**attempt):
            changed = _least_angles_near(triangles.graph, required, loops, between, edges)
            if changed is None:
                drop = least_angles(triangles.graph, degree, required, loops, present_between)
                changed = triangles.graph.conductance * drop
        # The resistances apply to the angles between triangles, not to the angles from triangles to face centers.
        for triangle in (triangles.graph.source, triangles.graph.target):
            to_center[triangle[changed != between]] = 0
        between, angle = changed, triangles.on_faces(changed, to_center)
    direction = tree.sums_from_root(triangles.graph.unfolding + present_between + between)
    return angle, triangles.directions_of_faces(direction, between, to_center)


def _least_angles_near(
    graph: FaceGraph, required: np.ndarray, loops: Loops, angle: np.ndarray, changed: np.ndarray
) -> np.ndarray | None:
    """Return (M,) turning angles: least-squares angles near some edges, and the old angles elsewhere.

    `graph` is the graph of triangles with M edges, and `loops` is the result of `_loops` for it. `required`
    holds the (n,) sums of the angles around interior nodes, and `angle` the (M,) old turning angles, in
    radians. `changed` holds the indices of edges whose conductances have changed; angles within `REACH` edges
    of them are computed again. The result is None if the sum of the angles around a loop would change. That
    can happen if the changed neighborhood surrounds a part of the surface.
    """
    is_near = mask(graph.node_count, np.stack([graph.tail[changed], graph.head[changed]]))
    for step in range(REACH):
        report(0.2 * step / REACH, LABEL)
        touches = is_near[graph.tail] | is_near[graph.head]
        is_near[graph.tail[touches]] = is_near[graph.head[touches]] = True
    edges = np.flatnonzero(is_near[graph.tail] & is_near[graph.head])
    new_node = np.cumsum(is_near) - 1
    tail, head = new_node[graph.tail[edges]], new_node[graph.head[edges]]
    fixed = angle.copy()
    fixed[edges] = 0
    near = replace(
        graph,
        tail=tail,
        head=head,
        conductance=graph.conductance[edges],
        is_interior=graph.is_interior[is_near],
        node_component=connected_components(int(is_near.sum()), np.stack([tail, head], axis=1)),
    )
    rest = (required - graph.turn_around_nodes(fixed))[is_near]
    with progress(0.2, 0.5):
        solver = potential_solver(near)
    with progress(0.5, 1.0):
        fixed[edges] = near.conductance * near.drop(solver(rest))
    change = _sums_around(loops, fixed - angle)
    return fixed if np.abs(change).max(initial=0.0) < MAX_LOOP_CHANGE else None


def added_resistance(angle: np.ndarray, present: np.ndarray | float, limit: float) -> np.ndarray:
    """Return (I,) factors, at least 1, for the resistances of edges, to reduce turning angles that are too large.

    The resistance of an edge is the weight of its squared angle in the energy. `angle` holds the (I,) angles that are
    added to the (I,) turning angles `present` of a field. The factor is above 1 where the modulus of their sum is near
    `limit` or above it. All angles are in radians.
    """
    room = np.maximum(limit - np.sign(angle) * present, MIN_ROOM * limit)
    return np.maximum(np.abs(angle) / (ANGLE_MARGIN * room), 1) ** 2


def least_angles(
    graph: FaceGraph, degree: int, required: np.ndarray, loops: Loops, present: np.ndarray | float
) -> np.ndarray:
    """Compute the turning angles of least energy. Return them divided by the conductances of their edges, (M,) float64.

    The energy is the sum of the squared angles, each divided by the conductance. `graph` has M edges: it is the
    graph of triangles (`TriangleGraph.graph`) or, for a simpler solution, the graph of faces. `loops` is the
    result of `_loops` for this graph, or empty to ignore loops. `required` holds the (n,) sums of the angles
    around interior nodes, in radians. `present` holds (M,) turning angles of an existing field at the edges,
    or is 0. `degree` is N.
    """
    with progress(0.0, 0.5):
        many = min(len(loops) * DIRECT_SOLVE_SIZE, MAX_DENSE_SIZE)
        solver = potential_solver(graph, direct_size=max(many, DIRECT_SOLVE_SIZE))
    share = 0.5 / (len(loops) + 1)
    with progress(0.5, 0.5 + share):
        drop = graph.drop(solver(required))
    harmonics = []
    for number, (edges, signs) in enumerate(loops, 1):
        crossing = np.zeros(len(drop))
        np.add.at(crossing, edges, signs)
        start = 0.5 + number * share
        with progress(start, start + share):
            potential = solver(-graph.turn_around_nodes(graph.conductance * crossing))
        harmonics.append(crossing + graph.drop(potential))
    if loops:
        turn = 2 * np.pi / degree
        total = graph.conductance * drop + present + graph.unfolding
        matrix = [_sums_around(loops, graph.conductance * harmonic) for harmonic in harmonics]
        sums = _sums_around(loops, total)
        coefficients = _nearest_lattice_coefficients(np.transpose(matrix), -sums, turn)
        for coefficient, harmonic in zip(coefficients, harmonics, strict=True):
            drop += coefficient * harmonic
    return drop


def _sums_around(loops: Loops, angle: np.ndarray) -> np.ndarray:
    """Return the sum of angles around each of L loops, (L,) float64; `angle` has one for each edge."""
    return np.array([(signs * angle[edges]).sum() for edges, signs in loops])


def potential_solver(
    graph: FaceGraph, tolerance: float = TOLERANCE, direct_size: int = DIRECT_SOLVE_SIZE
) -> Callable[[np.ndarray], np.ndarray]:
    """Return a function that solves the Poisson equation of a graph.

    It takes the (n,) sums of angles around the interior nodes, in radians, and returns the (n,) potential at
    the nodes. The solver stops when the residual norm is `tolerance` times the norm of the right-hand side.
    A multigrid level with at most `direct_size` unknowns is solved with a dense inverse. A larger value pays if the
    returned function is called often.
    """
    matrix = levels = None
    if graph.is_interior.any():
        with progress(0.0, 0.2):
            matrix = _potential_matrix(graph)
        with progress(0.2, 1.0):
            levels = hierarchy(matrix, direct_size)

    def solve(sums: np.ndarray) -> np.ndarray:
        potential = np.zeros(graph.node_count)
        if matrix is not None:
            rhs = sums[graph.is_interior]
            solution = conjugate_gradient(matrix, rhs, tolerance, partial(w_cycle, levels), LABEL)
            potential[graph.is_interior] = solution
        return potential

    return solve


def _potential_matrix(graph: FaceGraph) -> CSRMatrix:
    """Return the Laplacian matrix of potentials at interior nodes. At all other nodes the potential is 0.

    All nodes of a closed component are interior, so a constant could be added to its potential. To make the
    matrix regular, the diagonal element of the first node of the component is increased. This does not change
    the gradient of the solution if the sums on the component add up to 0.
    """
    unknown = np.cumsum(graph.is_interior) - 1
    tail, head, conductance = graph.tail, graph.head, graph.conductance
    diagonal = np.bincount(np.concatenate([tail, head]), np.tile(conductance, 2), graph.node_count)
    _, first = np.unique(graph.node_component, return_index=True)
    tied = first[~mask(len(first), graph.node_component[~graph.is_interior])]
    diagonal[tied] += diagonal[tied] / 6
    diagonal[diagonal == 0] = 1.0  # at an edge whose two sides are the same face
    inside = graph.is_interior[tail] & graph.is_interior[head]
    tail, head = unknown[tail[inside]], unknown[head[inside]]
    return from_edges(tail, head, -conductance[inside], diagonal[graph.is_interior])


def _nearest_lattice_coefficients(matrix: np.ndarray, sums: np.ndarray, turn: float) -> np.ndarray:
    """Return (m,) coefficients c that make the energy c @ matrix @ c small, given the sums matrix @ c.

    The (m, m) matrix has a row and a column for each of m loops. The (m,) sums are in radians. They are given
    up to multiples of `turn`, 2 pi / N. These multiples are first found by rounding. They are then
    changed by 1, one by one and in pairs, as long as that reduces the energy. The search ends because the
    inverse of the matrix is made positive definite, so that only finitely many multiples have less energy
    than the first ones.
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


def _loops(graph: FaceGraph, tree: SpanningForest) -> Loops:
    """Find the loops of faces that cannot be contracted to a vertex, by a tree-cotree decomposition.

    For each loop, the result has two arrays: the edges that the loop crosses, and the sign of each crossing.
    The sign is 1 from the source of the edge to its target, and -1 in the opposite direction.

    There is one loop for each edge that is neither in the spanning forest `tree` of the faces nor in a
    spanning forest of the vertices. In the latter, all border nodes of a component count as one node.
    """
    rest = np.flatnonzero(~tree.has_edge)
    # All border nodes of a component count as the same node.
    node = np.arange(graph.node_count)
    component = graph.node_component
    border = np.flatnonzero(~graph.is_interior)
    first_border = np.zeros(int(component.max(initial=-1)) + 1, dtype=np.intp)
    first_border[component[border[::-1]]] = border[::-1]
    node[border] = first_border[component[border]]
    primal = spanning_forest(graph.node_count, node[graph.tail[rest]], node[graph.head[rest]])
    closing = rest[~primal.has_edge]
    loops = []
    for edge in closing.tolist():
        report(len(loops) / len(closing), LABEL)
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
