"""Conforming refinement of triangles by bisection, with a binary tree that finds the small ones."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .frames import dot

#: Factor by which longer edges are allowed while there would be too many triangles.
LENGTH_STEP = 1.15


@dataclass(frozen=True, eq=False)
class BisectionTree:
    """Triangles that are bisected again and again. The T roots are the given triangles.

    n is the number of nodes of the tree, L of its leaves.

    Attributes
    ----------
    first_child : (n,) int32 ndarray
        Index of the first of the two children of a node, which follow each other. -1 for a leaf.
    split_edge : (n,) int8 ndarray
        The corner k at which the bisected edge starts; it ends at the next corner.
    leaf : (n,) int32 ndarray
        Index of a leaf among the leaves. -1 for other nodes.
    leaf_root : (L,) int32 ndarray
        The root that contains each leaf.
    leaf_vertex : (L, 3) int32 ndarray
        Vertices of the leaves. Those beyond the given ones are midpoints of edges.
    leaf_weights : (L, 3, 3) float32 ndarray
        Barycentric coordinates in the root of the corners of each leaf. They are exact.
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
        """Find the leaves that contain points of the roots.

        Parameters
        ----------
        root : (P,) int ndarray
        weights : (P, 3) float32 ndarray
            Barycentric coordinates in the root. Points outside of it are in the nearest leaf.

        Returns
        -------
        leaf : (P,) int32 ndarray
        weights : (3, P) float32 ndarray
            Barycentric coordinates in the leaf.
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
    """Bisect triangles until their edges are short. Neighbors keep sharing their edges.

    Parameters
    ----------
    vertices : (V, 3) float64 ndarray
    triangle_vertex : (T, 3) int ndarray
    max_length : float
        Longer edges are bisected, in the units of the vertices.
    max_triangles : int
        If there would be more triangles, longer edges are allowed.

    Returns
    -------
    BisectionTree
    """
    root_count = len(triangle_vertex)
    leaf_vertex = np.array(triangle_vertex, dtype=np.int32)
    leaf_weights = np.broadcast_to(np.eye(3, dtype=np.float32), (root_count, 3, 3)).copy()
    leaf_root = np.arange(root_count, dtype=np.int32)
    leaf_node = leaf_root.copy()
    first_child = np.full(root_count, -1, dtype=np.int32)
    split_edge = np.zeros(root_count, dtype=np.int8)
    while True:
        lengths = _edge_lengths(vertices, leaf_vertex)
        long = lengths > max_length
        while len(leaf_vertex) + np.count_nonzero(long) > max_triangles and long.any():
            max_length *= LENGTH_STEP
            long = lengths > max_length
        if not long.any():
            break
        # The new vertices, and the one on each marked edge of each triangle.
        tail = leaf_vertex.astype(np.int64)
        head = np.roll(tail, -1, axis=1)
        key = np.minimum(tail, head) * len(vertices) + np.maximum(tail, head)
        unique_key, inverse = np.unique(key[long], return_inverse=True)
        midpoint = np.full(leaf_vertex.shape, -1, dtype=np.int32)
        midpoint[long] = len(vertices) + inverse.reshape(-1)
        low, high = np.divmod(unique_key, len(vertices))
        vertices = np.concatenate([vertices, 0.5 * (vertices[low] + vertices[high])])
        while len(parent := np.flatnonzero((midpoint >= 0).any(axis=1))):
            # The longest of the marked edges; halved edges are not marked.
            lengths = _edge_lengths(vertices, leaf_vertex[parent])
            edge = np.where(midpoint[parent] >= 0, lengths, -1.0).argmax(axis=1)
            order = (edge[:, None] + np.arange(3)) % 3
            corner = np.take_along_axis(leaf_vertex[parent], order, 1)
            mid, mid_bc, mid_ca = np.take_along_axis(midpoint[parent], order, 1).T
            none = np.full_like(mid, -1)
            weights = np.take_along_axis(leaf_weights[parent], order[:, :, None], 1)
            children = len(first_child) + np.arange(2 * len(parent), dtype=np.int32)
            first_child[leaf_node[parent]] = children[::2]
            first_child = np.concatenate([first_child, np.full_like(children, -1)])
            split_edge[leaf_node[parent]] = edge
            split_edge = np.concatenate([split_edge, np.zeros(len(children), dtype=np.int8)])
            leaf_node = _split(leaf_node, parent, children[::2], children[1::2])
            leaf_root = _split(leaf_root, parent, leaf_root[parent], leaf_root[parent])
            leaf_vertex = _split(leaf_vertex, parent, *_halves(corner, mid))
            leaf_weights = _split(
                leaf_weights, parent, *_halves(weights, 0.5 * (weights[:, 0] + weights[:, 1]))
            )
            first_midpoint = np.stack([none, none, mid_ca], axis=1)
            second_midpoint = np.stack([none, mid_bc, none], axis=1)
            midpoint = _split(midpoint, parent, first_midpoint, second_midpoint)
    leaf = np.full(len(first_child), -1, dtype=np.int32)
    leaf[leaf_node] = np.arange(len(leaf_node), dtype=np.int32)
    return BisectionTree(
        first_child, split_edge, leaf, leaf_root, leaf_vertex, leaf_weights, vertices
    )


def _halves(corner: np.ndarray, middle: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Values of (n, 3, ...) corners of both triangles, from those of the middle of the first edge."""
    a, b, c = np.moveaxis(corner, 1, 0)
    return np.stack([a, middle, c], axis=1), np.stack([middle, b, c], axis=1)


def _split(
    leaves: np.ndarray, parent: np.ndarray, first: np.ndarray, second: np.ndarray
) -> np.ndarray:
    """Replace parents in a list of leaves by their first children, and append the second ones."""
    leaves[parent] = first
    return np.concatenate([leaves, second])


def _edge_lengths(vertices: np.ndarray, triangle_vertex: np.ndarray) -> np.ndarray:
    """(T, 3) lengths of the edges from each corner to the next. Equal in both triangles."""
    points = vertices.take(triangle_vertex, axis=0)
    edges = np.roll(points, -1, axis=1) - points
    return np.sqrt(dot(edges, edges))
