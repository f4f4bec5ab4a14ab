"""Refine triangles by bisection, and find the refined triangle that contains a point.

An edge that is too long is bisected in both of its triangles, so that the refined mesh has no gaps or
T-junctions. Each bisected triangle becomes the parent of its two halves in a binary tree. The tree is used to
find the refined triangle that contains a point with given barycentric coordinates.
"""

from dataclasses import dataclass

import numpy as np

from .frames import dot

#: Factor by which the maximum edge length is raised until the number of triangles is small enough.
LENGTH_STEP = 1.15


@dataclass(frozen=True, eq=False)
class BisectionTree:
    """A forest of binary trees, whose nodes are triangles.

    The T roots are the given triangles. The children of a bisected triangle are its two halves. The leaves
    are the triangles that are not bisected. n is the number of nodes (all triangles), and L the number of
    leaves.

    Attributes
    ----------
    first_child : (n,) int32 ndarray
        Node of the first half of each triangle; the second half is the node after it. -1 for a leaf.
    split_edge : (n,) int8 ndarray
        Corner (0, 1 or 2) at which the bisected edge of the triangle starts. The edge ends at the next
        corner.
    leaf : (n,) int32 ndarray
        For a node that is a leaf, its index among the leaves; -1 for other nodes.
    leaf_root : (L,) int32 ndarray
        The root triangle that contains each leaf.
    leaf_vertex : (L, 3) int32 ndarray
        Vertices of the leaves. Midpoints of edges are numbered after the given vertices.
    leaf_weights : (L, 3, 3) float32 ndarray
        Barycentric coordinates of the corners of each leaf in its root, without rounding errors. Row k of the
        3 x 3 matrix of a leaf is for its corner k.
    vertices : (V, 3) float64 ndarray
        Positions of all vertices.
    """

    first_child: np.ndarray
    split_edge: np.ndarray
    leaf: np.ndarray
    leaf_root: np.ndarray
    leaf_vertex: np.ndarray
    leaf_weights: np.ndarray
    vertices: np.ndarray

    def locate(self, root: np.ndarray, weights: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Find the leaf that contains each of P points, and the barycentric coordinates of the point in it.

        Parameters
        ----------
        root : (P,) int ndarray
            Root triangle of each point.
        weights : (P, 3) float32 ndarray
            Barycentric coordinates of the point in the root. A point outside of the root belongs to a leaf
            near it.

        Returns
        -------
        leaf : (P,) int32 ndarray
            Index of the leaf.
        weights : (3, P) float32 ndarray
            Barycentric coordinates of the point in the leaf.
        """
        node = root.astype(np.int32)
        result = np.ascontiguousarray(weights.T)
        if len(self.leaf) == len(self.leaf_root):  # nothing is bisected
            return node, result
        active = np.flatnonzero(self.first_child.take(node) >= 0)
        while len(active):
            parent = node.take(active)
            edge = self.split_edge.take(parent).astype(np.intp)
            columns = result.take(active, axis=1)
            points = np.arange(len(active))
            a, b, c = (columns[(edge + k) % 3, points] for k in range(3))
            second = b > a
            result[0, active] = np.where(second, 2 * a, a - b)
            result[1, active] = np.where(second, b - a, 2 * b)
            result[2, active] = c
            child = self.first_child.take(parent) + second
            node[active] = child
            active = active[self.first_child.take(child) >= 0]
        return self.leaf.take(node), result


def bisect(
    vertices: np.ndarray, triangle_vertex: np.ndarray, max_length: float, max_triangles: int
) -> BisectionTree:
    """Bisect triangles until no edge is longer than `max_length`.

    An edge is bisected in both of its triangles, so neighbors still share their edges.

    Parameters
    ----------
    vertices : (V, 3) float64 ndarray
        Positions of the vertices.
    triangle_vertex : (T, 3) int ndarray
        Vertices of each triangle.
    max_length : float
        Edges longer than this are bisected, in the units of the vertices.
    max_triangles : int
        Largest number of triangles. If there would be more, `max_length` is raised.

    Returns
    -------
    BisectionTree
    """
    leaves = _Leaves(vertices, triangle_vertex)
    while True:
        lengths = _edge_lengths(leaves.vertices, leaves.vertex)
        is_long = lengths > max_length
        # Bisecting an edge adds one triangle on each of its sides.
        while is_long.any() and len(lengths) + np.count_nonzero(is_long) > max_triangles:
            max_length *= LENGTH_STEP
            is_long = lengths > max_length
        if not is_long.any():
            return leaves.tree()
        midpoint = leaves.add_midpoints(is_long)
        while (midpoint >= 0).any():
            midpoint = leaves.split_longest(midpoint)


class _Leaves:
    """The leaves of a growing `BisectionTree`, and the arrays of the tree.

    A node is a leaf until it is split into two halves. `node` holds the (L,) int32 nodes of the leaves.
    """

    def __init__(self, vertices: np.ndarray, triangle_vertex: np.ndarray) -> None:
        count = len(triangle_vertex)
        self.vertices = vertices
        self.vertex = np.array(triangle_vertex, dtype=np.int32)
        self.weights = np.broadcast_to(np.eye(3, dtype=np.float32), (count, 3, 3)).copy()
        self.root = np.arange(count, dtype=np.int32)
        self.node = self.root.copy()
        self.first_child = np.full(count, -1, dtype=np.int32)
        self.split_edge = np.zeros(count, dtype=np.int8)

    def add_midpoints(self, is_marked: np.ndarray) -> np.ndarray:
        """Add a vertex in the middle of each marked edge.

        Parameters
        ----------
        is_marked : (L, 3) bool ndarray
            Whether the edge from each corner to the next is marked. An edge must be marked in both of its
            triangles.

        Returns
        -------
        (L, 3) int32 ndarray
            The new vertex on each edge; -1 on edges that are not marked.
        """
        count = len(self.vertices)
        tail = self.vertex.astype(np.int64)
        head = np.roll(tail, -1, axis=1)
        key = np.minimum(tail, head) * count + np.maximum(tail, head)
        edge_key, edge = np.unique(key[is_marked], return_inverse=True)
        midpoint = np.full(self.vertex.shape, -1, dtype=np.int32)
        midpoint[is_marked] = count + edge.reshape(-1)
        low, high = np.divmod(edge_key, count)
        middle = 0.5 * (self.vertices[low] + self.vertices[high])
        self.vertices = np.concatenate([self.vertices, middle])
        return midpoint

    def split_longest(self, midpoint: np.ndarray) -> np.ndarray:
        """Split each leaf that has midpoints on its edges in two halves, at the longest of these edges.

        `midpoint` is the result of `add_midpoints` or, from the second call on, the result of the previous
        call of this method. The result is (L, 3) int32 for the new leaves: the midpoint of each edge that is
        still to be split; -1 for all other edges.
        """
        parent = np.flatnonzero((midpoint >= 0).any(axis=1))
        lengths = _edge_lengths(self.vertices, self.vertex[parent])
        edge = np.where(midpoint[parent] >= 0, lengths, -1.0).argmax(axis=1)
        # The split edge runs from corner a to corner b. Corner c is opposite to it.
        order = (edge[:, None] + np.arange(3)) % 3
        middle, on_bc, on_ca = np.take_along_axis(midpoint[parent], order, 1).T
        weights = np.take_along_axis(self.weights[parent], order[:, :, None], 1)
        halves = _halves(np.take_along_axis(self.vertex[parent], order, 1), middle)
        weight_halves = _halves(weights, 0.5 * (weights[:, 0] + weights[:, 1]))
        children = len(self.first_child) + np.arange(2 * len(parent), dtype=np.int32)
        self.first_child[self.node[parent]] = children[::2]
        self.first_child = np.concatenate([self.first_child, np.full_like(children, -1)])
        self.split_edge[self.node[parent]] = edge
        self.split_edge = np.concatenate([self.split_edge, np.zeros(len(children), dtype=np.int8)])
        self.node = _replaced(self.node, parent, children[::2], children[1::2])
        self.root = _replaced(self.root, parent, self.root[parent], self.root[parent])
        self.vertex = _replaced(self.vertex, parent, *halves)
        self.weights = _replaced(self.weights, parent, *weight_halves)
        none = np.full_like(middle, -1)
        halves = np.stack([none, none, on_ca], axis=1), np.stack([none, on_bc, none], axis=1)
        return _replaced(midpoint, parent, *halves)

    def tree(self) -> BisectionTree:
        """Return the `BisectionTree` with these leaves."""
        leaf = np.full(len(self.first_child), -1, dtype=np.int32)
        leaf[self.node] = np.arange(len(self.node), dtype=np.int32)
        return BisectionTree(
            first_child=self.first_child,
            split_edge=self.split_edge,
            leaf=leaf,
            leaf_root=self.root,
            leaf_vertex=self.vertex,
            leaf_weights=self.weights,
            vertices=self.vertices,
        )


def _halves(corner: np.ndarray, middle: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the (n, 3, ...) corners of both halves of triangles: (a, middle, c) and (middle, b, c).

    `corner` holds the (n, 3, ...) corners a, b, c of the triangles, and `middle` the (n, ...) midpoints of
    their edges from a to b.
    """
    a, b, c = np.moveaxis(corner, 1, 0)
    return np.stack([a, middle, c], axis=1), np.stack([middle, b, c], axis=1)


def _replaced(
    leaves: np.ndarray, parent: np.ndarray, first: np.ndarray, second: np.ndarray
) -> np.ndarray:
    """Return an array of the leaves after a split, with one element for each new leaf.

    `leaves` holds one element for each leaf before the split, and is changed. `parent` holds the indices of
    the leaves that are split. `first` and `second` hold the elements of their first and second children. The
    first child takes the place of its parent. The second children are appended.
    """
    leaves[parent] = first
    return np.concatenate([leaves, second])


def _edge_lengths(vertices: np.ndarray, triangle_vertex: np.ndarray) -> np.ndarray:
    """Return (T, 3) lengths of the edges from each corner to the next.

    The length of an edge is exactly the same in both of its triangles.
    """
    points = vertices.take(triangle_vertex, axis=0)
    edges = np.roll(points, -1, axis=1) - points
    return np.sqrt(dot(edges, edges))
