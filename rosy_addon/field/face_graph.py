"""The faces and the triangles of a surface as graphs, and spanning forests of graphs.

The angles by which a field turns across edges follow from a potential that is linear on triangles
(`turning_angles`). Across an edge, the angle is the difference of the potential along the edge, times half the
sum of the cotangents of the two opposite angles (Pinkall and Polthier, *Computing Discrete Minimal Surfaces and
Their Conjugates*, 1993). Cotangents are right for triangles of any shape. The distance between two face centers
divided by the length of the edge is the same factor only if the line between the centers is perpendicular to
the edge.

A face with more corners is a fan of triangles. Its direction is the mean direction of its triangles.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ..core.progress import report
from .analysis import edge_lengths
from .blocks import concatenated_ranges, mask, neighbors_of_nodes
from .connectivity import build_edges, connected_components, connected_corners
from .frames import dot
from .polygon_arrays import next_corners
from .representation import edge_unfolding
from .singularities import signed_corner_angles
from .surface import Surface

#: Smallest and largest conductance of an edge, relative to the median.
MAX_CONDUCTANCE_RATIO = 1e4

#: Least area of a triangle in its cotangents, relative to the square of its longest edge.
MIN_AREA = 1e-4

#: Label of the progress.
LABEL = "placing the singularities"


@dataclass(frozen=True, eq=False)
class FaceGraph:
    """The faces of a surface as nodes of a graph, with an edge where a field continues.

    A *vertex node* is a vertex with some of its corners: a set that is connected by such edges.

    Attributes
    ----------
    halfedges : (I, 2) int32 ndarray
        The corners where each edge starts, in the face on either side.
    source, target : (I,) int32 ndarray
        The two faces of each edge.
    unfolding : (I,) float64 ndarray
        Angle in radians to add to a direction in the frame of the source, to transport it to the frame of the
        target.
    tail, head : (I,) int32 ndarray
        The vertex nodes at the start and at the end of the edge, as the source runs along it.
    conductance : (I,) float64 ndarray
        Distance between the centers of both faces, divided by the length of the edge.
    corner_node : (C,) int32 ndarray
        Vertex node of each corner.
    is_interior : (n,) bool ndarray
        Whether edges surround the vertex node.
    defect : (n,) float64 ndarray
        2 pi minus the angles of its corners.
    component : (F,) int32 ndarray
        Connected component of each face.
    node_component : (n,) int32 ndarray
        Connected component of the faces at each vertex node.
    """

    halfedges: np.ndarray
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

    def drop(self, potential: np.ndarray) -> np.ndarray:
        """Return (I,) float64: by how much an (n,) potential grows along the edges."""
        return potential[self.head] - potential[self.tail]


def face_graph(
    surface: Surface, x: np.ndarray, y: np.ndarray, is_defined: np.ndarray | None = None
) -> FaceGraph:
    """Build the graph of the faces of a surface.

    Parameters
    ----------
    surface : Surface
    x, y : (F, 3) ndarray
        The frames of the faces.
    is_defined : (F,) bool ndarray, optional
        Where there is a field. By default on all faces with an area.
    """
    report(0.0, LABEL)
    edges = build_edges(surface.corner_vertex, surface.face_start)
    if is_defined is None:
        is_defined = x.any(axis=1)
    halfedges = edges.halfedges
    halfedges = halfedges[is_defined[surface.corner_face[halfedges]].all(axis=1)]
    a, b = halfedges.T
    following = next_corners(surface.face_start)
    source, target = surface.corner_face[a], surface.corner_face[b]
    unfolding = edge_unfolding(surface, x, y, a, b)
    length, distance = edge_lengths(surface, a, b)
    conductance = distance / np.maximum(length, 1e-300)
    median = max(float(np.median(conductance)), 1e-300) if len(a) else 1.0
    np.clip(
        conductance, median / MAX_CONDUCTANCE_RATIO, median * MAX_CONDUCTANCE_RATIO, out=conductance
    )
    corner_node = connected_corners(a, b, following)
    continues = mask(len(following), halfedges)
    is_interior = np.ones(int(corner_node.max(initial=-1)) + 1, dtype=bool)
    is_interior[corner_node[~continues]] = False
    is_interior[corner_node[following[~continues]]] = False
    corner_angle = signed_corner_angles(surface, x, y)
    component = connected_components(surface.face_count, np.stack([source, target], axis=1))
    node_component = np.zeros(len(is_interior), dtype=component.dtype)
    node_component[corner_node] = component[surface.corner_face]
    return FaceGraph(
        halfedges=halfedges,
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


def spanning_forest(node_count: int, first: np.ndarray, second: np.ndarray) -> SpanningForest:
    """Find spanning trees, breadth first.

    Parameters
    ----------
    node_count : int
    first, second : (m,) int ndarray
        The nodes that each edge connects.
    """
    start, neighbor, order = neighbors_of_nodes(node_count, first, second)
    edge = order % max(len(first), 1)
    sign = np.where(order < len(first), 1.0, -1.0)
    component = connected_components(node_count, np.stack([first, second], axis=1))
    roots = np.unique(component, return_index=True)[1]
    parent, parent_edge = np.arange(node_count), np.full(node_count, -1)
    parent_sign = np.zeros(node_count)
    is_reached = mask(node_count, roots)
    front, done = roots, 0
    while len(front):
        done += len(front)
        counts = start[front + 1] - start[front]
        entry = concatenated_ranges(start[front], counts)
        entry = entry[~is_reached[neighbor[entry]]]
        source = edge[entry]
        front, kept = np.unique(neighbor[entry], return_index=True)
        entry, source = entry[kept], source[kept]
        is_reached[front] = True
        parent_edge[front], parent_sign[front] = source, sign[entry]
        parent[front] = np.where(sign[entry] > 0, first[source], second[source])
    has_edge = mask(len(first), parent_edge[parent_edge >= 0])
    return SpanningForest(parent, parent_edge, parent_sign, has_edge)


@dataclass(frozen=True, eq=False)
class TriangleGraph:
    """The graph of the faces, where each face is a fan of triangles around its first corner.

    Attributes
    ----------
    graph : FaceGraph
        The graph of the T triangles. Its M edges are the I edges between faces, followed by the edges within
        faces. Its conductance is half the sum of the cotangents. It may be negative, but the matrix of the potential
        is positive semidefinite.
    weight : (M, 2) float64 ndarray
        Half the cotangent opposite each edge, in the source and in the target.
    triangle_face : (T,) intp ndarray
        Face of each triangle, ascending.
    area : (T,) float64 ndarray
    face_edge_count : int
        I.
    """

    graph: FaceGraph
    weight: np.ndarray
    triangle_face: np.ndarray
    area: np.ndarray
    face_edge_count: int

    def on_triangles(self, angle: np.ndarray | float) -> np.ndarray:
        """Return (M,) angles from (I,) angles at the edges between faces; they are 0 within faces."""
        result = np.zeros(len(self.graph.source))
        result[: self.face_edge_count] = angle
        return result

    def turns_to_centers(self, drop: np.ndarray) -> np.ndarray:
        """Return (T,) angles from the circumcenter of each triangle to its center.

        `drop` is (M,) differences of the potential along the edges. Angles between triangles lead from
        circumcenter to circumcenter, across the middles of edges. The mean of these is the center.
        """
        graph, count = self.graph, len(self.triangle_face)
        total = np.bincount(graph.source, self.weight[:, 0] * drop, count)
        return (total - np.bincount(graph.target, self.weight[:, 1] * drop, count)) / 3

    def on_faces(self, angle: np.ndarray, to_center: np.ndarray) -> np.ndarray:
        """Return (I,) angles between faces from (M,) angles between triangles.

        `to_center` is (T,) angles that are added to the directions of triangles; see `turns_to_centers`.
        """
        turn, outer = self._turns_in_faces(angle, to_center), slice(self.face_edge_count)
        return angle[outer] + turn[self.graph.source[outer]] - turn[self.graph.target[outer]]

    def directions_of_faces(
        self, direction: np.ndarray, angle: np.ndarray, to_center: np.ndarray
    ) -> np.ndarray:
        """Return (F,) directions from (T,) directions of triangles; the rest is as in `on_faces`."""
        first = np.flatnonzero(np.diff(self.triangle_face, prepend=-1))
        return (direction - self._turns_in_faces(angle, to_center))[first]

    def _turns_in_faces(self, angle: np.ndarray, to_center: np.ndarray) -> np.ndarray:
        """Return (T,) angles from the direction of each triangle's face to the direction of the triangle."""
        face, inner = self.triangle_face, slice(self.face_edge_count, None)
        step = np.zeros(len(face))
        step[self.graph.target[inner]] = angle[inner]
        turn = np.cumsum(step)
        mean = np.bincount(face, self.area * (turn + to_center)) / np.bincount(face, self.area)
        return turn - mean[face]

    def with_resistance(self, factor: np.ndarray) -> TriangleGraph:
        """Return a graph in which angles across edges between faces cost more, by (I,) factors of at least 1.

        Edges within faces get the largest factor of the edges around their face. Negative conductances are
        raised, because the matrix might become indefinite.
        """
        graph, face, outer = self.graph, self.triangle_face, slice(self.face_edge_count)
        face_factor = np.ones(len(np.bincount(face)))
        for triangle in (graph.source, graph.target):
            np.maximum.at(face_factor, face[triangle[outer]], factor)
        edge_factor = face_factor[face[graph.source]]
        edge_factor[outer] = factor
        least = np.median(np.abs(graph.conductance)) / MAX_CONDUCTANCE_RATIO
        conductance = np.maximum(graph.conductance, least) / edge_factor
        return replace(self, graph=replace(graph, conductance=conductance))


def triangle_graph(surface: Surface, faces: FaceGraph) -> TriangleGraph:
    """Split the graph of the faces of a surface into the graph of their triangles."""
    size = np.diff(surface.face_start)
    face = np.repeat(np.arange(len(size)), size - 2)
    first_triangle = np.cumsum(size - 2) - (size - 2)
    rank = np.arange(len(face)) - first_triangle[face]
    apex = surface.face_start[face]
    corner = np.stack([apex, apex + rank + 1, apex + rank + 2], axis=1)
    cotangent, area = _cotangents(surface.vertices[surface.corner_vertex[corner]])
    # The edges between faces: those at the apex belong to the first and to the last triangle.
    triangles, weights = [], []
    for start in faces.halfedges.T:
        owner = surface.corner_face[start]
        place = start - surface.face_start[owner]
        last = size[owner] - 1
        triangle = first_triangle[owner] + np.clip(place - 1, 0, last - 2)
        opposite = np.where(place == 0, 2, np.where(place == last, 1, 0))
        triangles.append(triangle)
        weights.append(cotangent[triangle, opposite] / 2)
    # The edges within faces, from each triangle to the next one.
    inner = np.flatnonzero(rank > 0)
    triangles = [np.concatenate(pair) for pair in zip(triangles, (inner - 1, inner), strict=True)]
    inner_weights = cotangent[inner - 1, 1] / 2, cotangent[inner, 2] / 2
    weights = [np.concatenate(pair) for pair in zip(weights, inner_weights, strict=True)]
    tail, head = faces.corner_node[corner[inner, 1]], faces.corner_node[apex[inner]]
    weight = np.stack(weights, axis=1)
    graph = replace(
        faces,
        source=triangles[0],
        target=triangles[1],
        unfolding=np.concatenate([faces.unfolding, np.zeros(len(inner))]),
        tail=np.concatenate([faces.tail, tail]),
        head=np.concatenate([faces.head, head]),
        conductance=weight.sum(axis=1),
        component=faces.component[face],
    )
    return TriangleGraph(graph, weight, face, area, len(faces.source))


def _cotangents(points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return (T, 3) cotangents of the angles, and (T,) areas, of triangles with (T, 3, 3) points.

    Areas are enlarged to `MIN_AREA`. That scales the cotangents of a triangle, so that their matrix stays
    positive semidefinite.
    """
    sides = np.roll(points, -1, axis=1) - points
    squared = dot(sides, sides)
    area = 0.5 * np.linalg.norm(np.cross(sides[:, 0], sides[:, 1]), axis=1)
    area = np.maximum(area, np.maximum(MIN_AREA * squared.max(axis=1), 1e-300))
    return -dot(np.roll(sides, 1, axis=1), sides) / (2 * area[:, None]), area
