"""Join the borders of a mesh where they coincide: at the seam of a grid that closes onto itself, and at its poles."""

from __future__ import annotations

import itertools
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from .blocks import mask
from .connectivity import build_edges, connected_components
from .formats.polygons import offsets_from_sizes
from .polygon_arrays import next_corners

if TYPE_CHECKING:
    from .mesh_arrays import MeshArrays

#: Vertices on borders coincide if they are nearer to each other than this, relative to the longest side of the
#: bounding box. Rounding of coordinates to float32 moves them by less.
TOLERANCE = 1e-6


#: Names, in lower case, of arrays that may differ where vertices are joined: normals and texture coordinates.
SHADING_NAMES = ("normals", "normal", "texture coordinates", "tcoords", "uv")


def coinciding_borders(arrays: MeshArrays) -> np.ndarray:
    """Find vertices on borders that are at the same position and have the same data.

    Vertices are left out if an edge would get more than two faces by joining them, as where bodies touch.

    Parameters
    ----------
    arrays : MeshArrays
        With (V, 3) vertices.

    Returns
    -------
    (V,) int64 ndarray
        For each vertex, the vertex of the smallest index that it coincides with: itself for most.
    """
    target = np.arange(len(arrays.vertices))
    edges = build_edges(arrays.corner_vertex, arrays.face_start)
    border = np.unique(edges.ends[edges.face_count == 1])
    points = arrays.vertices[border]
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
    near = near[_have_same_data(arrays, *border[near].T)]
    label = connected_components(len(border), near)
    _, first = np.unique(label, return_index=True)
    target[border] = border[first[label]]
    joined = build_edges(*_without_repeats(target, arrays)[:2])
    touching = mask(len(target), joined.ends[joined.face_count > 2])
    return np.where(touching[target], np.arange(len(target)), target)


def _have_same_data(arrays: MeshArrays, first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Return for (n,) pairs of vertices whether their numbers are the same. Whole numbers are only labels."""
    is_same = np.ones(len(first), dtype=bool)
    for name, values in (arrays.vertex_data or {}).items():
        if name.lower() in SHADING_NAMES:
            continue
        rows = np.asarray(values)
        if rows.dtype.kind == "f" and len(rows) == len(arrays.vertices):
            rows = rows.reshape(len(rows), -1)
            limit = TOLERANCE * np.abs(rows).max(initial=0.0)
            is_same &= ~(np.abs(rows[first] - rows[second]) > limit).any(axis=1)
    return is_same


def _without_repeats(
    target: np.ndarray, arrays: MeshArrays
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return the polygons with joined vertices, without corners that repeat the one before.

    Returns
    -------
    corner_vertex, face_start : ndarray
        The polygons. Those with fewer than three different corners are left out.
    corner, face : ndarray
        Indices of these corners and faces in `arrays`.
    """
    vertex, start = target[arrays.corner_vertex], arrays.face_start
    is_kept = vertex != vertex[next_corners(start)]
    size = np.add.reduceat(is_kept, start[:-1]) if len(start) > 1 else np.diff(start)
    is_kept &= np.repeat(size >= 3, np.diff(start))
    corner, face = np.flatnonzero(is_kept), np.flatnonzero(size >= 3)
    return vertex[corner], offsets_from_sizes(size[face]), corner, face


def with_joined_borders(arrays: MeshArrays) -> tuple[MeshArrays, int]:
    """Join the vertices that `coinciding_borders` finds.

    Parameters
    ----------
    arrays : MeshArrays
        With (V, 3) vertices, and texture coordinates of the corners, if any.

    Returns
    -------
    joined : MeshArrays
        Without the vertices that have been joined to others. A joined vertex has the data of the first one.
    count : int
        Number of vertices that have been joined to others.
    """
    target = coinciding_borders(arrays)
    kept = np.flatnonzero(target == np.arange(len(target)))
    count = len(target) - len(kept)
    if not count:
        return arrays, 0
    corner_vertex, face_start, corner, face = _without_repeats(target, arrays)
    number = np.cumsum(target == np.arange(len(target))) - 1
    data = [
        None
        if rows is None
        else {name: np.asarray(v)[index] if len(v) == total else v for name, v in rows.items()}
        for rows, index, total in (
            (arrays.vertex_data, kept, len(target)),
            (arrays.face_data, face, len(arrays.face_start) - 1),
        )
    ]
    uv = None if arrays.uv is None else arrays.uv[corner]
    vertices = arrays.vertices[kept]
    joined = replace(
        arrays,
        vertices=vertices,
        corner_vertex=number[corner_vertex],
        face_start=face_start,
        uv=uv,
        vertex_data=data[0],
        face_data=data[1],
    )
    return joined, count
