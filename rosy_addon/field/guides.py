"""Directions to follow, from what a mesh has: its borders, its sharp edges, any edges of it."""

from __future__ import annotations

import numpy as np

from .frames import dot, unit
from .representation import complex_sums, face_frames, from_representation, to_representation
from .surface import Surface, surface_edges


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
    x, y = face_frames(surface)
    # In the plane of a face that is not flat an edge is shorter, but counts no less.
    edge -= dot(edge, surface.face_normal[face])[:, None] * surface.face_normal[face]
    z = to_representation(unit(edge), x[face], y[face], degree)
    total = complex_sums(face, z, surface.face_count)
    size = np.abs(total)
    total = np.divide(total, size, out=np.zeros_like(total), where=size > 1e-6)
    return from_representation(total, x, y, degree)


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
