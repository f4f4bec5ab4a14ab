"""The smoothest field with given singularities (Crane, Desbrun and Schröder, *Trivial Connections*, 2010).

A field on faces turns by some angle from each face to the next, beyond parallel transport. Around a
vertex, these angles and the angle defect add up to the singularity index. So a field with given indices
solves linear equations for the angles, one for each interior vertex; and on surfaces with handles, or with
several borders, one for each loop that no vertex can contract. Among the solutions, that of the least
squared angles has the least Dirichlet energy, but for terms of fourth order.

The angles are those of a potential at the vertices, which solves a Poisson equation; and those of one
harmonic solution for each loop. Around a loop, the field may turn by any multiple of 2 pi / N; the multiples
of least energy are chosen.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ..errors import RosyError
from ..memory import raise_mmap_threshold
from ..progress import Progress, Task, run_to_completion, subtask
from .analysis import edge_lengths
from .guided import conjugate_gradient_task
from .representation import (
    complex_bincount,
    edge_unfolding,
    face_frames,
    from_representation,
    to_representation,
)
from .rosy_field import RosyField, check_degree
from .singularities import signed_corner_angles_task
from .sparse_multigrid import CSRMatrix, from_coo_task, hierarchy_task
from .surface import Surface, connected_components, edges_task, next_corners

#: Residual norm relative to that of the right-hand side at which the solver stops.
TOLERANCE = 1e-10

#: Smallest and largest conductance of an edge, relative to the median.
MAX_CONDUCTANCE_RATIO = 1e4

#: Attempts to keep the field from turning too fast between two faces, and the angle up to which edges
#: are left alone, relative to half the angle between two members.
MAX_ATTEMPTS, ANGLE_MARGIN = 8, 0.8

#: Number of loops up to which their multiples are also changed in pairs.
MAX_PAIRED_LOOPS = 20

#: Label of all steps.
LABEL = "placing the singularities"


@dataclass(frozen=True, eq=False)
class FaceGraph:
    """The faces of a surface as nodes of a graph, with an edge where a field continues.

    A *vertex node* is a vertex with those of its corners that are connected by such edges.

    Attributes
    ----------
    source, target : (I,) int32 ndarray
        The two faces at each edge.
    unfolding : (I,) float64 ndarray
        Angle in radians that is added to a direction in the frame of the source, if it is transported to
        that of the target.
    tail, head : (I,) int32 ndarray
        The vertex nodes at the start and at the end of the edge, as the source runs along it.
    conductance : (I,) float64 ndarray
        Distance of the centers of both faces over the length of the edge.
    corner_node : (C,) int32 ndarray
        Vertex node of each corner.
    is_interior : (n,) bool ndarray
        Whether edges surround the vertex node.
    defect : (n,) float64 ndarray
        2 pi minus the angles of its corners.
    component : (F,) int32 ndarray
        Connected component of each face.
    node_component : (n,) int32 ndarray
        That of the faces of each vertex node.
    """

    source: np.ndarray
    target: np.ndarray
    unfolding: np.ndarray
    tail: np.ndarray
    head: np.ndarray
    conductance: np.ndarray
    corner_node: np.ndarray
    is_interior: np.ndarray
    defect: np.ndarray
    component: np.ndarray
    node_component: np.ndarray

    @property
    def node_count(self) -> int:
        """n, the number of vertex nodes."""
        return len(self.is_interior)

    def turn_around_nodes(self, angle: np.ndarray) -> np.ndarray:
        """Return (n,) float64: how much (I,) angles at the edges add up to, counter-clockwise."""
        count = self.node_count
        return np.bincount(self.head, angle, count) - np.bincount(self.tail, angle, count)


def prescribed_field(
    surface: Surface,
    degree: int,
    vertex: np.ndarray,
    index: np.ndarray,
    guides: np.ndarray | None = None,
) -> RosyField:
    """Compute a field with given singularities; see `prescribed_task`."""
    return run_to_completion(prescribed_task(surface, degree, vertex, index, guides))


def prescribed_task(
    surface: Surface,
    degree: int,
    vertex: np.ndarray,
    index: np.ndarray,
    guides: np.ndarray | None = None,
) -> Task[RosyField]:
    """Compute the smoothest field with given singularities, and no other ones.

    Parameters
    ----------
    surface : Surface
    degree : int
        N.
    vertex : (K,) int ndarray
        The singular vertices.
    index : (K,) int ndarray
        Their indices in units of 1 / N.
    guides : (F, 3) ndarray, optional
        Member vectors, zero where there is no guide. On each connected component, the whole field is
        turned to them; without guides, to the edges of the mesh.

    Yields
    ------
    Progress

    Returns
    -------
    RosyField
        Of magnitude 1; zero on faces without area.

    Raises
    ------
    RosyError
        If a vertex has no index (at a border, or not in the mesh), if the indices do not have the sum
        that a closed surface needs, or if the field would turn too fast for the size of the faces.
    """
    degree = check_degree(degree)
    raise_mmap_threshold()
    vertex, index = np.asarray(vertex, dtype=np.int64), np.asarray(index, dtype=np.int64)
    x, y = face_frames(surface)
    graph = yield from subtask(face_graph_task(surface, x, y), 0.0, 0.2, LABEL)
    yield Progress(0.2, LABEL)
    node_index = _index_at_nodes(surface, graph, vertex, index)
    _check_sums(surface, graph, degree, node_index)
    required = 2 * np.pi / degree * node_index - graph.defect
    angle, tree = yield from subtask(_turning_angles_task(graph, degree, required), 0.2, 0.85)
    _check_angles(surface, graph, degree, angle)
    yield Progress(0.85, LABEL)
    direction = tree.sums_from_root(graph.unfolding + angle)
    z = np.exp(1j * degree * direction) * x.any(axis=1)
    z *= _rotation_to_guides(surface, graph, z, x, y, degree, guides)[graph.component]
    return RosyField(degree, from_representation(z, x, y, degree))


def face_graph_task(surface: Surface, x: np.ndarray, y: np.ndarray) -> Task[FaceGraph]:
    """Build the graph of the faces of a surface with (F, 3) frames x, y."""
    edges = yield from subtask(edges_task(surface.corner_vertex, surface.face_start), 0.0, 0.3)
    yield Progress(0.3, LABEL)
    has_area = x.any(axis=1)
    halfedges = edges.halfedges
    halfedges = halfedges[has_area[surface.corner_face[halfedges]].all(axis=1)]
    a, b = halfedges.T
    following = next_corners(surface.face_start)
    source, target = surface.corner_face[a], surface.corner_face[b]
    unfolding = edge_unfolding(surface, x, y, a, b)
    yield Progress(0.5, LABEL)
    length, distance = edge_lengths(surface, a, b)
    conductance = distance / np.maximum(length, 1e-300)
    median = max(float(np.median(conductance)), 1e-300) if len(a) else 1.0
    np.clip(
        conductance, median / MAX_CONDUCTANCE_RATIO, median * MAX_CONDUCTANCE_RATIO, out=conductance
    )
    yield Progress(0.6, LABEL)
    corner_count = len(surface.corner_vertex)
    pairs = np.concatenate(
        [np.stack([a, following[b]], axis=1), np.stack([following[a], b], axis=1)]
    )
    corner_node = connected_components(corner_count, pairs)
    continues = np.zeros(corner_count, dtype=bool)
    continues[halfedges.ravel()] = True
    is_interior = np.ones(int(corner_node.max(initial=-1)) + 1, dtype=bool)
    is_interior[corner_node[~continues]] = False
    is_interior[corner_node[following[~continues]]] = False
    yield Progress(0.8, LABEL)
    corner_angle = yield from subtask(signed_corner_angles_task(surface, x, y), 0.8, 0.9)
    yield Progress(0.9, LABEL)
    component = connected_components(surface.face_count, np.stack([source, target], axis=1))
    node_component = np.zeros(len(is_interior), dtype=component.dtype)
    node_component[corner_node] = component[surface.corner_face]
    return FaceGraph(
        source=source,
        target=target,
        unfolding=np.angle(unfolding),
        tail=corner_node[a],
        head=corner_node[b],
        conductance=conductance,
        corner_node=corner_node,
        is_interior=is_interior,
        defect=2 * np.pi - np.bincount(corner_node, corner_angle, len(is_interior)),
        component=component,
        node_component=node_component,
    )


def _index_at_nodes(
    surface: Surface, graph: FaceGraph, vertex: np.ndarray, index: np.ndarray
) -> np.ndarray:
    """(n,) int64 indices of the vertex nodes. That of a vertex is at its first node."""
    vertex_count = len(surface.vertices)
    out_of_range = (vertex < 0) | (vertex >= vertex_count)
    if out_of_range.any():
        raise RosyError(
            f"{surface.name}: has no vertex {vertex[out_of_range][0]}: its vertices are numbered 0 to "
            f"{vertex_count - 1}"
        )
    node_of_vertex = np.full(vertex_count, -1)
    interior = np.flatnonzero(graph.is_interior[graph.corner_node])[::-1]
    node_of_vertex[surface.corner_vertex[interior]] = graph.corner_node[interior]
    node = node_of_vertex[vertex]
    if (node < 0).any():
        raise RosyError(
            f"{surface.name}: vertex {vertex[node < 0][0]} cannot be singular, because it is at a border, "
            "at faces without area, or has no face: choose another vertex"
        )
    result = np.zeros(graph.node_count, dtype=np.int64)
    np.add.at(result, node, index)
    return result


def _check_sums(surface: Surface, graph: FaceGraph, degree: int, node_index: np.ndarray) -> None:
    """Check that the indices have the sum that each closed component needs.

    Raises
    ------
    RosyError
        If one has another sum.
    """
    component = graph.node_component
    count = int(component.max(initial=-1)) + 1
    is_closed = np.ones(count, dtype=bool)
    is_closed[component[~graph.is_interior]] = False
    needed = np.rint(np.bincount(component, graph.defect, count) * degree / (2 * np.pi)).astype(int)
    given = np.rint(np.bincount(component, node_index, count)).astype(int)
    wrong = np.flatnonzero(is_closed & (needed != given))
    if not len(wrong):
        return
    first = wrong[0]
    vertices = surface.corner_vertex[component[graph.corner_node] == first]
    part = "" if count == 1 else f"the part with vertex {vertices.min()}: "
    raise RosyError(
        f"{surface.name}: {part}the singularity indices add up to {given[first]}/{degree}, but this "
        f"closed surface needs {needed[first]}/{degree}: add or change singularities"
    )


def _check_angles(surface: Surface, graph: FaceGraph, degree: int, angle: np.ndarray) -> None:
    """Check that a field turns by less than half the angle between two members from face to face.

    Raises
    ------
    RosyError
        If it does not: then other members match, and the indices are not those that were asked for.
    """
    if not len(angle) or np.abs(angle).max() < np.pi / degree:
        return
    node = graph.head[np.abs(angle).argmax()]
    vertex = surface.corner_vertex[np.flatnonzero(graph.corner_node == node)[0]]
    raise RosyError(
        f"{surface.name}: near vertex {vertex}, a field of degree {degree} with these singularities would "
        "turn too fast for the size of the faces: subdivide the mesh, move singularities apart, or choose "
        "smaller indices"
    )


def _rotation_to_guides(
    surface: Surface,
    graph: FaceGraph,
    z: np.ndarray,
    x: np.ndarray,
    y: np.ndarray,
    degree: int,
    guides: np.ndarray | None,
) -> np.ndarray:
    """(components,) factors that turn representations to the guides, or to the edges of the mesh."""
    count = int(graph.component.max(initial=-1)) + 1
    face = surface.corner_face
    edge = surface.vertices[surface.corner_vertex[next_corners(surface.face_start)]]
    edge = edge - surface.vertices[surface.corner_vertex]
    target = complex_bincount(
        face, to_representation(edge, x[face], y[face], degree), surface.face_count
    )
    total = complex_bincount(graph.component, target * z.conj(), count)
    if guides is not None:
        guided = to_representation(np.asarray(guides, dtype=np.float64), x, y, degree)
        guided = complex_bincount(graph.component, guided * z.conj(), count)
        total = np.where(np.abs(guided) > 0, guided, total)
    modulus = np.abs(total)
    return np.divide(total, modulus, out=np.ones_like(total), where=modulus > 0)


# --- the angles -------------------------------------------------------------------------------


def _turning_angles_task(
    graph: FaceGraph, degree: int, required: np.ndarray
) -> Task[tuple[np.ndarray, SpanningForest]]:
    """Compute (I,) angles that have a sum around each interior node, and a spanning forest of the faces.

    `required`, (n,), are the sums; they do not count at other nodes.
    """
    face_count = len(graph.component)
    tree = yield from subtask(
        spanning_forest_task(face_count, graph.source, graph.target), 0.0, 0.1
    )
    loops = yield from subtask(_loops_task(graph, tree), 0.1, 0.2)
    limit = np.pi / degree
    for attempt in range(MAX_ATTEMPTS):
        start, stop = 1 - 0.8 * 0.2**attempt, 1 - 0.8 * 0.2 ** (attempt + 1)
        task = _least_angles_task(graph, degree, required, loops)
        angle = yield from subtask(task, start, stop)
        excess = np.abs(angle) / (ANGLE_MARGIN * limit)
        if excess.max(initial=0.0) * ANGLE_MARGIN < 1:
            break
        # Where the field turns too fast, it turns less with a smaller conductance.
        graph = replace(graph, conductance=graph.conductance / np.maximum(excess, 1) ** 2)
    return angle, tree


def _least_angles_task(
    graph: FaceGraph,
    degree: int,
    required: np.ndarray,
    loops: list[tuple[np.ndarray, np.ndarray]],
) -> Task[np.ndarray]:
    """(I,) angles of least squares, weighted by 1 / conductance; see `_turning_angles_task`."""
    yield Progress(0.0, LABEL)
    matrix = levels = None
    if graph.is_interior.any():
        matrix = yield from subtask(_laplacian_task(graph), 0.0, 0.1)
        levels = yield from subtask(hierarchy_task(matrix), 0.1, 0.5)

    def potential_task(sums: np.ndarray) -> Task[np.ndarray]:
        """(I,) angles of the potential whose angles have the sums around the nodes."""
        if matrix is None:
            return np.zeros(len(graph.source))
        solution = yield from conjugate_gradient_task(
            matrix, sums[graph.is_interior].astype(np.complex128), TOLERANCE, levels, LABEL
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
        sums = np.array(
            [(signs * (angle + graph.unfolding)[edges]).sum() for edges, signs in loops]
        )
        matrix_of_loops = np.array(
            [[(signs * harmonic[edges]).sum() for harmonic in harmonics] for edges, signs in loops]
        )
        coefficients = _nearest_lattice_coefficients(matrix_of_loops, -sums, turn)
        for coefficient, harmonic in zip(coefficients, harmonics, strict=True):
            angle += coefficient * harmonic
    return angle


def _laplacian_task(graph: FaceGraph) -> Task[CSRMatrix]:
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
    pairs as long as that reduces the energy.
    """
    inverse = np.linalg.pinv(matrix, hermitian=True)
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


# --- spanning forests -------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class SpanningForest:
    """A spanning tree of each component of a graph.

    Attributes
    ----------
    parent : (n,) intp ndarray
        The node above each node; the node itself at a root.
    parent_edge : (n,) intp ndarray
        The edge from there; -1 at a root.
    parent_sign : (n,) float64 ndarray
        1 if that edge leads from the parent to the node, -1 if from the node; 0 at a root.
    has_edge : (m,) bool ndarray
        Whether each edge of the graph is in the forest.
    """

    parent: np.ndarray
    parent_edge: np.ndarray
    parent_sign: np.ndarray
    has_edge: np.ndarray

    def sums_from_root(self, value: np.ndarray) -> np.ndarray:
        """Return (n,) float64: the sums of (m,) values along the edges from the root to each node."""
        total = self.parent_sign * value[self.parent_edge] if len(value) else self.parent_sign * 0
        pointer = self.parent
        while True:
            following = pointer[pointer]
            if np.array_equal(following, pointer):
                return total
            # Roots have the sum 0.
            total, pointer = total + total[pointer], following

    def path_to_root(self, node: int) -> np.ndarray:
        """Return the nodes from a node up to the one below its root."""
        path = []
        while self.parent_edge[node] >= 0:
            path.append(node)
            node = int(self.parent[node])
        return np.array(path, dtype=np.intp)


def spanning_forest_task(
    node_count: int, first: np.ndarray, second: np.ndarray
) -> Task[SpanningForest]:
    """Find spanning trees, breadth first.

    Parameters
    ----------
    node_count : int
    first, second : (m,) int ndarray
        The nodes that each edge connects.
    """
    ends, others = np.concatenate([first, second]), np.concatenate([second, first])
    order = np.argsort(ends, kind="stable")
    start = np.concatenate([[0], np.cumsum(np.bincount(ends, minlength=node_count))])
    neighbor, edge = others[order], order % max(len(first), 1)
    sign = np.where(order < len(first), 1.0, -1.0)
    component = connected_components(node_count, np.stack([first, second], axis=1))
    roots = np.unique(component, return_index=True)[1]
    parent, parent_edge = np.arange(node_count), np.full(node_count, -1)
    parent_sign = np.zeros(node_count)
    is_reached = np.zeros(node_count, dtype=bool)
    is_reached[roots] = True
    front, done = roots, 0
    while len(front):
        done += len(front)
        yield Progress(done / node_count, LABEL)
        counts = start[front + 1] - start[front]
        entry = np.arange(counts.sum()) + np.repeat(
            start[front] - np.concatenate([[0], np.cumsum(counts)[:-1]]), counts
        )
        entry = entry[~is_reached[neighbor[entry]]]
        source = edge[entry]
        front, kept = np.unique(neighbor[entry], return_index=True)
        entry, source = entry[kept], source[kept]
        is_reached[front] = True
        parent_edge[front], parent_sign[front] = source, sign[entry]
        parent[front] = np.where(sign[entry] > 0, first[source], second[source])
    has_edge = np.zeros(len(first), dtype=bool)
    has_edge[parent_edge[parent_edge >= 0]] = True
    return SpanningForest(parent, parent_edge, parent_sign, has_edge)
