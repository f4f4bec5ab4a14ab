"""Join the borders of a mesh where they coincide: at the seam of a closed grid, and at its poles."""

import itertools
from collections.abc import Mapping
from typing import Any

import numpy as np

from .blocks import mask
from .connectivity import build_edges, connected_components
from .formats.polygons import Polygons, offsets_from_sizes
from .polygon_arrays import next_corners

#: Vertices on borders coincide if they are nearer to each other than this, relative to the longest side of the
#: bounding box of the borders; they stay apart beyond four times this distance. Rounding of coordinates to
#: float32 moves them by less.
TOLERANCE = 1e-6

#: Names, in lower case, of arrays that may differ where vertices are joined: normals and texture coordinates.
SHADING_NAMES = ("normals", "normal", "texture coordinates", "tcoords", "uv")


def coinciding_borders(polygons: Polygons, vertex_data: Mapping[str, Any] | None) -> np.ndarray:
    """Find vertices on borders that are at the same position and have the same data.

    Vertices are not joined if an edge would then have more than two faces, for example where two bodies touch.

    Parameters
    ----------
    polygons : Polygons
    vertex_data : mapping of str to (V, ...) array_like, or None
        Named numbers at the vertices.

    Returns
    -------
    (V,) int64 ndarray
        For each vertex, the vertex to join it to: of all that coincide with it, the one with the smallest index. For
        most vertices, this is the vertex itself.
    """
    target = np.arange(len(polygons.vertices))
    edges = build_edges(polygons.corner_vertex, polygons.face_start)
    border = np.unique(edges.ends[edges.face_count == 1])
    points = polygons.vertices[border]
    if not len(border) or not np.isfinite(points).all() or not np.ptp(points, axis=0).any():
        return target
    size = 2 * TOLERANCE * float(np.ptp(points, axis=0).max())
    # Two points nearer than half a cell are in the same cell of one of these eight grids.
    pairs = []
    for offset in itertools.product((0.0, 0.5), repeat=3):
        cell = np.floor(points / size + offset)
        order = np.lexsort(cell.T)
        is_same = (cell[order[1:]] == cell[order[:-1]]).all(axis=1)
        pairs.append(np.stack([order[:-1], order[1:]], axis=1)[is_same])
    near = np.concatenate(pairs)
    near = near[_have_same_data(vertex_data or {}, len(target), border[near])]
    label = connected_components(len(border), near)
    _, first = np.unique(label, return_index=True)
    target[border] = border[first[label]]
    joined = build_edges(*without_repeats(target, polygons)[:2])
    touching = mask(len(target), joined.ends[joined.face_count > 2])
    return np.where(touching[target], np.arange(len(target)), target)


def _have_same_data(data: Mapping[str, Any], count: int, pairs: np.ndarray) -> np.ndarray:
    """Return (n,) bool: whether the data of both vertices of (n, 2) pairs are the same.

    `data` are named arrays with `count` rows, one for each vertex. Only floating-point numbers are compared:
    whole numbers are labels. Normals and texture coordinates may differ (`SHADING_NAMES`).
    """
    is_same, (first, second) = np.ones(len(pairs), dtype=bool), pairs.T
    for name, values in data.items():
        if name.lower() in SHADING_NAMES:
            continue
        rows = np.asarray(values)
        if rows.dtype.kind == "f" and len(rows) == count:
            rows = rows.reshape(len(rows), -1)
            limit = TOLERANCE * np.abs(rows).max(initial=0.0)
            is_same &= ~(np.abs(rows[first] - rows[second]) > limit).any(axis=1)
    return is_same


def without_repeats(
    target: np.ndarray, polygons: Polygons
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return the polygons after joining vertices. Of successive corners at the same vertex, only the last is kept.

    `target` holds, for each of V vertices, the vertex that replaces it (the result of `coinciding_borders`).

    Returns
    -------
    corner_vertex, face_start : ndarray
        The polygons. Those with fewer than three different corners are left out.
    corner, face : ndarray
        Indices of these corners and faces in `polygons`.
    """
    vertex, start = target[polygons.corner_vertex], polygons.face_start
    is_kept = vertex != vertex[next_corners(start)]
    size = np.add.reduceat(is_kept, start[:-1]) if len(start) > 1 else np.diff(start)
    is_kept &= np.repeat(size >= 3, np.diff(start))
    corner, face = np.flatnonzero(is_kept), np.flatnonzero(size >= 3)
    return vertex[corner], offsets_from_sizes(size[face]), corner, face
