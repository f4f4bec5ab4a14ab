"""Data of surfaces in the texel layout of the shaders: evenly spaced lines, creases, feature curvatures.

These functions take long for large meshes. They do not need Blender, so a helper process can call them.
"""

import numpy as np

from ..core.cache import BAKE_CACHE
from ..field.feature_curvature import feature_curvature
from ..field.surface import Surface
from ..projection.gbuffer import MeshInstance
from ..projection.outline_mesh import cached_outline_mesh
from ..projection.surface_lines import SurfaceLines, cached_surface_lines
from .mesh_buffers import empty_records, to_texture_rows

#: Largest number of bisections from a triangle of a mesh down to a leaf of its `BisectionTree`.
MAX_TREE_DEPTH = 96


def line_records(
    instance: MeshInstance, display: str, spacing: float
) -> tuple[np.ndarray, int, int]:
    """Compute the evenly spaced lines of a mesh instance with `surface_lines.cached_surface_lines`.

    Parameters
    ----------
    instance : MeshInstance
    display : {"smooth", "flat"}
        Shading of the surface; see `Look.display`.
    spacing : float
        Distance between lines in world space, in Blender units.

    Returns
    -------
    rows : (rows, ROW_TEXELS, 4) float32 ndarray
        The tree of bisected triangles and the phases of the lines; see `line_rows`.
    node_count : int
        Number of nodes of the tree in `rows`; 0 if no triangle is bisected.
    triangle_count : int
        Number of leaves: triangles on which the phase is linear.
    """
    lines = cached_surface_lines(instance, display, spacing, BAKE_CACHE)
    BAKE_CACHE.evict_over_limit()
    return *line_rows(lines), len(lines.tree.leaf_root)


def line_rows(lines: SurfaceLines) -> tuple[np.ndarray, int]:
    """Return the tree and the phases of evenly spaced lines as rows of texels.

    Returns
    -------
    rows : (rows, ROW_TEXELS, 4) float32 ndarray
        First, a texel for each node of the `BisectionTree`: the node's first child or -1, its bisected
        edge, and its leaf. Then 1 + M texels for each leaf: its heading (see `SurfaceLines`), and for each
        of the M line directions the phases at the corners and the number of lines that end in the leaf
        (see `StripePattern`).
    node_count : int
        Number of nodes in `rows`; 0 if no triangle is bisected, so that no nodes are needed.
    """
    tree, pattern = lines.tree, lines.pattern
    leaf_count, family_count = pattern.index.shape
    node_count = len(tree.leaf) if len(tree.leaf) > leaf_count else 0
    texel_count = node_count + leaf_count * (1 + family_count)
    rows, texels = empty_records(texel_count, 1)
    if node_count:
        nodes = tree.first_child, tree.split_edge, tree.leaf
        texels[:node_count, 0, :3] = np.stack(nodes, axis=1)
    records = texels[node_count:].reshape(leaf_count, 1 + family_count, 4)
    records[:, 0, :2] = lines.heading.T
    records[:, 1:, :3] = pattern.phase
    records[:, 1:, 3] = pattern.index
    return rows, node_count


def outline_records(
    surface: Surface, linear: np.ndarray, center: np.ndarray, crease_angle: float | None
) -> tuple[np.ndarray | None, int, np.ndarray | None]:
    """Find the creases and connected components of a mesh with `outline_mesh.cached_outline_mesh`.

    Parameters
    ----------
    surface : Surface
    linear : (3, 3) ndarray
        The linear map of positions that changes the shape, from `mesh_buffers.split_matrix`.
    center : (3,) ndarray
        Origin of the positions on the device, after the linear map (`MeshBuffers.center`).
    crease_angle : float or None
        Smallest angle between the normals of the faces at a crease, in radians. None: there are no creases.

    Returns
    -------
    crease_points : (rows, ROW_TEXELS, 4) float32 ndarray or None
        The two ends of each edge of a crease, relative to `center`. None if there are no creases.
    crease_count : int
        Number of edges of creases.
    triangle_parts : (rows, ROW_TEXELS, 4) float32 ndarray or None
        The connected components of the triangles, four triangles in each texel. None if there is only one
        component.
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
    """Return the curvature of surface features as (rows, ROW_TEXELS, 4) float32, a texel for each triangle.

    A texel has the curvatures at the three corners, in units of 1 / length in object space; see
    `field.feature_curvature`.
    """
    return to_texture_rows(feature_curvature(surface))
