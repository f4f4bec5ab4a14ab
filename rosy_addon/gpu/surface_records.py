"""What shaders look up on a surface besides its triangles: even lines, creases and features, as texels.

These functions take long for large meshes, and need no Blender: helper processes call them too.
"""

from __future__ import annotations

import numpy as np

from ..core.cache import BAKE_CACHE
from ..field.feature_curvature import feature_curvature
from ..field.rosy_field import RosyField
from ..field.surface import Surface
from ..projection.outline_mesh import cached_outline_mesh
from ..projection.surface_lines import SurfaceLines, cached_surface_lines
from .mesh_buffers import ROW_TEXELS, to_texture_rows

#: Largest number of bisections between a triangle of a mesh and a leaf.
MAX_TREE_DEPTH = 96


def line_records(
    surface: Surface, matrix: np.ndarray, field: RosyField, display: str, spacing: float
) -> tuple[np.ndarray, int, int]:
    """Compute the evenly spaced lines of a mesh instance, as `surface_lines.cached_surface_lines`.

    Returns
    -------
    rows : (rows, ROW_TEXELS, 4) float32 ndarray
        See `line_rows`.
    node_count : int
    triangle_count : int
        Triangles of the lines.
    """
    lines = cached_surface_lines(surface, matrix, field, display, spacing, BAKE_CACHE)
    BAKE_CACHE.evict_over_limit()
    return *line_rows(lines), len(lines.tree.leaf_root)


def line_rows(lines: SurfaceLines) -> tuple[np.ndarray, int]:
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


def outline_records(
    surface: Surface, linear: np.ndarray, center: np.ndarray, crease_angle: float | None
) -> tuple[np.ndarray | None, int, np.ndarray | None]:
    """Find the creases and parts of a mesh, as `outline_mesh.cached_outline_mesh`.

    Parameters
    ----------
    surface : Surface
    linear : (3, 3) ndarray
        The linear part from `mesh_buffers.split_matrix`.
    center : (3,) ndarray
        `MeshBuffers.center`.
    crease_angle : float or None

    Returns
    -------
    crease_points : (rows, ROW_TEXELS, 4) float32 ndarray or None
        The two ends of each edge, relative to the center.
    crease_count : int
    triangle_parts : (rows, ROW_TEXELS, 4) float32 ndarray or None
        The parts of four triangles in each texel. None if there is only one part.
    """
    found = cached_outline_mesh(surface, linear, crease_angle, BAKE_CACHE)
    BAKE_CACHE.evict_over_limit()
    points = found.crease_points(surface, linear).reshape(-1, 3) - center
    parts = np.empty((0, 4)) if found.triangle_part is None else found.triangle_part
    parts = np.pad(parts.ravel(), (0, -parts.size % 4)).reshape(-1, 4)
    crease_points, triangle_parts = (
        to_texture_rows(values) if len(values) else None for values in (points, parts)
    )
    return crease_points, len(points) // 2, triangle_parts


def feature_records(surface: Surface) -> np.ndarray:
    """Compute the curvature of features at the corners of each triangle, one triangle in a texel.

    See `field.feature_curvature`. They are (rows, ROW_TEXELS, 4) float32.
    """
    return to_texture_rows(feature_curvature(surface))
