"""Outlines of meshes as strokes: silhouettes, creases and borders."""

from __future__ import annotations

import numpy as np

from ..field.frames import dot, normalize
from ..field.surface import Surface, build_edges
from ..projection.camera import Camera
from ..projection.gbuffer import MeshInstance
from ..projection.vector_components import cofactor_matrix
from .stroke_set import Strokes
from .tangent_mesh import CREASE_ANGLE, is_sharp_edge

#: `Strokes.names` of an outline: the kind of line of each family.
OUTLINE_KINDS = ("silhouettes", "creases", "borders")


def outline(
    instance: MeshInstance, camera: Camera | None = None, *, crease_angle: float = CREASE_ANGLE
) -> Strokes:
    """Extract the silhouettes, creases and borders of a mesh instance.

    Silhouettes are the curves on which the interpolated normal is perpendicular to the direction to
    the camera. They pass smoothly through the triangles (Hertzmann and Zorin, "Illustrating Smooth
    Surfaces", SIGGRAPH 2000).

    Parameters
    ----------
    instance : MeshInstance
    camera : Camera, optional
        Camera of the silhouettes. Without a camera there are no silhouettes.
    crease_angle : float
        Smallest angle in radians between the normals of the two triangles at a crease. Creases are
        only at edges across which normals are not interpolated.

    Returns
    -------
    Strokes
        World space; families as in `OUTLINE_KINDS`. Members and spacings are 0, weights are NaN.
    """
    surface = instance.surface
    matrix = np.asarray(instance.matrix, dtype=np.float64)
    points = instance.world_points()
    corner = points[surface.triangle_vertex]
    linear = matrix[:3, :3]
    normal = normalize(surface.corner_normal @ cofactor_matrix(linear).T)[surface.triangles]
    creases, borders = _crease_and_border_corners(surface, corner, crease_angle)
    segments = [
        _silhouettes(surface, corner, normal, camera) if camera is not None else _no_segments(),
        _edge_segments(corner, normal, creases),
        _edge_segments(corner, normal, borders),
    ]
    return _to_strokes([_chain_segments(*family) for family in segments], surface.triangle_face)


#: k segments: (k, 2) keys of the end points, (k, 2, 3) end points, (k, 2, 3) normals there and (k,)
#: triangles. End points are the same if their keys are equal.
_Segments = tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]


def _no_segments() -> _Segments:
    """Return the arrays of no segments."""
    return (
        np.empty((0, 2), np.int64),
        np.empty((0, 2, 3)),
        np.empty((0, 2, 3)),
        np.empty(0, np.int64),
    )


def _silhouettes(
    surface: Surface, corner: np.ndarray, normal: np.ndarray, camera: Camera
) -> _Segments:
    """Return the zero set of n . w, where w is the direction to the camera.

    It has a straight segment in each triangle in which n . w changes its sign.
    """
    facing = dot(normal, camera.view_directions(corner))
    front = facing > 0
    triangle = np.flatnonzero(front.any(axis=1) & ~front.all(axis=1))
    front, facing = front[triangle], facing[triangle]
    lone_corner = np.argmax(front == (front.sum(axis=1) == 1)[:, None], axis=1)
    row = np.arange(len(triangle))
    ends, normals, keys = [], [], []
    vertex = surface.triangle_vertex[triangle].astype(np.int64)
    vertex_count = len(surface.vertices)
    for step in (1, 2):
        other = (lone_corner + step) % 3
        fraction = facing[row, lone_corner] / (facing[row, lone_corner] - facing[row, other])
        for target, values in ((ends, corner), (normals, normal)):
            a, b = values[triangle, lone_corner], values[triangle, other]
            target.append(a + fraction[:, None] * (b - a))
        low, high = np.sort(
            np.stack([vertex[row, lone_corner], vertex[row, other]], axis=1), axis=1
        ).T
        keys.append(low * vertex_count + high)
    return np.stack(keys, 1), np.stack(ends, 1), normalize(np.stack(normals, 1)), triangle


def _crease_and_border_corners(
    surface: Surface, corner: np.ndarray, crease_angle: float
) -> tuple[np.ndarray, np.ndarray]:
    """Return the corners (3 t + k) at which the edges of creases and of borders start."""
    vertex = surface.triangle_vertex.ravel()
    edges = build_edges(vertex, np.arange(0, len(vertex) + 1, 3, dtype=np.int32))
    a, b = edges.halfedges[:, 0], edges.halfedges[:, 1]
    normal = normalize(np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]))
    is_bent = dot(normal[a // 3], normal[b // 3]) < np.cos(crease_angle)
    is_border_edge = np.ones(len(edges.face_count), dtype=bool)
    is_border_edge[edges.interior] = False
    borders = np.flatnonzero(is_border_edge[edges.corner_edge])
    return a[is_bent & is_sharp_edge(surface, a, b)], borders


def _edge_segments(corner: np.ndarray, normal: np.ndarray, starts: np.ndarray) -> _Segments:
    """Return the edges that start at the given corners; equal positions get equal keys."""
    triangle, k = starts // 3, starts % 3
    ends = np.stack([corner[triangle, k], corner[triangle, (k + 1) % 3]], axis=1)
    normals = np.stack([normal[triangle, k], normal[triangle, (k + 1) % 3]], axis=1)
    if not len(starts):
        return _no_segments()
    _, keys = np.unique(ends.reshape(-1, 3), axis=0, return_inverse=True)
    return keys.reshape(-1, 2).astype(np.int64), ends, normals, triangle


def _chain_segments(
    keys: np.ndarray, ends: np.ndarray, normals: np.ndarray, triangle: np.ndarray
) -> list[tuple[np.ndarray, np.ndarray, np.ndarray, bool]]:
    """Join segments that share end points into polylines.

    A polyline ends at each point that does not have exactly two segments.

    Returns
    -------
    list of (points, normals, triangles, closed)
        (p, 3) points and normals, (p,) triangles, and whether the last point is the first.
    """
    count = len(keys)
    flat = keys.ravel()
    order = np.argsort(flat, kind="stable")
    _, first, uses = np.unique(flat[order], return_index=True, return_counts=True)
    mate = np.full(2 * count, -1, dtype=np.int64)
    pairs = first[uses == 2]
    mate[order[pairs]], mate[order[pairs + 1]] = order[pairs + 1], order[pairs]
    mate, unused = mate.tolist(), np.ones(count, dtype=bool).tolist()
    chain_starts = [end for end in range(2 * count) if mate[end] < 0] + list(range(0, 2 * count, 2))
    chains = []
    for chain_start in chain_starts:
        if not unused[chain_start // 2]:
            continue
        chain, end = [chain_start], chain_start
        while True:
            unused[end // 2] = False
            end ^= 1
            chain.append(end)
            end = mate[end]
            if end < 0 or not unused[end // 2]:
                break
        points = np.array(chain)
        chains.append(
            (
                ends.reshape(-1, 3)[points],
                normals.reshape(-1, 3)[points],
                triangle[points // 2],
                end >= 0,
            )
        )
    return chains


def _to_strokes(
    families: list[list[tuple[np.ndarray, np.ndarray, np.ndarray, bool]]], face: np.ndarray
) -> Strokes:
    """Return the polylines of `_chain_segments` as strokes, one list for each family.

    `face` is the (T,) face of each triangle.
    """
    chains = [chain for family in families for chain in family]
    family_index = np.repeat(np.arange(len(families)), [len(family) for family in families])
    counts = [len(points) for points, _, _, _ in chains]
    start = np.concatenate([[0], np.cumsum(counts, dtype=np.int64)])
    columns = [np.concatenate(column) for column in list(zip(*chains, strict=True))[:3]] or [
        np.empty((0, 3)),
        np.empty((0, 3)),
        np.empty(0, dtype=np.int64),
    ]
    points, normal, triangle = columns
    total = len(points)
    return Strokes(
        points=points,
        start=start,
        family=family_index.astype(np.int32),
        names=OUTLINE_KINDS,
        face=face[triangle],
        triangle=triangle.astype(np.int32),
        weights=np.full((total, 3), np.nan),
        normal=normal,
        member=np.zeros((total, 3)),
        spacing=np.zeros(total),
        width=np.ones(total),
        opacity=np.ones(total),
        closed=np.array([closed for _, _, _, closed in chains], dtype=bool),
    )
