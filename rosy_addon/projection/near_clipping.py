"""Clipping of triangles at the near plane."""

from typing import NamedTuple

import numpy as np


class ClippedTriangles(NamedTuple):
    """Triangles after clipping at the near plane.

    Attributes
    ----------
    corners : 3 (K,) int32 ndarrays
        Vertices at the first, second and third corner, as indices into the `vertices` of the result of
        `clip_near`.
    triangle : (K,) int32 ndarray
        Index of the original triangle, in ascending order.
    """

    corners: tuple[np.ndarray, np.ndarray, np.ndarray]
    triangle: np.ndarray


def clip_near(vertices: np.ndarray, triangles: np.ndarray) -> tuple[np.ndarray, ClippedTriangles]:
    """Clip triangles at the near plane, and remove the parts between this plane and the eye.

    Triangles that are wholly between the near plane and the eye, or behind the eye, are left out.

    Parameters
    ----------
    vertices : (V, 4) float64 ndarray
        Clip space. The near plane is z = -w.
    triangles : (T, 3) int32 ndarray
        Indices into `vertices`.

    Returns
    -------
    vertices : (V', 4) float64 ndarray
        The given vertices, followed by the intersections with the near plane.
    clipped : ClippedTriangles
    """
    inside = vertices[:, 2] + vertices[:, 3] >= 0
    a, b, c = np.ascontiguousarray(triangles.T)
    if inside.all():
        return vertices, ClippedTriangles((a, b, c), np.arange(len(triangles), dtype=np.int32))
    count = inside[a].astype(np.int8) + inside[b] + inside[c]
    unclipped = np.flatnonzero(count == 3).astype(np.int32)
    crossing = np.flatnonzero((count == 1) | (count == 2)).astype(np.int32)
    new_vertices, new_corners, new_triangle = _clip_crossing_triangles(
        vertices, triangles, inside, crossing
    )
    triangle = np.concatenate([unclipped, new_triangle])
    order = np.argsort(triangle, kind="stable")
    corners = np.concatenate([triangles[unclipped], new_corners])[order]
    clipped = ClippedTriangles(tuple(np.ascontiguousarray(corners.T)), triangle[order])
    return np.concatenate([vertices, new_vertices]), clipped


def _clip_crossing_triangles(
    vertices: np.ndarray, triangles: np.ndarray, inside: np.ndarray, crossing: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Clip K triangles that cross the near plane, and triangulate the parts beyond the plane.

    In each crossing triangle, one vertex (`apex`) is on one side of the plane and two are on the
    other. If the apex is beyond the plane, a triangle remains, otherwise a quadrilateral.

    Parameters
    ----------
    vertices : (V, 4) float64 ndarray
        Clip space.
    triangles : (T, 3) int32 ndarray
    inside : (V,) bool ndarray
        Whether each vertex is beyond the near plane as seen from the eye, or on it: z >= -w.
    crossing : (K,) int32 ndarray
        Indices of the crossing triangles.

    Returns
    -------
    new_vertices : (2 K, 4) float64 ndarray
        Intersections with the near plane. Their indices begin after the last one of `vertices`.
    corners : (K', 3) int32 ndarray
        Vertex indices of the new triangles.
    triangle : (K',) int32 ndarray
        Index of the original triangle that each new triangle is a part of.
    """
    corners = triangles[crossing]
    sides = inside[corners]
    one_inside = sides.sum(axis=1) == 1
    lone_corner = np.argmax(sides == one_inside[:, None], axis=1)
    rotated_corners = (lone_corner[:, None] + np.arange(3)) % 3
    apex, left, right = np.take_along_axis(corners, rotated_corners, axis=1).T
    new_vertices = [_intersect_near(vertices, apex, end) for end in (left, right)]
    on_left = np.arange(len(crossing), dtype=np.int32) + len(vertices)
    on_right = on_left + len(crossing)
    tip, base = one_inside, ~one_inside
    new_corners = np.concatenate(
        [
            np.stack([apex, on_left, on_right], axis=1)[tip],
            np.stack([on_left, left, right], axis=1)[base],
            np.stack([on_left, right, on_right], axis=1)[base],
        ]
    )
    triangle = np.concatenate([crossing[tip], crossing[base], crossing[base]])
    return np.concatenate(new_vertices), new_corners.astype(np.int32), triangle


def _intersect_near(vertices: np.ndarray, first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Return the (K, 4) intersections of edges with the near plane.

    `vertices` are in clip space. `first` and `second`, (K,), are the indices of the two ends of each edge.
    The result does not depend on their order.
    """
    low, high = vertices[np.minimum(first, second)], vertices[np.maximum(first, second)]
    low_distance, high_distance = low[:, 2] + low[:, 3], high[:, 2] + high[:, 3]
    t = (low_distance / (low_distance - high_distance))[:, None]
    return low + t * (high - low)
