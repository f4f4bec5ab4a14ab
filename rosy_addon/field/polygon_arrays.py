"""Faces and corners of polygon meshes as flat arrays.

The corners of face f are ``face_start[f] .. face_start[f + 1] - 1``. `corner_vertex` holds the vertex of each
corner. F is the number of faces, and C is the number of corners.
"""

import numpy as np

from .blocks import bincount_rows
from .frames import dot, normalize

#: Number of faces or corners that are processed at once, to bound memory and to fit in the CPU caches.
BLOCK_ELEMENTS = 1 << 14


def corner_faces(face_start: np.ndarray) -> np.ndarray:
    """Return the face of each corner, as (C,) int32."""
    return np.repeat(np.arange(len(face_start) - 1, dtype=np.int32), np.diff(face_start))


def next_corners(face_start: np.ndarray) -> np.ndarray:
    """Return the next corner of the same face for each corner, as (C,) int32."""
    following = np.arange(1, face_start[-1] + 1, dtype=np.int32)
    following[face_start[1:] - 1] = face_start[:-1]
    return following


def sum_per_face(values: np.ndarray, face_start: np.ndarray) -> np.ndarray:
    """Return (F, ...) sums of (C, ...) corner values over the corners of each face."""
    return np.add.reduceat(values, face_start[:-1], axis=0)


def mean_per_face(values: np.ndarray, face_start: np.ndarray) -> np.ndarray:
    """Return (F, ...) means of (C, ...) corner values over the corners of each face."""
    count = np.diff(face_start).reshape((-1,) + (1,) * (values.ndim - 1))
    return sum_per_face(values, face_start) / count


def face_area_vectors(
    vertices: np.ndarray, corner_vertex: np.ndarray, face_start: np.ndarray
) -> np.ndarray:
    """Return (F, 3) area vectors (normal times area) of polygons, by Newell's formula.

    They are computed from positions relative to the first corner of each face, so that no precision is lost
    far from the origin.
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
    """Split the faces of a mesh into consecutive blocks, to bound memory.

    Returns
    -------
    list of (faces, corners, starts)
        One tuple for each block. `faces` and `corners` are slices of the faces of the block and of their
        corners. `starts` is `face_start` for the faces of the block, where corners are counted from the first
        one of the block.
    """
    count = len(face_start) - 1
    blocks = []
    for first in range(0, count, BLOCK_ELEMENTS):
        faces = slice(first, min(first + BLOCK_ELEMENTS, count))
        starts = face_start[faces.start : faces.stop + 1]
        blocks.append((faces, slice(int(starts[0]), int(starts[-1])), starts - starts[0]))
    return blocks


def fan_normals(
    vertices: np.ndarray, corner_vertex: np.ndarray, face_start: np.ndarray, corner_fan: np.ndarray
) -> np.ndarray:
    """Return (C, 3) unit corner normals: face normals averaged over smooth fans, weighted by corner angle.

    A smooth fan is a set of corners at a vertex that share a normal; `corner_fan` holds the (C,) index of the
    fan of each corner. Where the mean is zero, the corner normal is the face normal or, if that is zero too,
    (0, 0, 1).
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
    normal = normalize(bincount_rows(corner_fan, angle[:, None] * face_normal[face]))[corner_fan]
    undefined = ~normal.any(axis=1)
    normal[undefined] = face_normal[face[undefined]]
    normal[~normal.any(axis=1)] = (0.0, 0.0, 1.0)
    return normal


def box_corners(points: np.ndarray) -> np.ndarray:
    """Return the (8, 3) corners of the bounding box of (n, 3) points."""
    limits = np.stack([points.min(axis=0), points.max(axis=0)])
    return limits[np.indices((2, 2, 2)).reshape(3, 8).T, np.arange(3)]
