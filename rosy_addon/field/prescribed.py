"""Fields with given singularities (Crane, Desbrun and Schröder, *Trivial Connections*, 2010).

The singularities of a field determine the angles by which it turns from face to face (`turning_angles`). The
least-squares angles give the field of least Dirichlet energy, up to terms of fourth order. To change the
singularities of a field, the angles of the change are added to its angles.

To bend a field toward guides without changing its singularities, it is rotated by an angle that is continuous
over the surface. If the turning angles of the field have the least sum of squares, the rotation increases its
Dirichlet energy by the Dirichlet energy of this angle. Rotating the field to a guide is possible by several
angles, which differ by multiples of 2 pi / N. Once a multiple is chosen for each guide, the angle solves a
linear equation. The first choice comes from a linear equation for the representation, which may have other
singularities. The choice is then improved until each guide has the multiple nearest to the angle.
"""

from functools import partial

import numpy as np

from ..core.errors import RosyError
from ..core.memory import raise_mmap_threshold
from ..core.progress import progress, report
from .blocks import mask
from .conjugate_gradient import conjugate_gradient
from .face_graph import LABEL, FaceGraph, face_graph
from .frames import normalize
from .free_rotation import freely_rotated
from .representation import complex_bincount, from_representation, to_representation, unit_complex
from .rosy_field import RosyField, check_degree
from .sparse_matrix import from_edges
from .sparse_multigrid import Level, hierarchy, w_cycle
from .surface import Surface
from .turning_angles import added_resistance, turning_angles

#: Residual norm at which the solver stops, relative to the norm of the right-hand side.
TOLERANCE = 1e-8

#: Number of attempts to reduce turning angles that reach pi / N between two faces.
MAX_ATTEMPTS = 8

#: Number of attempts to improve the multiples of 2 pi / N of the guides.
MAX_ROUNDS = 12

#: Added to the diagonal of the matrix, relative to it, so that the matrix is regular on components without a
#: guide.
REGULARIZATION = 1e-9


class TurningError(RosyError):
    """Error: a field would turn by pi / N or more between two faces, so its singularities would change.

    Attributes
    ----------
    vertices : (n,) intp ndarray
        Vertices of the edges between such faces.
    """

    def __init__(self, vertices: np.ndarray, message: str) -> None:
        super().__init__(message)
        self.vertices = vertices


def prescribed_field(
    surface: Surface,
    degree: int,
    vertex: np.ndarray,
    index: np.ndarray,
    guides: np.ndarray | None = None,
    reach: float = 0.0,
) -> RosyField:
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
        Member vectors that the field should follow; zero on faces without a guide. On each connected
        component, the whole field is rotated by one angle to align it with the guides. Without guides, it is
        aligned with the edges of the mesh, or as `free_rotation` does if the degree is odd.
    reach : float
        If it is above 0, the field also bends toward the guides locally. The influence of a guide falls off
        over this distance, in object space.

    Returns
    -------
    RosyField
        A field of magnitude 1; zero on faces without area.

    Raises
    ------
    RosyError
        If a vertex cannot be singular (at a border, or not in the mesh) or is given twice, if there are too
        few faces around it for its index, if the indices do not have the sum that a closed surface needs, or
        if the field would turn by pi / N or more between two faces.
    """
    degree = check_degree(degree)
    raise_mmap_threshold()
    x, y = surface.face_frames
    graph = face_graph(surface)
    check_index_ranges(graph, degree, vertex, index)
    node_index = index_at_nodes(graph, vertex, index)
    angle, direction = _turning(graph, degree, node_index)
    z = np.exp(1j * degree * direction) * x.any(axis=1)
    if degree % 2:  # edges have no sign, and around a face of degree 1 they add up to 0
        z = freely_rotated(surface, z, degree)
    else:
        points, face = surface.vertices[surface.corner_vertex], surface.corner_face
        edge_z = to_representation(points[surface.next_corner] - points, x[face], y[face], degree)
        z *= _rotation_to(complex_bincount(face, edge_z, surface.face_count), z, graph.component)
    if guides is not None:
        target = to_representation(normalize(np.asarray(guides, dtype=np.float64)), x, y, degree)
        z *= _rotation_to(target, z, graph.component)
        if reach > 0:
            with progress(0.9, 1.0):
                z = _bent(graph, degree, angle, z, target, reach)
    _check_result(graph, degree, z, node_index)
    return RosyField(degree, from_representation(z, x, y, degree))


def change_singularities(
    surface: Surface, field: RosyField, vertex: np.ndarray, change: np.ndarray, reach: float
) -> RosyField:
    """Change the singularity indices of vertices. Directions change mainly near these vertices.

    Parameters
    ----------
    surface : Surface
    field : RosyField
        A field whose directions are rotationally symmetric.
    vertex : (K,) int ndarray
        Vertices whose indices change.
    change : (K,) int ndarray
        Amount that is added to the index of each vertex, in units of 1 / N.
    reach : float
        Distance over which the change of direction falls off, in object space.

    Returns
    -------
    RosyField
        The new field, with the same magnitudes.

    Raises
    ------
    RosyError
        If a vertex cannot be singular (at a border, next to a face without a direction, or not in the
        mesh), or if the changes do not add up to 0 on a closed surface.
    TurningError
        If the field would turn by pi / N or more between two faces.
    """
    raise_mmap_threshold()
    degree, magnitude = field.degree, np.linalg.norm(field.vectors, axis=1, keepdims=True)
    x, y = surface.face_frames
    z = unit_complex(to_representation(field.vectors, x, y, degree))
    is_defined = z != 0
    graph = face_graph(surface, is_defined)
    present = graph.turning(z, degree)
    node_change = index_at_nodes(graph, vertex, change)
    added, direction = _turning(graph, degree, node_change, present)
    turned = np.exp(1j * degree * direction) * is_defined
    turned *= _rotation_to(z, turned, graph.component)
    with progress(0.9, 1.0):
        turned = _bent(graph, degree, present + added, turned, z, reach)
    _check_result(graph, degree, turned, graph.indices(present, degree) + node_change)
    return RosyField(degree, magnitude * from_representation(turned, x, y, degree))


def _turning(
    graph: FaceGraph, degree: int, node_index: np.ndarray, present: np.ndarray | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """Return (I,) turning angles and (F,) directions, in radians, of a field with given singularity indices.

    For a new field, `node_index` holds the (n,) singularity indices of the vertex nodes. If an existing field
    is changed, it holds the changes of its indices, and `present` holds the (I,) turning angles of the field.
    The first result is then the change of these angles. Directions are angles in the frames of the faces.
    """
    defect, present = (graph.defect, 0.0) if present is None else (0 * graph.defect, present)
    _check_sums(graph, defect * (degree / (2 * np.pi)), node_index, degree)
    required = 2 * np.pi / degree * node_index - defect
    with progress(0.2, 0.85):
        angle, direction = turning_angles(graph, degree, required, present)
    report(0.85, LABEL)
    return angle, direction


def _bent(
    graph: FaceGraph,
    degree: int,
    turning: np.ndarray,
    z: np.ndarray,
    target: np.ndarray,
    reach: float,
) -> np.ndarray:
    """Rotate the field on each face to follow guides, without a change of its singularities.

    Parameters
    ----------
    graph : FaceGraph
    degree : int
        N.
    turning : (I,) ndarray
        Angles in radians by which the field turns from the source to the target face of each edge.
    z : (F,) complex ndarray
        Representation of the field, of modulus 1 or 0.
    target : (F,) complex ndarray
        Representation of the guides; 0 on faces without a guide.
    reach : float
        Distance over which the influence of the guides falls off, in object space.

    Returns
    -------
    (F,) complex ndarray
        Representation of the rotated field. It turns by less than pi / N across each edge, unless the guides
        require more.
    """
    # The squared difference from a guide has this weight, and the squared change of the angle across an edge of
    # conductance 1 has the weight 1.
    penalty = graph.surface.face_area / reach / reach
    offset = target * z.conj()
    is_guide = (offset != 0) & (penalty > 0)
    if not is_guide.any():
        return z
    penalty = np.where(is_guide, penalty, 0.0)
    stiffness = 1 / graph.conductance
    wanted = np.angle(offset) / degree
    sector, limit = 2 * np.pi / degree, np.pi / degree
    angle = None
    for attempt in range(MAX_ATTEMPTS):
        rest = 0.5**attempt
        with progress(1 - rest, 1 - 0.9 * rest):
            levels = _levels(graph, stiffness, penalty)
        if angle is None:
            pull = penalty * unit_complex(offset)
            with progress(1 - 0.9 * rest, 1 - 0.7 * rest):
                angle = _initial_angle(graph, stiffness, levels, pull) / degree
        for index in range(MAX_ROUNDS):
            multiple = np.rint((angle - wanted) / sector)
            rhs = penalty * (wanted + sector * multiple)
            shares = (0.5 + 0.2 * 0.5**step for step in (index, index + 1))
            with progress(*(1 - share * rest for share in shares)):
                angle = _solve(levels, rhs)
            if np.array_equal(multiple[is_guide], np.rint((angle - wanted) / sector)[is_guide]):
                break
        added = angle[graph.target] - angle[graph.source]
        if np.abs(turning + added).max(initial=0.0) < limit:
            break
        stiffness = stiffness * added_resistance(added, turning, limit)
    return z * np.exp(1j * degree * angle)


def index_at_nodes(graph: FaceGraph, vertex: np.ndarray, index: np.ndarray) -> np.ndarray:
    """Return (n,) int64: the singularity index of each vertex node, from the indices of some vertices."""
    result = np.zeros(graph.node_count, dtype=np.int64)
    result[nodes_of_vertices(graph, vertex)] = index
    return result


def nodes_of_vertices(graph: FaceGraph, vertex: np.ndarray) -> np.ndarray:
    """Return the (K,) vertex nodes of K vertices that can be singular.

    Raises
    ------
    RosyError
        If a vertex is not in the mesh, cannot be singular, or is given twice.
    """
    surface, vertex_count = graph.surface, len(graph.surface.vertices)
    vertex = np.asarray(vertex, dtype=np.int64)
    out_of_range = (vertex < 0) | (vertex >= vertex_count)
    if out_of_range.any():
        raise RosyError(
            f"{surface.name}: has no vertex {vertex[out_of_range][0]}: its vertices are numbered 0 to "
            f"{vertex_count - 1}"
        )
    node_of_vertex = np.full(vertex_count, -1)
    regular = np.flatnonzero(graph.can_be_singular)
    node_of_vertex[graph.node_vertex[regular]] = regular
    node = node_of_vertex[vertex]
    if (node < 0).any():
        raise RosyError(
            f"{surface.name}: vertex {vertex[node < 0][0]} cannot be singular, because it is at a border or at "
            "faces without area, has no face, or joins parts that share nothing else: choose another vertex"
        )
    given_twice = np.bincount(vertex) > 1
    if given_twice.any():
        raise RosyError(
            f"{surface.name}: vertex {given_twice.argmax()} is given more than once: give its index once"
        )
    return node


def check_index_ranges(
    graph: FaceGraph, degree: int, vertex: np.ndarray, index: np.ndarray
) -> None:
    """Check that there are enough faces around each of K vertices for its index, in units of 1 / N.

    Raises
    ------
    RosyError
        If an index is outside of `FaceGraph.index_range`, or if a vertex cannot be singular.
    """
    node, index = nodes_of_vertices(graph, vertex), np.asarray(index)
    low, high = (limit[node] for limit in graph.index_range(degree))
    wrong = np.flatnonzero((index < low) | (index > high))
    if len(wrong):
        first = wrong[0]
        raise RosyError(
            f"{graph.surface.name}: vertex {vertex[first]} cannot have the index {index[first]}/{degree}: the "
            f"faces around it allow {low[first]:.0f}/{degree} to {high[first]:.0f}/{degree}: spread the index "
            "over several vertices, or choose one with more faces"
        )


def _check_sums(graph: FaceGraph, needed: np.ndarray, given: np.ndarray, degree: int) -> None:
    """Check that the singularity indices on each closed component have the sum that it needs.

    `needed` and `given` hold (n,) indices at the vertex nodes, in units of 1 / N. Their sums over a closed
    component must be equal.

    Raises
    ------
    RosyError
        If the indices on a component have another sum.
    """
    component = graph.node_component
    count = int(component.max(initial=-1)) + 1
    is_closed = ~mask(count, component[~graph.is_interior])
    needed = np.rint(np.bincount(component, needed, count)).astype(int)
    given = np.rint(np.bincount(component, given, count)).astype(int)
    wrong = np.flatnonzero(is_closed & (needed != given))
    if not len(wrong):
        return
    first = wrong[0]
    vertices = graph.node_vertex[component == first]
    part = "" if count == 1 else f"the part with vertex {vertices.min()}: "
    raise RosyError(
        f"{graph.surface.name}: {part}the singularity indices add up to {given[first]}/{degree}, but this "
        f"closed surface needs {needed[first]}/{degree}: change them, or add the missing ones"
    )


def _check_result(graph: FaceGraph, degree: int, z: np.ndarray, node_index: np.ndarray) -> None:
    """Check that a field with the (F,) representations z has the requested (n,) indices at the vertex nodes.

    Raises
    ------
    TurningError
        If the index is another one at an interior node. A field with the requested index would turn by pi / N or
        more between two faces near it, so that other members of these faces are nearest to each other.
    """
    found = graph.indices(graph.turning(z, degree), degree)
    is_wrong = graph.is_interior & (found != node_index)
    if is_wrong.any():
        vertices = np.unique(graph.node_vertex[is_wrong])
        raise TurningError(
            vertices,
            f"{graph.surface.name}: near vertex {vertices[0]}, a field of degree {degree} with these singularities "
            "would turn too fast for the size of the faces: subdivide the mesh, move singularities apart, or "
            "choose smaller indices",
        )


def _rotation_to(target: np.ndarray, z: np.ndarray, component: np.ndarray) -> np.ndarray:
    """Return (F,) factors of modulus 1 that rotate representations to a target, equal on each component.

    `target` and `z` hold (F,) representations, and `component` the (F,) connected component of each face. The
    rotation of a component is the one with the least squared error.
    """
    total = complex_bincount(component, target * z.conj(), int(component.max(initial=-1)) + 1)
    return unit_complex(total, otherwise=1)[component]


def _levels(graph: FaceGraph, stiffness: np.ndarray, penalty: np.ndarray) -> list[Level]:
    """Return multigrid levels of the Laplacian of the graph of faces, with the penalty added to its diagonal.

    `stiffness` holds the (I,) weights of the edges, and `penalty` the (F,) weights of the guides.
    """
    ends = np.concatenate([graph.source, graph.target])
    diagonal = np.bincount(ends, np.tile(stiffness, 2), len(penalty))
    diagonal = diagonal + penalty + REGULARIZATION * np.where(diagonal > 0, diagonal, 1.0)
    return hierarchy(from_edges(graph.source, graph.target, -stiffness, diagonal))


def _initial_angle(
    graph: FaceGraph, stiffness: np.ndarray, levels: list[Level], pull: np.ndarray
) -> np.ndarray:
    """Return a first estimate of N times the (F,) angles by which `_bent` rotates a field.

    The phase by which z must be rotated to reach the guide is known on faces with a guide, up to multiples of
    2 pi. First, unit complex numbers with these phases are smoothed over all faces. Then the phases of the
    result are unwrapped: the estimate has the differences between neighboring faces that fit them best, in
    the sense of least squares.

    Parameters
    ----------
    graph : FaceGraph
    stiffness : (I,) float64 ndarray
        Weights of the edges.
    levels : list of Level
        Result of `_levels`, with the penalty.
    pull : (F,) complex128 ndarray
        Numbers whose phase takes z to the guide, and whose modulus is the weight of the guide; 0 on faces
        without a guide.
    """
    with progress(0.0, 0.3):
        mean = _solve(levels, pull)
    difference = np.angle(mean[graph.target] * mean[graph.source].conj())
    count = len(pull)
    divergence = np.bincount(graph.target, stiffness * difference, count)
    divergence -= np.bincount(graph.source, stiffness * difference, count)
    with progress(0.3, 0.6):
        free_levels = _levels(graph, stiffness, np.zeros(count))
    with progress(0.6, 1.0):
        angle = _solve(free_levels, divergence)
    rest = pull * np.exp(-1j * angle)
    parts = int(graph.component.max(initial=-1)) + 1
    return angle + np.angle(complex_bincount(graph.component, rest, parts))[graph.component]


def _solve(levels: list[Level], rhs: np.ndarray) -> np.ndarray:
    """Solve the system of the first level by the conjugate gradient method, preconditioned by a W-cycle."""
    cycle, label = partial(w_cycle, levels), "turning the field to the guides"
    return conjugate_gradient(levels[0].matrix, rhs, TOLERANCE, cycle, label)
