"""Evenly spaced lines of a surface in the layout of the shaders."""

from __future__ import annotations

import numpy as np

from ..projection.surface_lines import SurfaceLines
from .mesh_buffers import ROW_TEXELS

#: Largest number of bisections between a triangle of a mesh and a leaf.
MAX_TREE_DEPTH = 96


def line_records(lines: SurfaceLines) -> tuple[np.ndarray, int]:
    """Return the tree and the phases of evenly spaced lines as rows of texels.

    Returns
    -------
    rows : (rows, ROW_TEXELS, 4) float32 ndarray
        A texel for each node of the tree: its first child or -1, its bisected edge, and its leaf.
        Then 1 + M texels for each leaf: its heading, and for each family of lines the phases at the
        corners and the index.
    node_count : int
        0 if nothing is bisected; then the nodes are left out.
    """
    tree, pattern = lines.tree, lines.pattern
    leaf_count, family_count = pattern.index.shape
    node_count = len(tree.leaf) if len(tree.leaf) > leaf_count else 0
    texel_count = node_count + leaf_count * (1 + family_count)
    row_count = max(-(-texel_count // ROW_TEXELS), 1)
    flat = np.zeros((row_count * ROW_TEXELS, 4), dtype=np.float32)
    if node_count:
        flat[:node_count, 0] = tree.first_child
        flat[:node_count, 1] = tree.split_edge
        flat[:node_count, 2] = tree.leaf
    records = flat[node_count:texel_count].reshape(leaf_count, 1 + family_count, 4)
    records[:, 0, :2] = lines.heading.T
    records[:, 1:, :3] = pattern.phase
    records[:, 1:, 3] = pattern.index
    return flat.reshape(row_count, ROW_TEXELS, 4), node_count
