"""The faces and the triangles of a surface as graphs, and spanning forests of graphs.

The angles by which a field turns across edges follow from a potential that is linear on triangles
(`turning_angles`). The angle across an edge is the difference of the potential along the edge, times a
factor, the *conductance* of the edge. The exact factor is half the sum of the cotangents of the two
opposite angles (Pinkall and Polthier, *Computing Discrete Minimal Surfaces and Their Conjugates*, 1993). A
simpler factor is the distance between the two face centers, divided by the length of the edge. It equals
the exact factor only if the line between the centers is perpendicular to the edge.

A face with more than three corners is divided into Delaunay triangles. Its direction is the mean direction of
its triangles.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ..core.progress import report
from .analysis import edge_lengths
from .blocks import concatenated_ranges, mask, neighbors_of_nodes
from .connectivity import connected_components, connected_corners, sums_from_roots
from .frames import dot
from .representation import edge_unfolding, matching_angles
from .singularities import signed_corner_angles
from .surface import Surface, with_delaunay_triangles

#: Smallest and largest conductance of an edge, relative to the median of all edges.
MAX_CONDUCTANCE_RATIO = 1e4

#: Cotangents are computed as if each triangle had at least this area, relative to the square of its longest
#: edge.
MIN_AREA = 1e-4

#: Text that is shown with the progress bar.
LABEL = "placing the singularities"


@dataclass(frozen=True, eq=False)
class FaceGraph:
    """The faces of a surface as a graph that connects the two faces of each interior edge.

    Edges across which a field cannot continue are left out: border edges, nonmanifold edges, edges between
    faces of opposite orientation, and edges of faces where the field is undefined. A *vertex node* is a
    vertex together with some of its corners: those that are connected by edges of this graph.

    Attributes
    ----------
    surface : Surface
    halfedges : (I, 2) int32 ndarray
        For the source and the target face of each edge, the corner at which the edge starts in that face.
    source, target : (I,) int32 ndarray
        The two faces of each edge.
    unfolding : (I,) float64 ndarray
        Angle in radians to add to a direction in the frame of the source face, to transport it to the frame
        of the target face.
    tail, head : (I,) int32 ndarray
        The vertex nodes at the start and at the end of the edge, in the direction in which the corners of the
        source face run.
    conductance : (I,) float64 ndarray
        Distance between the centers of both faces, divided by the length of the edge.
    corner_node : (C,) int32 ndarray
        Vertex node of each corner.
    is_interior : (n,) bool ndarray
        Whether faces of the graph surround the vertex node completely.
    defect : (n,) float64 ndarray
        Angle defect of each vertex node: 2 pi minus the sum of the angles of its corners.
    component : (F,) int32 ndarray
        Connected component of each face.
    node_component : (n,) int32 ndarray
        Connected component of the faces at each vertex node.
    """

    surface: Surface
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
        """n, the number of vertices, counted once for each fan of faces around them."""
        return len(self.is_interior)

    @property
    def node_vertex(self) -> np.ndarray:
        """(n,) int32: the vertex of the surface at which each vertex node lies."""
        vertex = np.empty(self.node_count, dtype=np.int32)
        vertex[self.corner_node] = self.surface.corner_vertex
        return vertex

    @property
    def can_be_singular(self) -> np.ndarray:
        """(n,) bool: whether the field may be singular at each node: all faces at its vertex form one closed fan.

        `singularities.find_singularities` finds indices at the same vertices.
        """
        vertex = self.node_vertex
        return self.is_interior & (np.bincount(vertex)[vertex] == 1)

    def turning(self, z: np.ndarray, degree: int) -> np.ndarray:
        """Return (I,) angles in radians by which a field turns from the source to the target face of each edge.

        `z` holds the (F,) representations of the field, of this degree.
        """
        return matching_angles(self.surface, z, degree, self.halfedges)

    def indices(self, turning: np.ndarray, degree: int) -> np.ndarray:
        """Return the (n,) int64 singularity indices at the nodes, in units of 1 / N; 0 at nodes that are not interior.

        `turning` holds the (I,) angles of `turning`, and `degree` is N.
        """
        turns = (self.turn_around_nodes(turning) + self.defect) / (2 * np.pi)
        return np.where(self.is_interior, np.rint(degree * turns), 0).astype(np.int64)

    def index_range(self, degree: int) -> tuple[np.ndarray, np.ndarray]:
        """Return the smallest and the largest possible index at each interior node, (n,) float64, in units of 1 / N.

        From one face to the next, the field turns by less than pi / N. So around a node with k faces, it turns by less
        than k pi / N. `degree` is N.
        """
        half = np.bincount(self.corner_node, minlength=self.node_count) / 2
        flat = self.defect * degree / (2 * np.pi)
        return np.floor(flat - half) + 1, np.ceil(flat + half) - 1

    def turn_around_nodes(self, angle: np.ndarray) -> np.ndarray:
        """Return (n,) float64 sums of angles at the edges, counter-clockwise around each vertex node.

        `angle` holds the (I,) angles from the source to the target face of each edge. They are subtracted
        where the way around the node crosses the edge from the target to the source.
        """
        count = self.node_count
        return np.bincount(self.head, angle, count) - np.bincount(self.tail, angle, count)

    def drop(self, potential: np.ndarray) -> np.ndarray:
        """Return (I,) float64 differences of an (n,) potential along the edges: head minus tail."""
        return potential[self.head] - potential[self.tail]


def face_graph(surface: Surface, is_defined: np.ndarray | None = None) -> FaceGraph:
    """Build the graph of the faces of a surface.

    Parameters
    ----------
    surface : Surface
    is_defined : (F,) bool ndarray, optional
        Faces on which the field is defined. By default all faces with an area.
    """
    report(0.0, LABEL)
    if is_defined is None:
        is_defined = surface.face_frames[0].any(axis=1)
    halfedges = surface.edges.halfedges
    halfedges = halfedges[is_defined[surface.corner_face[halfedges]].all(axis=1)]
    a, b = halfedges.T
    following = surface.next_corner
    source, target = surface.corner_face[a], surface.corner_face[b]
    unfolding = edge_unfolding(surface, a, b)
    length, distance = edge_lengths(surface, a, b)
    conductance = distance / np.maximum(length, 1e-300)
    median = max(float(np.median(conductance)), 1e-300) if len(a) else 1.0
    conductance = conductance.clip(median / MAX_CONDUCTANCE_RATIO, median * MAX_CONDUCTANCE_RATIO)
    corner_node = connected_corners(a, b, following)
    ends = np.flatnonzero(~mask(len(following), halfedges))
    count = int(corner_node.max(initial=-1)) + 1
    is_interior = ~mask(count, corner_node[np.concatenate([ends, following[ends]])])
    component = connected_components(surface.face_count, np.stack([source, target], axis=1))
    node_component = np.zeros(count, dtype=component.dtype)
    node_component[corner_node] = component[surface.corner_face]
    return FaceGraph(
        surface=surface,
        halfedges=halfedges,
        source=source,
        target=target,
        unfolding=np.angle(unfolding),
        tail=corner_node[a],
        head=corner_node[b],
        conductance=conductance,
        corner_node=corner_node,
        is_interior=is_interior,
        defect=2 * np.pi - np.bincount(corner_node, signed_corner_angles(surface), count),
        component=component,
        node_component=node_component,
    )


@dataclass(frozen=True, eq=False)
class SpanningForest:
    """Spanning trees of a graph of n nodes and m edges: one tree for each connected component.

    Attributes
    ----------
    parent : (n,) intp ndarray
        The parent of each node in its tree. The parent of a root is the root itself.
    parent_edge : (n,) intp ndarray
        The edge between each node and its parent; -1 for a root.
    parent_sign : (n,) float64 ndarray
        1 if that edge leads from the parent to the node, -1 if it leads from the node to the parent; 0 for a
        root.
    has_edge : (m,) bool ndarray
        Whether each edge of the graph is in the forest.
    """

    parent: np.ndarray
    parent_edge: np.ndarray
    parent_sign: np.ndarray
    has_edge: np.ndarray

    def sums_from_root(self, value: np.ndarray) -> np.ndarray:
        """Return (n,) float64 sums of (m,) edge values along the path from the root to each node.

        Values of edges that the path runs along in the opposite direction are subtracted.
        """
        step = self.parent_sign * value[self.parent_edge] if len(value) else self.parent_sign
        return sums_from_roots(self.parent, step)[1]

    def path_to_root(self, node: int) -> np.ndarray:
        """Return the nodes on the path from a node to its root, with the node and without the root."""
        path = []
        while self.parent_edge[node] >= 0:
            path.append(node)
            node = int(self.parent[node])
        return np.array(path, dtype=np.intp)


def spanning_forest(node_count: int, first: np.ndarray, second: np.ndarray) -> SpanningForest:
    """Find a spanning tree of each component of a graph by breadth-first search.

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
    front = roots
    while len(front):
        entry = concatenated_ranges(start[front], start[front + 1] - start[front])
        entry = entry[~is_reached[neighbor[entry]]]
        front, kept = np.unique(neighbor[entry], return_index=True)
        entry = entry[kept]
        source = edge[entry]
        is_reached[front] = True
        parent_edge[front], parent_sign[front] = source, sign[entry]
        parent[front] = np.where(sign[entry] > 0, first[source], second[source])
    has_edge = mask(len(first), parent_edge[parent_edge >= 0])
    return SpanningForest(parent, parent_edge, parent_sign, has_edge)


@dataclass(frozen=True, eq=False)
class TriangleGraph:
    """The graph of the triangles of a surface, where each face is a tree of Delaunay triangles.

    Attributes
    ----------
    graph : FaceGraph
        The graph with the T triangles as its faces. Its M edges are the I edges between faces, followed by
        the edges within faces, from each triangle to its children. The conductance of an edge is half the sum
        of the cotangents of the two opposite angles. It may be negative, but the matrix of the potential is
        positive semidefinite.
    weight : (M, 2) float64 ndarray
        Half the cotangent of the angle opposite each edge, in the source and in the target triangle.
    triangle_face : (T,) intp ndarray
        Face of each triangle, in ascending order.
    area : (T,) float64 ndarray
        Areas of the triangles.
    face_edge_count : int
        I.
    """

    graph: FaceGraph
    weight: np.ndarray
    triangle_face: np.ndarray
    area: np.ndarray
    face_edge_count: int

    def on_triangles(self, angle: np.ndarray | float) -> np.ndarray:
        """Return (M,) angles: the given (I,) angles at edges between faces, and 0 at edges within faces."""
        result = np.zeros(len(self.graph.source))
        result[: self.face_edge_count] = angle
        return result

    def turns_to_centers(self, drop: np.ndarray) -> np.ndarray:
        """Return (T,) angles by which the field turns from the circumcenter of each triangle to its centroid.

        `drop` holds the (M,) differences of the potential along the edges. An angle between two triangles is
        the turn from circumcenter to circumcenter, through the midpoint of their edge. The centroid is the
        mean of the three midpoints, so the turn to the centroid is the mean of the turns to the midpoints.
        """
        graph, count = self.graph, len(self.triangle_face)
        total = np.bincount(graph.source, self.weight[:, 0] * drop, count)
        return (total - np.bincount(graph.target, self.weight[:, 1] * drop, count)) / 3

    def on_faces(self, angle: np.ndarray, to_center: np.ndarray) -> np.ndarray:
        """Return (I,) turning angles between faces, computed from (M,) turning angles between triangles.

        The direction of a face is the mean of the directions at the centroids of its triangles, weighted by
        area. `to_center` holds the (T,) angles from the direction of a triangle to its direction at the
        centroid: the result of `turns_to_centers`, or 0 where they are ignored.
        """
        turn, outer = self._turns_in_faces(angle, to_center), slice(self.face_edge_count)
        return angle[outer] + turn[self.graph.source[outer]] - turn[self.graph.target[outer]]

    def directions_of_faces(
        self, direction: np.ndarray, angle: np.ndarray, to_center: np.ndarray
    ) -> np.ndarray:
        """Return the (F,) directions of faces, computed from the (T,) directions of their triangles.

        All directions are angles in radians. `angle` holds the (M,) turning angles between triangles, and
        `to_center` the (T,) angles from the direction of a triangle to its direction at the centroid.
        """
        first = np.flatnonzero(np.diff(self.triangle_face, prepend=-1))
        return (direction - self._turns_in_faces(angle, to_center))[first]

    def _turns_in_faces(self, angle: np.ndarray, to_center: np.ndarray) -> np.ndarray:
        """Return (T,) angles, in radians, from the direction of each face to the directions of its triangles.

        The parameters are as in `on_faces`: turning angles (M,), and turns to the centroids (T,).
        """
        face, inner = self.triangle_face, slice(self.face_edge_count, None)
        source, target = self.graph.source[inner], self.graph.target[inner]
        parent, step = np.arange(len(face)), np.zeros(len(face))
        parent[target], step[target] = source, angle[inner]
        turn = sums_from_roots(parent, step)[1]
        mean = np.bincount(face, self.area * (turn + to_center)) / np.bincount(face, self.area)
        return turn - mean[face]

    def with_resistance(self, factor: np.ndarray) -> TriangleGraph:
        """Return a graph whose edges have smaller conductances, so that large turning angles cost more.

        The energy of a field is the sum of its squared turning angles, each divided by the conductance of the
        edge. The conductances of the edges between faces are divided by `factor`, (I,) numbers of at least 1.
        Edges within a face get the largest factor of the edges around the face. Negative conductances are
        replaced by small positive ones, because they could make the matrix indefinite.
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


def triangle_graph(faces: FaceGraph) -> TriangleGraph:
    """Return the graph of the triangles of a surface, given the graph of its faces."""
    surface = with_delaunay_triangles(faces.surface)
    corner, face = surface.triangles, surface.triangle_face
    cotangent, area = _cotangents(surface.vertices[surface.triangle_vertex])
    tail, head = corner.ravel(), np.roll(corner, -1, axis=1).ravel()
    # The corners of a triangle are in the order of the face. So on one of its three sides, the tail has a larger number
    # than the head: the last side of the face, or the diagonal to the parent. The other triangle at a diagonal has it
    # in the opposite direction.
    is_outer = head == surface.next_corner[tail]
    outer, down = np.flatnonzero(is_outer), np.flatnonzero(~is_outer & (tail < head))
    up = np.flatnonzero(~is_outer & (tail > head))
    down, up = down[np.lexsort((head[down], tail[down]))], up[np.lexsort((tail[up], head[up]))]
    side = np.empty(len(surface.corner_vertex), dtype=np.intp)
    side[tail[outer]] = outer
    sides = np.concatenate([side[faces.halfedges], np.stack([down, up], axis=1)])
    source, target = sides.T // 3
    weight = cotangent[sides // 3, (sides + 2) % 3] / 2
    graph = replace(
        faces,
        source=source,
        target=target,
        unfolding=np.concatenate([faces.unfolding, np.zeros(len(down))]),
        tail=faces.corner_node[tail[sides[:, 0]]],
        head=faces.corner_node[head[sides[:, 0]]],
        conductance=weight.sum(axis=1),
        component=faces.component[face],
    )
    return TriangleGraph(graph, weight, face, area, len(faces.source))


def _cotangents(points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the (T, 3) cotangents of the angles of triangles, and their (T,) areas.

    `points` is (T, 3, 3). Areas smaller than `MIN_AREA` are enlarged. This scales all cotangents of a
    triangle by the same factor, so their matrix stays positive semidefinite.
    """
    sides = np.roll(points, -1, axis=1) - points
    squared = dot(sides, sides)
    area = 0.5 * np.linalg.norm(np.cross(sides[:, 0], sides[:, 1]), axis=1)
    area = np.maximum(area, np.maximum(MIN_AREA * squared.max(axis=1), 1e-300))
    return -dot(np.roll(sides, 1, axis=1), sides) / (2 * area[:, None]), area
