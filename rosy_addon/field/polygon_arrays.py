"""Faces and corners of polygon meshes as flat arrays.

The corners of face f are ``face_start[f] .. face_start[f + 1] - 1``; F is the number of faces, C of corners.
`corner_vertex` is the vertex of each corner.
"""

from __future__ import annotations

import numpy as np

from .frames import dot, normalize

#: Faces or corners processed at once, to bound memory and fit in the CPU caches.
BLOCK_ELEMENTS = 1 << 14


def corner_faces(face_start: np.ndarray) -> np.ndarray:
    """Return (C,) int32, the face of each corner."""
    return np.repeat(np.arange(len(face_start) - 1, dtype=np.int32), np.diff(face_start))


def next_corners(face_start: np.ndarray) -> np.ndarray:
    """Return (C,) int32, the following corner around the same face."""
    following = np.arange(1, face_start[-1] + 1, dtype=np.int32)
    following[face_start[1:] - 1] = face_start[:-1]
    return following


def sum_per_face(values: np.ndarray, face_start: np.ndarray) -> np.ndarray:
    """Return (F, ...) sums of (C, ...) corner values over each face."""
    return np.add.reduceat(values, face_start[:-1], axis=0)


def mean_per_face(values: np.ndarray, face_start: np.ndarray) -> np.ndarray:
    """Return (F, ...) means of (C, ...) corner values over each face."""
    count = np.diff(face_start).reshape((-1,) + (1,) * (values.ndim - 1))
    return sum_per_face(values, face_start) / count


def face_area_vectors(
    vertices: np.ndarray, corner_vertex: np.ndarray, face_start: np.ndarray
) -> np.ndarray:
    """Return (F, 3) area vectors (normal times area) of polygons, by Newell's formula.

    Positions are relative to the first corner of each face, so that no precision is lost far from
    the origin.
    """
    area = np.empty((len(face_start) - 1, 3))
    for faces, corners, starts in face_blocks(face_start):
        points = _relative_to_first_corner(vertices, corner_vertex[corners], starts)
        twice = sum_per_face(np.cross(points, points[next_corners(starts)]), starts)
        np.multiply(twice, 0.5, out=area[faces])
    return area


def _relative_to_first_corner(
    vertices: np.ndarray, corner_vertex: np.ndarray, face_start: np.ndarray
) -> np.ndarray:
    """Return (C, 3) positions of corners relative to the first corner of their face."""
    points = vertices[corner_vertex]
    return points - np.repeat(points[face_start[:-1]], np.diff(face_start), axis=0)


def face_blocks(face_start: np.ndarray) -> list[tuple[slice, slice, np.ndarray]]:
    """Split the faces into consecutive blocks, to bound memory.

    Returns
    -------
    faces, corners : slice
        The faces of the block and their corners.
    starts : (faces + 1,) ndarray
        `face_start` of the block, counted from its first corner.
    """
    count = len(face_start) - 1
    blocks = []
    for first in range(0, count, BLOCK_ELEMENTS):
        faces = slice(first, min(first + BLOCK_ELEMENTS, count))
        starts = face_start[faces.start : faces.stop + 1]
        blocks.append((faces, slice(int(starts[0]), int(starts[-1])), starts - starts[0]))
    return blocks


def sum_per_fan(values: np.ndarray, corner_fan: np.ndarray) -> np.ndarray:
    """Return (K, k) sums of (C, k) real corner values over the corners of each of the K fans."""
    fan_count = int(corner_fan.max()) + 1
    columns = [np.bincount(corner_fan, weights=column, minlength=fan_count) for column in values.T]
    return np.stack(columns, axis=1)


def fan_normals(
    vertices: np.ndarray, corner_vertex: np.ndarray, face_start: np.ndarray, corner_fan: np.ndarray
) -> np.ndarray:
    """Return (C, 3) unit corner normals: face normals averaged over each fan, weighted by corner angle.

    Where the mean is zero, it is the face normal, or (0, 0, 1) if that is zero, too.
    """
    angle = np.empty(len(corner_vertex))
    for _, corners, starts in face_blocks(face_start):
        points = _relative_to_first_corner(vertices, corner_vertex[corners], starts)
        following = next_corners(starts)
        to_next = normalize(points[following] - points)
        to_previous = np.empty_like(to_next)
        to_previous[following] = -to_next
        angle[corners] = np.arccos(np.clip(dot(to_next, to_previous), -1, 1))
    face_normal = normalize(face_area_vectors(vertices, corner_vertex, face_start))
    face = corner_faces(face_start)
    fan_count = int(corner_fan.max()) + 1
    total = [np.bincount(corner_fan, angle * column[face], fan_count) for column in face_normal.T]
    normal = normalize(np.stack(total, axis=1))[corner_fan]
    undefined = ~normal.any(axis=1)
    normal[undefined] = face_normal[face[undefined]]
    normal[~normal.any(axis=1)] = (0.0, 0.0, 1.0)
    return normal


def box_corners(points: np.ndarray) -> np.ndarray:
    """Return (8, 3) corners of the bounding box of (n, 3) points."""
    limits = np.stack([points.min(axis=0), points.max(axis=0)])
    selector = np.indices((2, 2, 2)).reshape(3, 8)
    return np.stack([limits[selector[axis], axis] for axis in range(3)], axis=1)
