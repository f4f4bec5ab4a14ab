"""Triangulate polygons, as fans where possible and by ear clipping otherwise."""

from __future__ import annotations

import numpy as np

#: Largest sine of the turning angle at a flat corner. Reflex corners have negative sines.
COLLINEAR_SINE = 1e-6


def triangulate(
    vertices: np.ndarray, corner_vertex: np.ndarray, face_start: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Split each face with k corners into k - 2 triangles, in the order of the faces.

    Triangles of a concave face lie inside it, and collinear corners cause no triangles without
    area. Faces are projected along their Newell normal. Self-intersecting faces are also split, but
    their triangles may overlap.

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
        Face of each triangle, ascending.

    Notes
    -----
    Convex faces become a fan around their first corner. A face with a single flat or reflex corner
    becomes a fan around that corner. All other corners are visible from it, because shortest paths
    inside a polygon bend only at reflex corners. The remaining faces, usually few, are ear-clipped
    in a Python loop.
    """
    size = np.diff(face_start)
    apex = np.zeros(len(size), dtype=np.int32)
    faces = np.flatnonzero(size > 3)
    ear_faces = faces[:0]
    if len(faces):
        apex[faces], needs_ears = _fan_apexes(vertices, corner_vertex, face_start, faces)
        ear_faces = faces[needs_ears]
    triangles, triangle_face = _triangle_fans(face_start, apex)
    first_triangle = np.cumsum(size - 2) - (size - 2)
    for face in ear_faces:
        corners = np.arange(face_start[face], face_start[face + 1])
        ears = _ear_clip(_project_to_plane(vertices[corner_vertex[corners]]))
        first = first_triangle[face]
        triangles[first : first + len(ears)] = corners[ears]
    return triangles, triangle_face


def _triangle_fans(face_start: np.ndarray, apex: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """`triangles` and `triangle_face` of fans; (F,) `apex` is the corner within each face."""
    size = np.diff(face_start)
    count = size - 2
    triangle_face = np.repeat(np.arange(len(size), dtype=np.int32), count)
    first_triangle = (np.cumsum(count) - count)[triangle_face]
    step = np.arange(len(triangle_face), dtype=np.int32) - first_triangle
    first, size, apex = face_start[triangle_face], size[triangle_face], apex[triangle_face]
    local_corners = np.stack([apex, apex + step + 1, apex + step + 2], axis=1)
    local_corners -= np.where(local_corners >= size[:, None], size[:, None], 0).astype(
        local_corners.dtype
    )
    return (first[:, None] + local_corners).astype(np.int32), triangle_face


def _fan_apexes(
    vertices: np.ndarray, corner_vertex: np.ndarray, face_start: np.ndarray, faces: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Choose the apex of the fan of each face, and find the faces that need ear clipping.

    Parameters
    ----------
    vertices, corner_vertex, face_start : ndarray
    faces : (n,) int ndarray
        Faces with more than three corners.

    Returns
    -------
    apex : (n,) int32 ndarray
        Corner within each face, from 0.
    needs_ears : (n,) bool ndarray
    """
    size = np.diff(face_start)[faces]
    apex = np.zeros(len(faces), dtype=np.int32)
    needs_ears = np.zeros(len(faces), dtype=bool)
    for count in np.unique(size):
        group = np.flatnonzero(size == count)
        corners = face_start[faces[group]][:, None] + np.arange(count)
        sine = _corner_sines(vertices[corner_vertex[corners]])
        sharpest = np.argmin(sine, axis=1)
        not_convex = sine.min(axis=1) <= COLLINEAR_SINE
        apex[group] = np.where(not_convex, sharpest, 0)
        if count > 4:
            needs_ears[group] = (sine <= COLLINEAR_SINE).sum(axis=1) > 1
    return apex, needs_ears


def _corner_sines(points: np.ndarray) -> np.ndarray:
    """(F, k) sines of the turning angles of (F, k, 3) polygons; negative at reflex corners."""
    edge = np.roll(points, -1, axis=1) - points
    previous_edge = np.roll(edge, 1, axis=1)
    relative = points - points[:, :1]
    normal = np.cross(relative, np.roll(relative, -1, axis=1)).sum(axis=1)
    length = np.linalg.norm(edge, axis=2)
    scale = np.roll(length, 1, axis=1) * length * np.linalg.norm(normal, axis=1)[:, None]
    sine = np.einsum("fki,fi->fk", np.cross(previous_edge, edge), normal)
    return np.divide(sine, scale, out=np.zeros_like(sine), where=scale > 0)


def _project_to_plane(points: np.ndarray) -> np.ndarray:
    """(k, 2) corners of a polygon projected along its normal, in counter-clockwise order."""
    relative = points - points[0]
    normal = np.cross(relative, np.roll(relative, -1, axis=0)).sum(axis=0)
    axis = np.zeros(3)
    axis[np.argmin(np.abs(normal))] = 1.0
    x = np.cross(axis, normal)
    y = np.cross(normal, x)
    return np.stack([relative @ x, relative @ y / (np.linalg.norm(normal) or 1.0)], axis=1)


def _ear_clip(points: np.ndarray) -> np.ndarray:
    """Triangulate a simple counter-clockwise polygon by ear clipping.

    Each step cuts off the ear whose smallest angle is the largest. An ear is a corner whose
    triangle contains no other corner.

    Parameters
    ----------
    points : (k, 2) ndarray

    Returns
    -------
    (k - 2, 3) int ndarray
        Indices of points.
    """
    remaining = np.arange(len(points))
    triangles = []
    while len(remaining) > 3:
        previous, following = np.roll(remaining, 1), np.roll(remaining, -1)
        a, b, c = points[previous], points[remaining], points[following]
        quality = _smallest_sine(a, b, c)
        blocked = _contains_vertex(a, b, c, points[remaining])
        # A self-intersecting polygon may have no ear; then take the triangle of best quality.
        ear = int(np.argmax(np.where(blocked, quality - 2, quality)))
        triangles.append((previous[ear], remaining[ear], following[ear]))
        remaining = np.delete(remaining, ear)
    return np.array([*triangles, remaining])


def _cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """(...) z components of the cross products of (..., 2) vectors."""
    return a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]


def _smallest_sine(a: np.ndarray, b: np.ndarray, c: np.ndarray) -> np.ndarray:
    """(k,) smallest sines of the angles of triangles; negative for clockwise triangles."""
    area = _cross(b - a, c - a)
    ab, bc, ca = (np.linalg.norm(side, axis=1) for side in (b - a, c - b, a - c))
    scale = ab * bc * ca / np.maximum(np.minimum(np.minimum(ab, bc), ca), 1e-300)
    return np.divide(area, scale, out=np.zeros_like(area), where=scale > 0)


def _contains_vertex(a: np.ndarray, b: np.ndarray, c: np.ndarray, points: np.ndarray) -> np.ndarray:
    """(k,) whether a point lies in or on each triangle; points at its corners do not count."""
    contained = np.ones((len(a), len(points)), dtype=bool)
    for start, stop in ((a, b), (b, c), (c, a)):
        contained &= _cross((stop - start)[:, None], points[None] - start[:, None]) >= 0
        contained &= (points[None] != start[:, None]).any(axis=2)
    return contained.any(axis=1)
