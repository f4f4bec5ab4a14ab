"""Polygons cut into triangles: fans where that is right, ear by ear where it is not."""

from __future__ import annotations

import numpy as np

#: Sine of the turn at a corner up to which it counts as flat, reflex if it turns the other way.
FLAT = 1e-6


def triangulate(
    vertices: np.ndarray, corner_vertex: np.ndarray, face_start: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Cut every face into triangles, k - 2 for a face of k corners, in the order of the faces.

    No triangle of a concave face lies outside it, and none is without area on account of corners
    in a line. Faces are seen along their (Newell) normal; those that cross themselves give
    triangles of which nothing more is promised.

    Parameters
    ----------
    vertices : (V, 3) float64 ndarray
    corner_vertex : (C,) int32 ndarray
    face_start : (F + 1,) int32 ndarray

    Returns
    -------
    triangles : (T, 3) int32 ndarray
        Corner indices.
    triangle_face : (T,) int32 ndarray

    Notes
    -----
    Convex faces are cut into the fan around their first corner. A face with a single flat or reflex
    corner is cut into the fan around that one, which sees all others: shortest paths inside a
    polygon bend at reflex corners only. The few others are cut in a Python loop.
    """
    size = np.diff(face_start)
    hub = np.zeros(len(size), dtype=np.int32)
    faces = np.flatnonzero(size > 3)
    by_ears = faces[:0]
    if len(faces):
        hub[faces], needs_ears = _fan_hubs(vertices, corner_vertex, face_start, faces)
        by_ears = faces[needs_ears]
    triangles, triangle_face = _fans(face_start, hub)
    first_triangle = np.cumsum(size - 2) - (size - 2)
    for face in by_ears:
        corners = np.arange(face_start[face], face_start[face + 1])
        ears = _cut_ears(_flattened(vertices[corner_vertex[corners]]))
        first = first_triangle[face]
        triangles[first : first + len(ears)] = corners[ears]
    return triangles, triangle_face


def _fans(face_start: np.ndarray, hub: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Triangles of all faces as fans, each around its corner number `hub`."""
    size = np.diff(face_start)
    count = size - 2
    triangle_face = np.repeat(np.arange(len(size), dtype=np.int32), count)
    first_triangle = (np.cumsum(count) - count)[triangle_face]
    step = np.arange(len(triangle_face), dtype=np.int32) - first_triangle
    first, size, hub = face_start[triangle_face], size[triangle_face], hub[triangle_face]
    ahead = np.stack([hub, hub + step + 1, hub + step + 2], axis=1)
    ahead -= np.where(ahead >= size[:, None], size[:, None], 0).astype(ahead.dtype)
    return (first[:, None] + ahead).astype(np.int32), triangle_face


def _fan_hubs(
    vertices: np.ndarray, corner_vertex: np.ndarray, face_start: np.ndarray, faces: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Around which of its corners to fan each of some faces, and which no fan is right for."""
    size = np.diff(face_start)[faces]
    hub = np.zeros(len(faces), dtype=np.int32)
    needs_ears = np.zeros(len(faces), dtype=bool)
    for count in np.unique(size):
        of_size = np.flatnonzero(size == count)
        corners = face_start[faces[of_size]][:, None] + np.arange(count)
        turn = _turns(vertices[corner_vertex[corners]])
        least = np.argmin(turn, axis=1)
        bent = turn.min(axis=1) <= FLAT
        hub[of_size] = np.where(bent, least, 0)
        if count > 4:
            needs_ears[of_size] = (turn <= FLAT).sum(axis=1) > 1
    return hub, needs_ears


def _turns(points: np.ndarray) -> np.ndarray:
    """(F, k) sine of the turn at each corner of (F, k, 3) polygons, negative at reflex ones."""
    edge = np.roll(points, -1, axis=1) - points
    before = np.roll(edge, 1, axis=1)
    relative = points - points[:, :1]
    normal = np.cross(relative, np.roll(relative, -1, axis=1)).sum(axis=1)
    length = np.linalg.norm(edge, axis=2)
    scale = np.roll(length, 1, axis=1) * length * np.linalg.norm(normal, axis=1)[:, None]
    turn = np.einsum("fki,fi->fk", np.cross(before, edge), normal)
    return np.divide(turn, scale, out=np.zeros_like(turn), where=scale > 0)


def _flattened(points: np.ndarray) -> np.ndarray:
    """(k, 2) a polygon's corners seen along its normal, which they run counter-clockwise about."""
    relative = points - points[0]
    normal = np.cross(relative, np.roll(relative, -1, axis=0)).sum(axis=0)
    axis = np.zeros(3)
    axis[np.argmin(np.abs(normal))] = 1.0
    x = np.cross(axis, normal)
    y = np.cross(normal, x)
    return np.stack([relative @ x, relative @ y / (np.linalg.norm(normal) or 1.0)], axis=1)


def _cut_ears(points: np.ndarray) -> np.ndarray:
    """(k - 2, 3) triangles of a simple counter-clockwise polygon of (k, 2) points.

    Of the corners whose triangle holds no other corner, the one with the widest smallest angle is
    cut off first.
    """
    left = np.arange(len(points))
    triangles = []
    while len(left) > 3:
        behind, ahead = np.roll(left, 1), np.roll(left, -1)
        a, b, c = points[behind], points[left], points[ahead]
        quality = _smallest_sine(a, b, c)
        blocked = _holds_a_corner(a, b, c, points[left])
        # A polygon that crosses itself may have no ear: then the best triangle there is.
        ear = int(np.argmax(np.where(blocked, quality - 2, quality)))
        triangles.append((behind[ear], left[ear], ahead[ear]))
        left = np.delete(left, ear)
    return np.array([*triangles, left])


def _cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]


def _smallest_sine(a: np.ndarray, b: np.ndarray, c: np.ndarray) -> np.ndarray:
    """(k,) least sine of the angles of triangles, negative for clockwise ones."""
    area = _cross(b - a, c - a)
    one, two, three = (np.linalg.norm(side, axis=1) for side in (b - a, c - b, a - c))
    scale = one * two * three / np.maximum(np.minimum(np.minimum(one, two), three), 1e-300)
    return np.divide(area, scale, out=np.zeros_like(area), where=scale > 0)


def _holds_a_corner(a: np.ndarray, b: np.ndarray, c: np.ndarray, points: np.ndarray) -> np.ndarray:
    """(k,) whether a point lies in or on a triangle, its own corners' places excepted."""
    held = np.ones((len(a), len(points)), dtype=bool)
    for start, stop in ((a, b), (b, c), (c, a)):
        held &= _cross((stop - start)[:, None], points[None] - start[:, None]) >= 0
        held &= (points[None] != start[:, None]).any(axis=2)
    return held.any(axis=1)
