"""A polygon mesh as flat arrays, and the parts of its topology that a field needs."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ..errors import RosyError
from .frames import dot, unit
from .triangulate import triangulate

#: Corner normals that differ by no more from that of their fan are the fan's.
SAME_NORMAL = 1e-6

#: Faces or corners that are worked on at once: bounds memory, and fits the caches.
BLOCK = 1 << 14


@dataclass(frozen=True, eq=False)
class Surface:
    """A polygon mesh: V vertices, F faces, C corners (face-vertex pairs), T triangles.

    The corners of face f are ``face_start[f] .. face_start[f + 1] - 1``, counter-clockwise about
    the outward normal, as in Blender. Make one with `build_surface`.

    Attributes
    ----------
    name : str
        For messages.
    vertices : (V, 3) float64 ndarray
        Object space, as seen (deformed).
    corner_vertex : (C,) int32 ndarray
    face_start : (F + 1,) int32 ndarray
    triangles : (T, 3) int32 ndarray
        Corner indices.
    triangle_face : (T,) int32 ndarray
    corner_normal : (C, 3) float64 ndarray
        Unit shading normals.
    corner_fan : (C,) int32 ndarray
        Corners with the same number share a vertex and a smooth normal: field values mix over
        them. Sharp edges and flat faces keep corners apart.
    rest : (V, 3) float64 ndarray or None
        Undeformed positions, in which a field's vectors were given; None if not deformed.
    """

    name: str
    vertices: np.ndarray
    corner_vertex: np.ndarray
    face_start: np.ndarray
    triangles: np.ndarray
    triangle_face: np.ndarray
    corner_normal: np.ndarray
    corner_fan: np.ndarray
    rest: np.ndarray | None = None

    @property
    def face_count(self) -> int:
        """F."""
        return len(self.face_start) - 1

    @cached_property
    def size(self) -> float:
        """The longest side of its box, Blender units."""
        return float(np.ptp(self.vertices, axis=0).max())

    @cached_property
    def bounds(self) -> np.ndarray:
        """(8, 3) float64: corners of the box around it; vertices of no face have no say."""
        used = np.zeros(len(self.vertices), dtype=bool)
        used[self.corner_vertex] = True
        points = self.vertices[used]
        ends = np.stack([points.min(axis=0), points.max(axis=0)])
        which = np.indices((2, 2, 2)).reshape(3, 8)
        return np.stack([ends[which[axis], axis] for axis in range(3)], axis=1)

    @cached_property
    def corner_face(self) -> np.ndarray:
        """(C,) int32: the face of each corner."""
        return corner_faces(self.face_start)

    @cached_property
    def next_corner(self) -> np.ndarray:
        """(C,) int32: the following corner around the same face."""
        return next_corners(self.face_start)

    @cached_property
    def triangle_vertex(self) -> np.ndarray:
        """(T, 3) int32: the vertices of the triangles."""
        return self.corner_vertex.take(self.triangles)

    @cached_property
    def fan_normal(self) -> np.ndarray:
        """(K, 3) float64: the mean direction of the corner normals of each fan, unit."""
        return unit(mix_over_fans(self.corner_normal, self.corner_fan))

    @cached_property
    def fans_share_normals(self) -> bool:
        """Whether no corner normal differs from that of its fan, as custom ones may."""
        for start in range(0, len(self.corner_fan), BLOCK):
            part = slice(start, start + BLOCK)
            apart = self.corner_normal[part] - self.fan_normal.take(self.corner_fan[part], axis=0)
            if np.abs(apart).max() > SAME_NORMAL:
                return False
        return True

    @cached_property
    def face_normal(self) -> np.ndarray:
        """(F, 3) float64 unit normals by Newell's formula; zero for a face without area."""
        return unit(face_area_vectors(self.vertices, self.corner_vertex, self.face_start))

    @cached_property
    def face_centre(self) -> np.ndarray:
        """(F, 3) float64: mean of each face's corners."""
        return mean_over_faces(self.vertices[self.corner_vertex], self.face_start)


def build_surface(
    vertices: np.ndarray,
    corner_vertex: np.ndarray,
    face_start: np.ndarray,
    *,
    name: str = "mesh",
    sharp_edges: np.ndarray | None = None,
    sharp_angle: float | None = None,
    flat_faces: np.ndarray | None = None,
    corner_normal: np.ndarray | None = None,
    corner_fan: np.ndarray | None = None,
    triangles: np.ndarray | None = None,
    triangle_face: np.ndarray | None = None,
    rest: np.ndarray | None = None,
) -> Surface:
    """Make a `Surface` of plain arrays, working out what is not given.

    Parameters
    ----------
    vertices : (V, 3) array_like
    corner_vertex : (C,) array_like of int
    face_start : (F + 1,) array_like of int
    name : str
    sharp_edges : (E, 2) array_like of int, optional
        Vertex pairs across which normals and field values do not mix.
    sharp_angle : float, optional
        Radians; edges whose faces meet at a larger angle are sharp too.
    flat_faces : (F,) array_like of bool, optional
        Faces that mix with none of their neighbours.
    corner_normal : (C, 3) array_like, optional
        Angle-weighted means over each smooth fan if not given.
    corner_fan : (C,) array_like of int, optional
        Of `smooth_fans`, if that is known.
    triangles, triangle_face : (T, 3) and (T,) array_like of int, optional
        Each face triangulated if not given.
    rest : (V, 3) array_like, optional

    Raises
    ------
    RosyError
        If there is no face, a face has fewer than three corners, an index is out of range, or a
        coordinate is not finite.
    """
    vertices = np.ascontiguousarray(vertices, dtype=np.float64).reshape(-1, 3)
    corner_vertex = np.ascontiguousarray(corner_vertex, dtype=np.int32).ravel()
    face_start = np.ascontiguousarray(face_start, dtype=np.int32).ravel()
    _check_polygons(name, vertices, corner_vertex, face_start)
    if triangles is None:
        triangles, triangle_face = triangulate(vertices, corner_vertex, face_start)
    if corner_fan is None:
        corner_fan = smooth_fans(
            vertices, corner_vertex, face_start, sharp_edges, sharp_angle, flat_faces
        )
    if corner_normal is None:
        corner_normal = _fan_normals(vertices, corner_vertex, face_start, corner_fan)
    return Surface(
        name=name,
        vertices=vertices,
        corner_vertex=corner_vertex,
        face_start=face_start,
        triangles=np.ascontiguousarray(triangles, dtype=np.int32).reshape(-1, 3),
        triangle_face=np.ascontiguousarray(triangle_face, dtype=np.int32).ravel(),
        corner_normal=np.ascontiguousarray(corner_normal, dtype=np.float64),
        corner_fan=corner_fan,
        rest=None if rest is None else np.ascontiguousarray(rest, dtype=np.float64),
    )


def smooth_fans(
    vertices: np.ndarray,
    corner_vertex: np.ndarray,
    face_start: np.ndarray,
    sharp_edges: np.ndarray | None = None,
    sharp_angle: float | None = None,
    flat_faces: np.ndarray | None = None,
) -> np.ndarray:
    """(C,) int32 `Surface.corner_fan`; see `build_surface`.

    Without a sharp angle the positions of the vertices make no difference.
    """
    pairs = _smooth_corner_pairs(
        vertices, corner_vertex, face_start, sharp_edges, sharp_angle, flat_faces
    )
    return connected(len(corner_vertex), pairs)


def corner_faces(face_start: np.ndarray) -> np.ndarray:
    """(C,) int32: the face of each corner."""
    return np.repeat(np.arange(len(face_start) - 1, dtype=np.int32), np.diff(face_start))


def next_corners(face_start: np.ndarray) -> np.ndarray:
    """(C,) int32: the following corner around the same face."""
    following = np.arange(1, face_start[-1] + 1, dtype=np.int32)
    following[face_start[1:] - 1] = face_start[:-1]
    return following


def sum_over_faces(values: np.ndarray, face_start: np.ndarray) -> np.ndarray:
    """(F, ...) sums of (C, ...) corner values."""
    return np.add.reduceat(values, face_start[:-1], axis=0)


def mean_over_faces(values: np.ndarray, face_start: np.ndarray) -> np.ndarray:
    """(F, ...) means of (C, ...) corner values."""
    count = np.diff(face_start).reshape((-1,) + (1,) * (values.ndim - 1))
    return sum_over_faces(values, face_start) / count


def face_area_vectors(
    vertices: np.ndarray, corner_vertex: np.ndarray, face_start: np.ndarray
) -> np.ndarray:
    """(F, 3) area vectors (normal times area) of polygons, by Newell's formula.

    Positions are taken relative to each face's first corner, so that a mesh far from the origin
    loses no digits.
    """
    area = np.empty((len(face_start) - 1, 3))
    for faces, corners, starts in face_blocks(face_start):
        points = _from_first(vertices, corner_vertex[corners], starts)
        twice = sum_over_faces(np.cross(points, points[next_corners(starts)]), starts)
        np.multiply(twice, 0.5, out=area[faces])
    return area


def _from_first(
    vertices: np.ndarray, corner_vertex: np.ndarray, face_start: np.ndarray
) -> np.ndarray:
    """(C, 3) corners of faces relative to the first of each."""
    points = vertices[corner_vertex]
    return points - np.repeat(points[face_start[:-1]], np.diff(face_start), axis=0)


def face_blocks(face_start: np.ndarray) -> Iterator[tuple[slice, slice, np.ndarray]]:
    """Some faces at once, which bounds memory: they, their corners, and starts among these."""
    count = len(face_start) - 1
    for first in range(0, count, BLOCK):
        faces = slice(first, min(first + BLOCK, count))
        starts = face_start[faces.start : faces.stop + 1]
        yield faces, slice(int(starts[0]), int(starts[-1])), starts - starts[0]


@dataclass(frozen=True, eq=False)
class Edges:
    """The E edges of a surface, and the two corners on each side of the interior ones.

    Attributes
    ----------
    corner_edge : (C,) int32 ndarray
        Edge from each corner to the next one of its face.
    ends : (E, 2) int32 ndarray
        Vertex pairs, the smaller first.
    uses : (E,) int32 ndarray
        How many faces meet there: 1 at a boundary, 2 inside, more where not manifold.
    inner : (I,) int32 ndarray
        The edges with exactly two faces on opposite sides.
    sides : (I, 2) int32 ndarray
        For each of them the corner of either face that the edge starts from. Oppositely oriented
        neighbours run along the edge in opposite directions; equally oriented ones do not count
        as `inner`, for there the surface does not continue.
    """

    corner_edge: np.ndarray
    ends: np.ndarray
    uses: np.ndarray
    inner: np.ndarray
    sides: np.ndarray


def surface_edges(corner_vertex: np.ndarray, face_start: np.ndarray) -> Edges:
    """Find the edges of a polygon mesh."""
    tail = corner_vertex.astype(np.int64)
    head = tail[next_corners(face_start)]
    span = int(corner_vertex.max(initial=0)) + 1
    key = np.minimum(tail, head) * span + np.maximum(tail, head)
    edge_key, corner_edge, uses = np.unique(key, return_inverse=True, return_counts=True)
    corner_edge = corner_edge.ravel().astype(np.int32)
    by_edge = np.argsort(corner_edge, kind="stable")
    first = np.concatenate([[0], np.cumsum(uses)[:-1]])
    inner = np.flatnonzero(uses == 2)
    a, b = by_edge[first[inner]], by_edge[first[inner] + 1]
    opposite = tail[a] == head[b]
    return Edges(
        corner_edge=corner_edge,
        ends=np.stack([edge_key // span, edge_key % span], axis=1).astype(np.int32),
        uses=uses.astype(np.int32),
        inner=inner[opposite].astype(np.int32),
        sides=np.stack([a, b], axis=1)[opposite].astype(np.int32),
    )


def cut_edges(surface: Surface) -> int:
    """How many edges join two faces (with an area) that do not agree on which side is out.

    There is no field across such an edge. Only flipping faces helps, and of a Möbius strip not even
    that: some edges are left, along which the field is cut.
    """
    edges = surface_edges(surface.corner_vertex, surface.face_start)
    flat = ~surface.face_normal.any(axis=1)
    beside_flat = np.zeros(len(edges.uses), dtype=bool)
    beside_flat[edges.corner_edge[flat[surface.corner_face]]] = True
    doubtful = (edges.uses == 2) & ~beside_flat
    doubtful[edges.inner] = False
    return int(np.count_nonzero(doubtful))


def cut_note(surface: Surface) -> str:
    """What a user should know of that; empty if there is nothing."""
    cut = cut_edges(surface)
    if not cut:
        return ""
    return (
        f"{surface.name}: along {cut} edges faces disagree on which side is out, and the field is "
        "cut there: recalculate the normals, unless it is a Möbius strip, which has but one side"
    )


def _check_polygons(
    name: str, vertices: np.ndarray, corner_vertex: np.ndarray, face_start: np.ndarray
) -> None:
    if len(face_start) < 2:
        raise RosyError(f"{name}: the mesh has no faces")
    corners = np.diff(face_start)
    if corners.min() < 3:
        face = int(np.argmin(corners))
        raise RosyError(f"{name}: face {face} has {corners[face]} corners, at least 3 are wanted")
    if corner_vertex.min() < 0 or corner_vertex.max() >= len(vertices):
        raise RosyError(f"{name}: a face refers to a vertex that does not exist")
    finite = np.isfinite(vertices).all(axis=1)
    if not finite.all():
        raise RosyError(
            f"{name}: vertex {int(np.argmin(finite))} has a coordinate that is not finite"
        )


def _smooth_corner_pairs(
    vertices: np.ndarray,
    corner_vertex: np.ndarray,
    face_start: np.ndarray,
    sharp_edges: np.ndarray | None,
    sharp_angle: float | None,
    flat_faces: np.ndarray | None,
) -> np.ndarray:
    """(K, 2) pairs of corners that face each other across a smooth edge, at either end of it."""
    edges = surface_edges(corner_vertex, face_start)
    face_of, following = corner_faces(face_start), next_corners(face_start)
    a, b = edges.sides[:, 0], edges.sides[:, 1]
    smooth = np.ones(len(a), dtype=bool)
    if flat_faces is not None:
        flat = np.asarray(flat_faces, dtype=bool)
        smooth &= ~(flat[face_of[a]] | flat[face_of[b]])
    if sharp_angle is not None:
        normal = unit(face_area_vectors(vertices, corner_vertex, face_start))
        smooth &= dot(normal[face_of[a]], normal[face_of[b]]) >= np.cos(sharp_angle)
    if sharp_edges is not None and len(sharp_edges):
        span = int(corner_vertex.max()) + 1
        sharp = np.sort(np.asarray(sharp_edges, dtype=np.int64).reshape(-1, 2), axis=1)
        ends = edges.ends[edges.inner].astype(np.int64)
        smooth &= ~np.isin(ends[:, 0] * span + ends[:, 1], sharp[:, 0] * span + sharp[:, 1])
    a, b = a[smooth], b[smooth]
    return np.concatenate(
        [np.stack([a, following[b]], axis=1), np.stack([following[a], b], axis=1)]
    )


def connected(count: int, pairs: np.ndarray) -> np.ndarray:
    """(count,) int32 number of the connected component of each node, from 0 without gaps.

    Every node points at the smallest node known to be connected with it; pairs hook the roots
    together and pointer jumping flattens the trees, a logarithmic number of rounds.
    """
    root = np.arange(count, dtype=np.int32)
    a, b = pairs[:, 0], pairs[:, 1]
    while len(a):
        low, high = np.minimum(root[a], root[b]), np.maximum(root[a], root[b])
        np.minimum.at(root, high, low)
        while True:
            flat = root[root]
            if np.array_equal(flat, root):
                break
            root = flat
        open_pairs = root[a] != root[b]
        a, b = a[open_pairs], b[open_pairs]
    return np.unique(root, return_inverse=True)[1].ravel().astype(np.int32)


def _fan_normals(
    vertices: np.ndarray, corner_vertex: np.ndarray, face_start: np.ndarray, corner_fan: np.ndarray
) -> np.ndarray:
    """(C, 3) face normals averaged over each fan, weighted by the angle at the corner."""
    angle = np.empty(len(corner_vertex))
    for _, corners, starts in face_blocks(face_start):
        points = _from_first(vertices, corner_vertex[corners], starts)
        following = next_corners(starts)
        ahead = unit(points[following] - points)
        behind = np.empty_like(ahead)
        behind[following] = -ahead
        angle[corners] = np.arccos(np.clip(dot(ahead, behind), -1, 1))
    face_normal = unit(face_area_vectors(vertices, corner_vertex, face_start))
    face = corner_faces(face_start)
    fans = int(corner_fan.max()) + 1
    total = [np.bincount(corner_fan, angle * column[face], fans) for column in face_normal.T]
    normal = unit(np.stack(total, axis=1))[corner_fan]
    lost = ~normal.any(axis=1)
    normal[lost] = face_normal[face[lost]]
    normal[~normal.any(axis=1)] = (0.0, 0.0, 1.0)
    return normal


def mix_over_fans(values: np.ndarray, corner_fan: np.ndarray) -> np.ndarray:
    """(fans, k) sums of (C, k) real corner values over the corners of each fan."""
    fans = int(corner_fan.max()) + 1
    columns = [np.bincount(corner_fan, weights=column, minlength=fans) for column in values.T]
    return np.stack(columns, axis=1)
