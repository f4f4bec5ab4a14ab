"""Find how the faces of polygon meshes are connected: edges, smooth fans, and components of graphs."""

from dataclasses import dataclass

import numpy as np

from .blocks import run_starts
from .frames import dot, normalize
from .polygon_arrays import corner_faces, face_area_vectors, next_corners


@dataclass(frozen=True, eq=False)
class Edges:
    """The E edges of a surface, and the two halfedges of each of the I interior edges.

    Attributes
    ----------
    corner_edge : (C,) int32 ndarray
        The edge from each corner to the next corner of its face.
    ends : (E, 2) int32 ndarray
        The two vertices of each edge, the smaller index first.
    face_count : (E,) int32 ndarray
        Number of faces at the edge: 1 at a boundary, 2 inside, more at a nonmanifold edge.
    interior : (I,) int32 ndarray
        Indices of the interior edges: those with exactly two faces, which are oriented consistently. Fields
        do not continue across other edges.
    halfedges : (I, 2) int32 ndarray
        For both faces of each interior edge, the corner at which the edge starts in that face. The edge
        runs in opposite directions in the two faces.
    """

    corner_edge: np.ndarray
    ends: np.ndarray
    face_count: np.ndarray
    interior: np.ndarray
    halfedges: np.ndarray


def build_edges(corner_vertex: np.ndarray, face_start: np.ndarray) -> Edges:
    """Find the edges of a polygon mesh.

    `corner_vertex` holds the (C,) vertices of the corners, face by face, and `face_start` the (F + 1,) first
    corners of the faces, and C.
    """
    tail = corner_vertex.astype(np.int64)
    head = tail[next_corners(face_start)]
    stride = int(corner_vertex.max(initial=0)) + 1
    key = np.minimum(tail, head) * stride + np.maximum(tail, head)
    key, corner_by_edge = sorted_with_order(key, stride * stride)
    first = run_starts(key)
    edge_key, face_count = key[first], np.diff(first, append=len(key))
    corner_edge = np.empty(len(key), dtype=np.int32)
    corner_edge[corner_by_edge] = np.repeat(np.arange(len(first), dtype=np.int32), face_count)
    interior = np.flatnonzero(face_count == 2)
    a, b = corner_by_edge[first[interior]], corner_by_edge[first[interior] + 1]
    opposite = tail[a] == head[b]
    return Edges(
        corner_edge=corner_edge,
        ends=np.stack([edge_key // stride, edge_key % stride], axis=1).astype(np.int32),
        face_count=face_count.astype(np.int32),
        interior=interior[opposite].astype(np.int32),
        halfedges=np.stack([a, b], axis=1)[opposite].astype(np.int32),
    )


def smooth_fans(
    vertices: np.ndarray,
    corner_vertex: np.ndarray,
    face_start: np.ndarray,
    sharp_edges: np.ndarray | None = None,
    sharp_angle: float | None = None,
    flat_faces: np.ndarray | None = None,
) -> np.ndarray:
    """Return (C,) int32, the index of the smooth fan of each corner.

    The corners of a smooth fan share a vertex, and their faces are connected by edges that are not sharp.

    Parameters
    ----------
    vertices : (V, 3) float ndarray
        Positions. They are only used if `sharp_angle` is given.
    corner_vertex : (C,) int ndarray
        Vertex of each corner, face by face.
    face_start : (F + 1,) int ndarray
        First corner of each face, and C.
    sharp_edges : (n, 2) array_like of int, optional
        Pairs of vertices: edges that are sharp regardless of their angle.
    sharp_angle : float, optional
        Edges with a larger angle between the normals of their faces, in radians, are also sharp.
    flat_faces : (F,) array_like of bool, optional
        Faces with flat shading: all their edges are sharp.
    """
    edges = build_edges(corner_vertex, face_start)
    corner_face, next_corner = corner_faces(face_start), next_corners(face_start)
    a, b = edges.halfedges.T
    smooth = np.ones(len(a), dtype=bool)
    if flat_faces is not None:
        flat = np.asarray(flat_faces, dtype=bool)
        smooth &= ~(flat[corner_face[a]] | flat[corner_face[b]])
    if sharp_angle is not None:
        normal = normalize(face_area_vectors(vertices, corner_vertex, face_start))
        smooth &= dot(normal[corner_face[a]], normal[corner_face[b]]) >= np.cos(sharp_angle)
    if sharp_edges is not None and len(sharp_edges):
        smooth &= ~are_pairs(edges.ends[edges.interior], sharp_edges)
    return connected_corners(a[smooth], b[smooth], next_corner)


def are_pairs(ends: np.ndarray, pairs: np.ndarray) -> np.ndarray:
    """Return (n,) bool: which of n edges connect one of the given pairs of vertices.

    Parameters
    ----------
    ends : (n, 2) int ndarray
        The two vertices of each edge.
    pairs : (m, 2) int ndarray
        Pairs of vertices. The order of the two does not matter, neither here nor in `ends`.
    """
    ends, pairs = (np.sort(np.asarray(each, np.int64).reshape(-1, 2)) for each in (ends, pairs))
    strides = [max(ends.max(initial=0), pairs.max(initial=0)) + 1, 1]
    return np.isin(ends @ strides, pairs @ strides)


def connected_corners(a: np.ndarray, b: np.ndarray, next_corner: np.ndarray) -> np.ndarray:
    """Return (C,) int32, a label for each corner that is equal for corners connected across the given edges.

    The two faces of an edge have a corner each at both ends of the edge. These two corners are connected.

    Parameters
    ----------
    a, b : (n,) int ndarray
        For the two faces of each edge, the corner at which the edge starts in that face.
    next_corner : (C,) int ndarray
        The next corner of the same face.
    """
    ends = np.stack([a, next_corner[b]], axis=1), np.stack([next_corner[a], b], axis=1)
    return connected_components(len(next_corner), np.concatenate(ends))


def connected_components(count: int, pairs: np.ndarray) -> np.ndarray:
    """Label the connected components of a graph.

    Each node points to a root: the smallest node that is known to be in its component. Each round links the
    roots of connected nodes, and then flattens the trees by pointer jumping.

    Parameters
    ----------
    count : int
        Number of nodes.
    pairs : (n, 2) int ndarray
        Edges of the graph.

    Returns
    -------
    (count,) int32 ndarray
        Component of each node, numbered from 0 without gaps.
    """
    root = np.arange(count, dtype=np.int32)
    a, b = pairs[:, 0], pairs[:, 1]
    while len(a):
        low, high = np.minimum(root[a], root[b]), np.maximum(root[a], root[b])
        _lower(root, high, low)
        while True:
            flattened = root[root]
            if np.array_equal(flattened, root):
                break
            root = flattened
        unmerged = root[a] != root[b]
        a, b = a[unmerged], b[unmerged]
    return (np.cumsum(root == np.arange(count), dtype=np.int32) - 1)[root]


def _lower(values: np.ndarray, index: np.ndarray, limits: np.ndarray) -> None:
    """Lower values in place, like ``np.minimum.at(values, index, limits)``, but faster.

    No limit may be above the value at its index. Two plain assignments are enough for indices that occur once
    or twice, and most indices do. The others are left to ``np.minimum.at``.
    """
    for _ in range(2):
        values[index] = limits
        remaining = limits < values[index]
        index, limits = index[remaining], limits[remaining]
    np.minimum.at(values, index, limits)


def sums_from_roots(parent: np.ndarray, value: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Sum values along the path from the root of each node of a forest.

    Parameters
    ----------
    parent : (n,) int ndarray
        The parent of each node, for example the corner before a corner (see `connection.umbrella_order`). A root is its
        own parent.
    value : (n,) ndarray
        Amount that each node adds to the sum of its parent. The values of roots are ignored.

    Returns
    -------
    root : (n,) int ndarray
        The root of the tree that contains each node.
    total : (n,) ndarray
        The sum at each node; 0 at roots.
    """
    total = np.where(parent == np.arange(len(parent)), 0, value)
    while True:
        following = parent[parent]
        if np.array_equal(following, parent):
            return parent, total
        total, parent = total + total[parent], following


def sorted_with_order(key: np.ndarray, limit: int) -> tuple[np.ndarray, np.ndarray]:
    """Return sorted keys, and the indices that sort them: a stable `argsort`.

    Keys must be from 0 to `limit` - 1. If a key and its index fit into one 64-bit integer, these integers are
    sorted, which is faster than `argsort`.
    """
    index_bits = len(key).bit_length()
    if limit.bit_length() + index_bits > 63:
        order = np.argsort(key, kind="stable")
        return key[order], order
    packed = key << index_bits
    packed |= np.arange(len(key), dtype=np.int64)
    packed.sort()
    order = packed & ((1 << index_bits) - 1)
    packed >>= index_bits
    return packed, order
