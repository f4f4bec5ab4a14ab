"""Where a field's direction is undefined, and how it turns around there."""

from __future__ import annotations

import numpy as np

from .frames import dot
from .representation import face_frames, matching_angles, to_representation
from .rosy_field import RosyField
from .surface import Surface, surface_edges


def euler_characteristic(surface: Surface) -> int:
    """V - E + F over the vertices that faces use: 2 for a sphere, 0 for a torus."""
    edges = surface_edges(surface.corner_vertex, surface.face_start)
    used = len(np.unique(surface.corner_vertex))
    return used - len(edges.uses) + surface.face_count


def singularities(surface: Surface, field: RosyField) -> tuple[np.ndarray, np.ndarray]:
    """The vertices around which the field does not close up smoothly, and their indices.

    A field on faces is singular at vertices. Around one, the members turn by the sum of the
    angles from each face's member to the matching one of the next face, plus the angle that the
    surface lacks there; this is a whole multiple of 2 pi / N. On a closed surface the indices sum
    to N times the Euler characteristic (Poincare and Hopf).

    Vertices on a boundary or on an edge that is not manifold have no index, nor do those that
    touch a face where the field is undefined.

    Parameters
    ----------
    surface : Surface
    field : RosyField
        On its faces.

    Returns
    -------
    vertex : (K,) int32 ndarray
        In ascending order.
    index : (K,) int32 ndarray
        In units of 1 / N, not 0.
    """
    x, y = face_frames(surface)
    z = to_representation(field.vectors, x, y, field.degree)
    edges = surface_edges(surface.corner_vertex, surface.face_start)
    a, b = edges.sides[:, 0], edges.sides[:, 1]
    matching = matching_angles(surface, x, y, z, field.degree, a, b)
    count = len(surface.vertices)
    tail, head = surface.corner_vertex[a], surface.corner_vertex[b]
    # Counter-clockwise around its head an edge is crossed from side a to side b, around its tail
    # from b to a.
    turning = np.bincount(head, matching, count) - np.bincount(tail, matching, count)
    corner = surface.corner_vertex
    lacking = 2 * np.pi - np.bincount(corner, _signed_corner_angles(surface, x, y), count)
    turning = turning + lacking
    index = np.rint(turning * field.degree / (2 * np.pi)).astype(np.int32)

    whole = np.zeros(count, dtype=bool)
    whole[corner] = True
    open_edges = np.ones(len(edges.uses), dtype=bool)
    open_edges[edges.inner] = False
    whole[edges.ends[open_edges].ravel()] = False
    whole[corner[(z == 0)[surface.corner_face]]] = False
    vertex = np.flatnonzero(whole & (index != 0)).astype(np.int32)
    return vertex, index[vertex]


def _signed_corner_angles(surface: Surface, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """(C,) interior angles measured in each face's own plane, from 0 to 2 pi."""
    points = surface.vertices[surface.corner_vertex]
    edge = points[surface.next_corner] - points
    face = surface.corner_face
    ahead = dot(edge, x[face]) + 1j * dot(edge, y[face])
    behind = np.empty_like(ahead)
    behind[surface.next_corner] = -ahead
    return np.angle(behind * ahead.conj()) % (2 * np.pi)
