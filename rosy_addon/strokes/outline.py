"""Lines of the shape itself: silhouettes, creases and borders."""

from __future__ import annotations

import numpy as np

from ..field.frames import dot, unit
from ..field.surface import surface_edges
from ..projection.camera import Camera
from ..projection.gbuffer import Body
from .ground import CREASE_ANGLE, sharp_sides
from .strokes import Strokes

#: What `Strokes.names` of an outline are, by family.
KINDS = ("silhouettes", "creases", "borders")


def outline(
    body: Body, camera: Camera | None = None, *, crease_angle: float = CREASE_ANGLE
) -> Strokes:
    """Silhouettes, creases and borders of a body.

    Parameters
    ----------
    body : Body
    camera : Camera, optional
        For whose eye the silhouettes are; none without.
    crease_angle : float
        Radians by which the surface bends at a sharp edge, at least.

    Returns
    -------
    Strokes
        Families as in `KINDS`; members and spacings are 0. Silhouettes are where interpolated
        normals are across the direction to the eye: smooth lines through the triangles (Hertzmann
        and Zorin, "Illustrating Smooth Surfaces", 2000).
    """
    surface = body.surface
    matrix = np.asarray(body.matrix, dtype=np.float64)
    points = body.world_points()
    corner = points[surface.triangle_vertex]
    linear = matrix[:3, :3]
    cofactors = np.array([np.cross(linear[k - 2], linear[k - 1]) for k in range(3)])
    normal = unit(surface.corner_normal @ cofactors.T)[surface.triangles]
    creases, borders = _edges(surface, corner, crease_angle)
    found = [
        _silhouettes(surface, corner, normal, camera) if camera is not None else _none(),
        _along_edges(corner, normal, creases),
        _along_edges(corner, normal, borders),
    ]
    return _as_strokes([_chained(*each) for each in found], surface.triangle_face)


#: Ends of pieces: (k, 2) keys, (k, 2, 3) points, (k, 2, 3) normals, (k,) triangles.
_Pieces = tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]


def _none() -> _Pieces:
    return (
        np.empty((0, 2), np.int64),
        np.empty((0, 2, 3)),
        np.empty((0, 2, 3)),
        np.empty(0, np.int64),
    )


def _silhouettes(surface, corner: np.ndarray, normal: np.ndarray, camera: Camera) -> _Pieces:
    """Where n . w is 0, a straight piece in each triangle in which it changes its sign."""
    facing = dot(normal, camera.toward(corner))
    front = facing > 0
    triangle = np.flatnonzero(front.any(axis=1) & ~front.all(axis=1))
    front, facing = front[triangle], facing[triangle]
    alone = np.argmax(front == (front.sum(axis=1) == 1)[:, None], axis=1)
    row = np.arange(len(triangle))
    ends, normals, keys = [], [], []
    vertex = surface.triangle_vertex[triangle].astype(np.int64)
    span = len(surface.vertices)
    for step in (1, 2):
        other = (alone + step) % 3
        share = facing[row, alone] / (facing[row, alone] - facing[row, other])
        for out, values in ((ends, corner), (normals, normal)):
            a, b = values[triangle, alone], values[triangle, other]
            out.append(a + share[:, None] * (b - a))
        low, high = np.sort(np.stack([vertex[row, alone], vertex[row, other]], axis=1), axis=1).T
        keys.append(low * span + high)
    return np.stack(keys, 1), np.stack(ends, 1), unit(np.stack(normals, 1)), triangle


def _edges(surface, corner: np.ndarray, crease_angle: float) -> tuple[np.ndarray, np.ndarray]:
    """Corners (3 t + k) that creases and borders start from."""
    vertex = surface.triangle_vertex.ravel()
    edges = surface_edges(vertex, np.arange(0, len(vertex) + 1, 3, dtype=np.int32))
    a, b = edges.sides[:, 0], edges.sides[:, 1]
    normal = unit(np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]))
    bent = dot(normal[a // 3], normal[b // 3]) < np.cos(crease_angle)
    open_ends = np.ones(len(edges.uses), dtype=bool)
    open_ends[edges.inner] = False
    borders = np.flatnonzero(open_ends[edges.corner_edge])
    return a[bent & sharp_sides(surface, a, b)], borders


def _along_edges(corner: np.ndarray, normal: np.ndarray, starts: np.ndarray) -> _Pieces:
    """Whole edges; points are told apart by their places."""
    triangle, k = starts // 3, starts % 3
    ends = np.stack([corner[triangle, k], corner[triangle, (k + 1) % 3]], axis=1)
    normals = np.stack([normal[triangle, k], normal[triangle, (k + 1) % 3]], axis=1)
    if not len(starts):
        return _none()
    _, keys = np.unique(ends.reshape(-1, 3), axis=0, return_inverse=True)
    return keys.reshape(-1, 2).astype(np.int64), ends, normals, triangle


def _chained(
    keys: np.ndarray, ends: np.ndarray, normals: np.ndarray, triangle: np.ndarray
) -> list[tuple[np.ndarray, np.ndarray, np.ndarray, bool]]:
    """Pieces that share their ends, joined: points, normals, triangles, and if it is closed.

    Lines end where they meet in other numbers than two.
    """
    count = len(keys)
    flat = keys.ravel()
    order = np.argsort(flat, kind="stable")
    _, first, uses = np.unique(flat[order], return_index=True, return_counts=True)
    mate = np.full(2 * count, -1, dtype=np.int64)
    pairs = first[uses == 2]
    mate[order[pairs]], mate[order[pairs + 1]] = order[pairs + 1], order[pairs]
    mate, left = mate.tolist(), np.ones(count, dtype=bool).tolist()
    heads = [end for end in range(2 * count) if mate[end] < 0] + list(range(0, 2 * count, 2))
    chains = []
    for head in heads:
        if not left[head // 2]:
            continue
        chain, end = [head], head
        while True:
            left[end // 2] = False
            end ^= 1
            chain.append(end)
            end = mate[end]
            if end < 0 or not left[end // 2]:
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


def _as_strokes(
    families: list[list[tuple[np.ndarray, np.ndarray, np.ndarray, bool]]], face: np.ndarray
) -> Strokes:
    chains = [chain for family in families for chain in family]
    number = np.repeat(np.arange(len(families)), [len(family) for family in families])
    size = [len(points) for points, _, _, _ in chains]
    start = np.concatenate([[0], np.cumsum(size, dtype=np.int64)])
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
        family=number.astype(np.int32),
        names=KINDS,
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
