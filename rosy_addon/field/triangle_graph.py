"""The triangles of a surface as a graph, weighed by finite elements.

The potential of a field (`turning_angles`) is linear on triangles. The angle by which the field turns across an
edge is the difference of the potential along the edge, times half the sum of the cotangents of the angles
opposite it (Pinkall and Polthier, *Computing Discrete Minimal Surfaces and Their Conjugates*, 1993). This
holds on triangles of any shape. The distance of the centers of two faces over the length of their edge is the
same only where the line between the centers is perpendicular to the edge.

A larger face is a fan of triangles. Its direction is the mean of those of its triangles.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from .face_graph import MAX_CONDUCTANCE_RATIO, FaceGraph
from .frames import dot
from .surface import Surface

#: Least area of a triangle in its cotangents, relative to the square of its longest edge.
MIN_AREA = 1e-4


@dataclass(frozen=True, eq=False)
class TriangleGraph:
    """The graph of the faces, where each face is a fan of triangles around its first corner.

    Attributes
    ----------
    graph : FaceGraph
        Of the T triangles. Its M edges are the I edges between faces, and then those within faces. Its
        conductance is half the sum of the cotangents. It may be negative, but the matrix of the potential
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
        """Return (M,) angles: those at the edges between faces, and 0 within faces."""
        result = np.zeros(len(self.graph.source))
        result[: self.face_edge_count] = angle
        return result

    def turns_to_centers(self, drop: np.ndarray) -> np.ndarray:
        """Return (T,) angles from the circumcenter of each triangle to its center.

        `drop` is (M,) differences of the potential along the edges. The angles between triangles are those from
        circumcenter to circumcenter. They lead across the middles of the edges, whose mean is the center.
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
        """(T,) angles from the direction of a face to that of each of its triangles."""
        face, inner = self.triangle_face, slice(self.face_edge_count, None)
        step = np.zeros(len(face))
        step[self.graph.target[inner]] = angle[inner]
        turn = np.cumsum(step)
        mean = np.bincount(face, self.area * (turn + to_center)) / np.bincount(face, self.area)
        return turn - mean[face]

    def with_resistance(self, factor: np.ndarray) -> TriangleGraph:
        """Return a graph whose edges between faces resist angles more, by (I,) factors of at least 1.

        Those within faces resist them as much as the edges around. No conductance is negative any more, as the
        matrix might be indefinite.
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
    """Split the graph of the faces of a surface into that of their triangles."""
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
    """(T, 3) cotangents of the angles, and (T,) areas, of triangles with (T, 3, 3) points.

    Areas are enlarged to `MIN_AREA`. That scales the cotangents of a triangle, so that their matrix stays
    positive semidefinite.
    """
    sides = np.roll(points, -1, axis=1) - points
    squared = dot(sides, sides)
    area = 0.5 * np.linalg.norm(np.cross(sides[:, 0], sides[:, 1]), axis=1)
    area = np.maximum(area, np.maximum(MIN_AREA * squared.max(axis=1), 1e-300))
    return -dot(np.roll(sides, 1, axis=1), sides) / (2 * area[:, None]), area
