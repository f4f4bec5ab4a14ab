"""Polygons cut into triangles, without a loop over the faces."""

from __future__ import annotations

import numpy as np


def triangulate(
    vertices: np.ndarray, corner_vertex: np.ndarray, face_start: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Cut every face into triangles, k - 2 for a face of k corners, in the order of the faces.

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
    """
    size = np.diff(face_start)
    count = size - 2
    triangle_face = np.repeat(np.arange(len(size), dtype=np.int32), count)
    first_triangle = np.cumsum(count) - count
    step = np.arange(len(triangle_face), dtype=np.int32) - first_triangle[triangle_face]
    first = face_start[triangle_face]
    triangles = np.stack([first, first + step + 1, first + step + 2], axis=1)
    return triangles.astype(np.int32), triangle_face
