"""Directions to follow, from what is at hand.

The borders and sharp edges of a mesh or any edges of it, strokes drawn on it, its UV maps, and
axes set up beside it.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..errors import RosyError
from .frames import dot, unit
from .nearest import nearest_triangles
from .representation import complex_sums, face_frames, from_representation, to_representation
from .surface import Surface, mean_over_faces, sum_over_faces, surface_edges

#: Points of strokes that are farther from the surface, as a share of its size, do not count.
AWAY = 0.05


def along_edges(surface: Surface, ends: np.ndarray, degree: int) -> np.ndarray:
    """Guides on the faces that have some edges, along these.

    Parameters
    ----------
    surface : Surface
    ends : (E, 2) int ndarray
        Pairs of vertices, in any order; those that are no edge of the mesh do not count.
    degree : int
        Of the field: where a face has several of the edges, it gets the mean of their RoSys, which
        is zero if they contradict each other. Of odd degrees, edges point the way that the face
        goes around them.

    Returns
    -------
    (F, 3) float64 ndarray
        Unit, or zero.
    """
    tail = surface.corner_vertex.astype(np.int64)
    head = tail[surface.next_corner]
    span = len(surface.vertices)
    ends = np.sort(np.asarray(ends, dtype=np.int64).reshape(-1, 2), axis=1)
    key = np.minimum(tail, head) * span + np.maximum(tail, head)
    corner = np.flatnonzero(np.isin(key, ends[:, 0] * span + ends[:, 1]))
    face = surface.corner_face[corner]
    edge = unit(surface.vertices[head[corner]] - surface.vertices[tail[corner]])
    # In the plane of a face that is not flat an edge is shorter, but counts no less.
    edge -= dot(edge, surface.face_normal[face])[:, None] * surface.face_normal[face]
    return mean_guides(surface, face, unit(edge), degree)


def feature_edges(surface: Surface, angle: float) -> np.ndarray:
    """(E, 2) int32: the ends of edges on the border, and of those where the surface bends sharply.

    Parameters
    ----------
    surface : Surface
    angle : float
        Radians between the normals of two faces that meet at a sharp edge, at least.
    """
    edges = surface_edges(surface.corner_vertex, surface.face_start)
    chosen = np.ones(len(edges.ends), dtype=bool)
    chosen[edges.inner] = False
    normal = surface.face_normal
    one, other = (normal[surface.corner_face[side]] for side in edges.sides.T)
    # Faces without area have no normal, and no angle with others.
    bend = np.arccos(np.clip(dot(one, other), -1, 1))
    sharp = (bend >= angle) & one.any(axis=1) & other.any(axis=1)
    chosen[edges.inner[sharp]] = True
    return edges.ends[chosen]


def along_strokes(surface: Surface, strokes: Sequence[np.ndarray], degree: int) -> np.ndarray:
    """Guides on the faces that strokes drawn on the surface pass, along these.

    Parameters
    ----------
    surface : Surface
    strokes : sequence of (n, 3) float ndarray
        Points in object space, in the order in which they were drawn. Trembling finer than the
        mesh's edges is smoothed away.
    degree : int
        Of the field: where strokes cross, a face gets the mean of their RoSys.

    Returns
    -------
    (F, 3) float64 ndarray
        Unit, or zero.

    Raises
    ------
    RosyError
        If no stroke comes near the surface.
    """
    corners = surface.vertices[surface.corner_vertex]
    edge = corners[surface.next_corner] - corners
    spacing = 0.5 * float(np.sqrt(dot(edge, edge)).mean())
    points, ways = [np.zeros((0, 3))], [np.zeros((0, 3))]
    for stroke in strokes:
        place, way = _evenly(np.asarray(stroke, dtype=np.float64).reshape(-1, 3), spacing)
        points.append(place)
        ways.append(way)
    point, way = np.concatenate(points), np.concatenate(ways)
    if len(point):
        triangle, distance = nearest_triangles(surface, point)
        near = distance <= AWAY * surface.size
        face, way = surface.triangle_face[triangle[near]], way[near]
    if not len(point) or not len(face):
        raise RosyError(f"{surface.name}: no stroke comes near it")
    return mean_guides(surface, face, way, degree)


def along_handles(
    surface: Surface, place: np.ndarray, axis: np.ndarray, radius: np.ndarray, degree: int
) -> np.ndarray:
    """Guides around some points, along an axis each, projected to the surface.

    Parameters
    ----------
    surface : Surface
    place, axis : (K, 3) float ndarray
        Object space.
    radius : (K,) float ndarray
        How far from its point each one guides; the nearest face it always does.
    degree : int

    Returns
    -------
    (F, 3) float64 ndarray
        Unit, or zero.
    """
    face, way = [], []
    nearest = surface.triangle_face[nearest_triangles(surface, place)[0]]
    for point, along, reach, first in zip(place, axis, radius, nearest, strict=True):
        off = surface.face_centre - point
        within = np.flatnonzero(dot(off, off) <= reach**2)
        within = within if len(within) else np.array([first])
        face.append(within)
        way.append(np.tile(along, (len(within), 1)))
    return mean_guides(surface, np.concatenate(face), np.concatenate(way), degree)


def along_uv(surface: Surface, uv: np.ndarray, degree: int) -> np.ndarray:
    """Guides along the axes of a UV map, the way in which u grows.

    Parameters
    ----------
    surface : Surface
    uv : (C, 2) float ndarray
        Of each corner.
    degree : int
        A multiple of 4 follows both axes alike: the rotation nearest to the map. Others follow u.

    Returns
    -------
    (F, 3) float64 ndarray
        Unit; zero on faces whose map has no area.
    """
    x, y = face_frames(surface)
    face = surface.corner_face
    offset = surface.vertices[surface.corner_vertex] - surface.face_centre[face]
    place = dot(offset, x[face]) + 1j * dot(offset, y[face])
    middle = mean_over_faces(np.asarray(uv, dtype=np.float64), surface.face_start)
    u, v = (np.asarray(uv, dtype=np.float64) - middle[face]).T
    # The linear map from (u, v) to the face that fits its corners best: least squares.
    uu, uv_, vv = (sum_over_faces(product, surface.face_start) for product in (u * u, u * v, v * v))
    up, vp = (sum_over_faces(part * place, surface.face_start) for part in (u, v))
    area = uu * vv - uv_**2
    flat = area <= 1e-12 * np.maximum(uu * vv, 1e-300)
    along_u, along_v = vv * up - uv_ * vp, uu * vp - uv_ * up
    if degree % 4 == 0:
        # Of a mirrored map the other axis is turned over.
        mirrored = (np.conj(along_u) * along_v).imag < 0
        size = np.maximum(np.abs(along_u), 1e-300), np.maximum(np.abs(along_v), 1e-300)
        along_u = along_u / size[0] - 1j * np.where(mirrored, -1, 1) * along_v / size[1]
    size = np.abs(along_u)
    along_u = np.where(flat | (size == 0), 0, along_u / np.where(size > 0, size, 1))
    return along_u.real[:, None] * x + along_u.imag[:, None] * y


def mean_guides(surface: Surface, face: np.ndarray, vectors: np.ndarray, degree: int) -> np.ndarray:
    """(F, 3) unit members of the mean RoSy of (n, 3) vectors on (n,) faces; zero where none is.

    Vectors are projected to their face, and count by what is left of their length.
    """
    x, y = face_frames(surface)
    z = to_representation(vectors, x[face], y[face], degree)
    total = complex_sums(face, z, surface.face_count)
    most = np.bincount(face, np.abs(z), surface.face_count)
    known = np.abs(total) > 1e-6 * np.where(most > 0, most, np.inf)
    total = np.divide(total, np.abs(total), out=np.zeros_like(total), where=known)
    return from_representation(total, x, y, degree)


def _evenly(stroke: np.ndarray, spacing: float) -> tuple[np.ndarray, np.ndarray]:
    """Places along a stroke, so far apart, and its unit direction around each."""
    step = np.sqrt((np.diff(stroke, axis=0) ** 2).sum(axis=1))
    stroke = stroke[np.concatenate([[True], step > 0])] if len(stroke) else stroke
    step = step[step > 0]
    if not len(step):
        return np.zeros((0, 3)), np.zeros((0, 3))
    length = np.concatenate([[0], np.cumsum(step)])
    count = max(int(length[-1] / spacing), 1)
    middle = (np.arange(count) + 0.5) * (length[-1] / count)

    def at(distance: np.ndarray) -> np.ndarray:
        return np.stack([np.interp(distance, length, column) for column in stroke.T], axis=1)

    return at(middle), unit(at(middle + spacing) - at(middle - spacing))
