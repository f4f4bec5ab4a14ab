"""Vectors stored by component: arithmetic, and normals, angles and frames of polygons.

Vectors are three contiguous arrays: their x, y and z components. The corners of n polygons with the
same number of corners are given relative to the first one (`relative_to_first`).
"""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from ..core.deterministic_trig import vector_angle
from ..field.frames import dot_components

#: Vectors as three (n,) arrays: their x, y and z components.
VectorComponents = Sequence[np.ndarray]


def cross_components(a: VectorComponents, b: VectorComponents) -> list[np.ndarray]:
    """Return the components of the cross products of vectors."""
    return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]


def subtract_components(a: VectorComponents, b: VectorComponents) -> list[np.ndarray]:
    """Return the components of a - b."""
    return [component_a - component_b for component_a, component_b in zip(a, b, strict=True)]


def normalize_components(vectors: VectorComponents) -> list[np.ndarray]:
    """Scale vectors to length 1. Zero vectors stay zero."""
    length = np.sqrt(dot_components(vectors, vectors))
    length[length == 0] = np.inf
    return [component / length for component in vectors]


def cofactor_matrix(linear: np.ndarray) -> np.ndarray:
    """Return the (3, 3) cofactor matrix of a linear map L: det(L) times its inverse transpose.

    It transforms normals correctly, even if L mirrors or is singular.
    """
    a, b, c = linear
    return np.array([np.cross(b, c), np.cross(c, a), np.cross(a, b)])


def relative_to_first(
    points: np.ndarray, corner_vertex: Sequence[np.ndarray]
) -> list[list[np.ndarray]]:
    """Return the positions of the corners of faces relative to the first corner of each face.

    The first corner itself is left out.

    Parameters
    ----------
    points : (3, V) ndarray
    corner_vertex : sequence of (n,) ndarray of int
        Vertex of each corner, for n faces.

    Returns
    -------
    list of lists of 3 (n,) ndarrays
        Components of the vectors from corner 0 to the corners 1, 2 and so on.
    """
    origin = [component.take(corner_vertex[0]) for component in points]
    corners = ([component.take(vertex) for component in points] for vertex in corner_vertex[1:])
    return [subtract_components(corner, origin) for corner in corners]


def polygon_normals(points: Sequence[VectorComponents]) -> list[np.ndarray]:
    """Return the unit normals of polygons.

    A normal is the normalized sum of the area vectors of a triangle fan. It is zero for a polygon
    without area. `points` are the corners as returned by `relative_to_first`.
    """
    area_vector = cross_components(points[0], points[1])
    for first, second in pairwise(points[1:]):
        for total, component in zip(area_vector, cross_components(first, second), strict=True):
            total += component
    return normalize_components(area_vector)


def frame_coordinates(vectors: VectorComponents, frame: Sequence[VectorComponents]) -> np.ndarray:
    """Return the (n,) complex coordinates v.x + i v.y of vectors v in a frame of unit tangents, x and y."""
    x, y = frame
    return dot_components(vectors, x) + 1j * dot_components(vectors, y)


def plane_coordinates(
    points: Sequence[VectorComponents], frame: Sequence[VectorComponents]
) -> list[np.ndarray]:
    """Return the corners of polygons as `frame_coordinates`, relative to their mean.

    `points` are the corners as returned by `relative_to_first`, without the first corner of each polygon.
    The result includes the first corner.
    """
    coordinates = [frame_coordinates(point, frame) for point in points]
    mean = sum(coordinates) / (len(coordinates) + 1)
    return [-mean, *(point - mean for point in coordinates)]


def polygon_angles(points: Sequence[VectorComponents]) -> list[np.ndarray]:
    """Return the interior angles of n polygons with k corners, in radians: k (n,) float32 ndarrays.

    `points` are the corners as returned by `relative_to_first`.
    """
    edges = [points[0]]
    edges += [subtract_components(after, before) for before, after in pairwise(points)]
    edges.append([-component for component in points[-1]])
    corners = list(zip(edges, edges[-1:] + edges[:-1], strict=True))
    if len(corners) > 3:
        return [
            _edge_angle(after, before, cross_components(before, after)) for after, before in corners
        ]
    area_vector = cross_components(edges[0], edges[1])
    angle_0, angle_1 = (_edge_angle(after, before, area_vector) for after, before in corners[:2])
    return [angle_0, angle_1, np.maximum(np.float32(np.pi) - angle_0 - angle_1, 0)]


def _edge_angle(
    next_edge: VectorComponents, previous_edge: VectorComponents, cross_product: VectorComponents
) -> np.ndarray:
    """Return the angle between the edge after a corner and the reversed edge before it, in radians.

    `cross_product` is the cross product of the two edges; only its length is used.
    """
    cross_length = np.sqrt(dot_components(cross_product, cross_product))
    dot_product = dot_components(next_edge, previous_edge)
    larger = np.maximum(cross_length, np.abs(dot_product))
    larger[larger == 0] = 1
    cross_length /= larger
    dot_product /= -larger
    return vector_angle(dot_product.astype(np.float32), cross_length.astype(np.float32))
