"""Fields with given singularities (Crane, Desbrun and Schröder, *Trivial Connections*, 2010).

The singularities of a field determine the angles by which it turns from face to face (`turning_angles`). The
angles of least squares give the field of least Dirichlet energy, up to terms of fourth order. To change the
singularities of a field, the angles of the change are added to its angles.

A field is rotated toward guides without changing its singularities: by an angle that is continuous over the
surface. If the field has the least squared turning angles, its Dirichlet energy grows by the Dirichlet energy of
this angle. So the angle solves a linear equation, once the multiple of 2 pi / N is known that takes the field to
each guide. The first multiples come from a linear equation for the representation, which may have other
singularities. They are improved until they are the nearest ones.
"""

from __future__ import annotations

from functools import partial

import numpy as np

from ..core.errors import RosyError
from ..core.memory import raise_mmap_threshold
from ..core.progress import progress, report
from .conjugate_gradient import conjugate_gradient
from .face_graph import LABEL, FaceGraph, face_graph
from .frames import normalize
from .polygon_arrays import face_area_vectors
from .representation import (
    complex_bincount,
    face_frames,
    from_representation,
    to_representation,
    unit_complex,
)
from .rosy_field import RosyField, check_degree
from .sparse_multigrid import CSRMatrix, Level, from_edges, hierarchy, w_cycle
from .surface import Surface
from .turning_angles import added_resistance, turning_angles

#: Residual norm at which the solver stops, relative to the norm of the right-hand side.
TOLERANCE = 1e-8

#: Number of times that the field is kept from turning too fast between two faces.
MAX_ATTEMPTS = 8

#: Number of times that the multiples of the guides are improved.
MAX_ROUNDS = 12

#: Penalty of the nodes without a guide, relative to the stiffness of their edges, so that all angles are
#: defined.
REGULARIZATION = 1e-9


class TurningError(RosyError):
    """A field would turn too fast between two faces.

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
        Member vectors, zero where there is no guide. On each connected component, the whole field is
        turned to them; without guides, to the edges of the mesh.
    reach : float
        If it is above 0, the field also bends to the guides. Their influence falls off over this distance, in
        object space.

    Returns
    -------
    RosyField
        A field of magnitude 1; zero on faces without area.

    Raises
    ------
    RosyError
        If a vertex has no index (at a border, or not in the mesh), if the indices do not have the sum
        that a closed surface needs, or if the field would turn too fast for the size of the faces.
    """
    degree = check_degree(degree)
    raise_mmap_threshold()
    x, y = face_frames(surface)
    graph = face_graph(surface, x, y)
    angle, direction = _turning(surface, graph, degree, vertex, index, graph.defect)
    z = np.exp(1j * degree * direction) * x.any(axis=1)
    points, face = surface.vertices[surface.corner_vertex], surface.corner_face
    edge_z = to_representation(points[surface.next_corner] - points, x[face], y[face], degree)
    z *= _rotation_to(complex_bincount(face, edge_z, surface.face_count), z, graph.component)
    if guides is not None:
        target = to_representation(normalize(np.asarray(guides, dtype=np.float64)), x, y, degree)
        z *= _rotation_to(target, z, graph.component)
        if reach > 0:
            with progress(0.9, 1.0):
                z = _bent(surface, graph, degree, angle, z, target, reach)
    return RosyField(degree, from_representation(z, x, y, degree))


def change_singularities(
    surface: Surface, field: RosyField, vertex: np.ndarray, change: np.ndarray, reach: float
) -> RosyField:
    """Change the singularities of a field near them.

    Parameters
    ----------
    surface : Surface
    field : RosyField
        A RoSy.
    vertex : (K,) int ndarray
    change : (K,) int ndarray
        Amount that is added to the index of each vertex, in units of 1 / N.
    reach : float
        Distance over which the change of direction falls off, in object space.

    Returns
    -------
    RosyField
        A field of the same magnitude.

    Raises
    ------
    RosyError
        If a vertex has no index (at a border, at faces without a direction,
        or not in the mesh), or if the changes do not add up to 0 on a closed surface.
    TurningError
        If the field would turn too fast for the size of the faces.
    """
    raise_mmap_threshold()
    degree, magnitude = field.degree, np.linalg.norm(field.vectors, axis=1, keepdims=True)
    x, y = face_frames(surface)
    z = to_representation(field.vectors, x, y, degree)
    is_defined = z != 0
    z[is_defined] /= np.abs(z[is_defined])
    graph = face_graph(surface, x, y, is_defined)
    transported = z[graph.source] * np.exp(1j * degree * graph.unfolding)
    present = np.angle(z[graph.target] * transported.conj()) / degree
    no_defect = np.zeros(graph.node_count)
    added, direction = _turning(surface, graph, degree, vertex, change, no_defect, present)
    turned = np.exp(1j * degree * direction) * is_defined
    turned *= _rotation_to(z, turned, graph.component)
    with progress(0.9, 1.0):
        turned = _bent(surface, graph, degree, present + added, turned, z, reach)
    return RosyField(degree, magnitude * from_representation(turned, x, y, degree))


def _turning(
    surface: Surface,
    graph: FaceGraph,
    degree: int,
    vertex: np.ndarray,
    index: np.ndarray,
    defect: np.ndarray,
    present: np.ndarray | float = 0.0,
) -> tuple[np.ndarray, np.ndarray]:
    """Return the angles and directions of a field with given indices; see `turning_angles`.

    `defect` is (n,) angle defects of the vertex nodes. `present` is the angles of a field that are changed.
    """
    node_index = index_at_nodes(surface, graph, vertex, index)
    _check_sums(surface, graph, defect * (degree / (2 * np.pi)), node_index, degree)
    required = 2 * np.pi / degree * node_index - defect
    with progress(0.2, 0.85):
        angle, direction = turning_angles(surface, graph, degree, required, present)
    _check_angles(surface, graph, degree, present + angle)
    report(0.85, LABEL)
    return angle, direction


def _bent(
    surface: Surface,
    graph: FaceGraph,
    degree: int,
    turning: np.ndarray,
    z: np.ndarray,
    target: np.ndarray,
    reach: float,
) -> np.ndarray:
    """Return (F,) the representation z, rotated toward a target without changing singularities."""
    area = face_area_vectors(surface.vertices, surface.corner_vertex, surface.face_start)
    penalty = np.linalg.norm(area, axis=1) / reach / reach
    angle = guided_rotation(graph, degree, turning, z, target, penalty)
    _check_angles(surface, graph, degree, turning + angle[graph.target] - angle[graph.source])
    return z * np.exp(1j * degree * angle)


def index_at_nodes(
    surface: Surface, graph: FaceGraph, vertex: np.ndarray, index: np.ndarray
) -> np.ndarray:
    """Return (n,) int64 indices of the vertex nodes. The index of a vertex is given to its first node."""
    vertex, vertex_count = np.asarray(vertex, dtype=np.int64), len(surface.vertices)
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


def _check_sums(
    surface: Surface, graph: FaceGraph, needed: np.ndarray, given: np.ndarray, degree: int
) -> None:
    """Check that the indices have the sum that each closed component needs.

    `needed` and `given` are values at the nodes.

    Raises
    ------
    RosyError
        If one has another sum.
    """
    component = graph.node_component
    count = int(component.max(initial=-1)) + 1
    is_closed = np.ones(count, dtype=bool)
    is_closed[component[~graph.is_interior]] = False
    needed = np.rint(np.bincount(component, needed, count)).astype(int)
    given = np.rint(np.bincount(component, given, count)).astype(int)
    wrong = np.flatnonzero(is_closed & (needed != given))
    if not len(wrong):
        return
    first = wrong[0]
    vertices = surface.corner_vertex[component[graph.corner_node] == first]
    part = "" if count == 1 else f"the part with vertex {vertices.min()}: "
    raise RosyError(
        f"{surface.name}: {part}the singularity indices add up to {given[first]}/{degree}, but this "
        f"closed surface needs {needed[first]}/{degree}: change them, or add the missing ones"
    )


def _check_angles(surface: Surface, graph: FaceGraph, degree: int, angle: np.ndarray) -> None:
    """Check that a field turns by less than half the angle between two members from face to face.

    Raises
    ------
    TurningError
        If it does not: then other members match, and the indices are not those that were asked for.
    """
    if not len(angle) or np.abs(angle).max() < np.pi / degree:
        return
    vertex_of_node = np.empty(graph.node_count, dtype=np.intp)
    vertex_of_node[graph.corner_node[::-1]] = surface.corner_vertex[::-1]
    is_fast = np.abs(angle) >= np.pi / degree
    vertices = np.unique(vertex_of_node[np.concatenate([graph.tail[is_fast], graph.head[is_fast]])])
    worst = vertex_of_node[graph.head[np.abs(angle).argmax()]]
    raise TurningError(
        vertices,
        f"{surface.name}: near vertex {worst}, a field of degree {degree} with these singularities would "
        "turn too fast for the size of the faces: subdivide the mesh, move singularities apart, or choose "
        "smaller indices",
    )


def _rotation_to(target: np.ndarray, z: np.ndarray, component: np.ndarray) -> np.ndarray:
    """Return (F,) factors that rotate z toward a target, the same factor on each connected component."""
    total = complex_bincount(component, target * z.conj(), int(component.max(initial=-1)) + 1)
    return unit_complex(total, otherwise=1)[component]


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
    return conjugate_gradient(
        matrix, rhs, TOLERANCE, precondition, "turning the field to the guides"
    )
