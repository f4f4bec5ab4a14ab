"""Unfold faces that are folded over their neighbors, which occur in scans, and orient all faces consistently."""

import numpy as np

from .blocks import bincount_rows, mask
from .connectivity import connected_components
from .frames import dot
from .polygon_arrays import face_area_vectors
from .surface import Surface, build_surface

#: Largest number of rounds of unfolding. One is enough for a single face, more for groups of faces.
MAX_ROUNDS = 4

#: Cosine of an angle that is more than 90 degrees by more than rounding errors.
OPPOSITE = -1e-6


def folded_faces(surface: Surface) -> np.ndarray:
    """Return (F,) bool: whether each face is folded over its neighbors.

    The normal of such a face is more than 90 degrees from the normals of most of its neighbors, and from the
    mean normal at each of its vertices. The second condition excludes pointed parts, such as a tetrahedron.
    """
    edges, normal = surface.edges, surface.face_normal
    face_a, face_b = surface.corner_face[edges.halfedges].T
    is_opposite = np.zeros(len(edges.ends), dtype=bool)
    is_opposite[edges.interior] = dot(normal[face_a], normal[face_b]) < OPPOSITE
    count = is_opposite[edges.corner_edge].astype(np.int32)
    is_folded = 2 * np.add.reduceat(count, surface.face_start[:-1]) > np.diff(surface.face_start)
    if not is_folded.any():
        return is_folded
    corner_vertex, corner_face = surface.corner_vertex, surface.corner_face
    vectors = face_area_vectors(surface.vertices, corner_vertex, surface.face_start)[corner_face]
    total = bincount_rows(corner_vertex, vectors, len(surface.vertices))
    size = np.bincount(corner_vertex, np.sqrt(dot(vectors, vectors)), len(total))
    is_against = dot(total[corner_vertex], normal[corner_face]) < OPPOSITE * size[corner_vertex]
    return is_folded & np.logical_and.reduceat(is_against, surface.face_start[:-1])


def unfolded(surface: Surface) -> Surface:
    """Return the surface without folded faces, and oriented consistently.

    If nothing has to change, the result is `surface` itself. In each orientable part, faces that are oriented against
    the majority are reversed. The vertices of folded faces move to the mean of their neighbors. Faces keep their
    numbers; the corners of reversed faces are numbered in the opposite order.
    """
    start, face = surface.face_start, surface.corner_face
    is_reversed = _reversed_faces(surface)
    if is_reversed.any():
        corner = np.arange(len(face))
        corner = np.where(is_reversed[face], start[face] + start[face + 1] - 1 - corner, corner)
        corner_vertex = surface.corner_vertex[corner]
        surface = build_surface(surface.vertices, corner_vertex, start, name=surface.name)
    for _ in range(MAX_ROUNDS):
        is_folded = folded_faces(surface)
        if not is_folded.any():
            break
        ends, vertices = surface.edges.ends, surface.vertices
        tail, head = np.concatenate([ends, ends[:, ::-1]]).T
        mean = bincount_rows(tail, vertices[head], len(vertices))
        mean /= np.maximum(np.bincount(tail, minlength=len(mean)), 1)[:, None]
        is_moved = mask(len(vertices), surface.corner_vertex[is_folded[face]])
        vertices = np.where(is_moved[:, None], mean, vertices)
        surface = build_surface(vertices, surface.corner_vertex, start, name=surface.name)
    return surface


def _reversed_faces(surface: Surface) -> np.ndarray:
    """Return (F,) bool: whether each face has the opposite orientation of most faces of its part.

    A part is a set of faces that are connected by edges with two faces. Nonorientable parts are not changed.
    """
    edges, count = surface.edges, surface.face_count
    is_pair = edges.face_count == 2
    is_inconsistent = is_pair & ~mask(len(edges.ends), edges.interior)
    if not is_inconsistent.any():
        return np.zeros(count, dtype=bool)
    by_edge = np.argsort(edges.corner_edge, kind="stable")
    first = (np.cumsum(edges.face_count) - edges.face_count)[is_pair]
    a, b = surface.corner_face[by_edge[np.stack([first, first + 1])]]
    # Node f is face f as it is, and node f + count the reversed face. Consistent pairs are connected.
    other = b + np.where(is_inconsistent[is_pair], count, 0)
    pairs = np.stack([[a, (a + count)], [other, (other + count) % (2 * count)]], axis=-1)
    side, other_side = connected_components(2 * count, pairs.reshape(-1, 2)).reshape(2, count)
    size = np.bincount(side, minlength=other_side.max() + 1)
    # Of two halves, the one with the first face keeps its orientation.
    is_second = (size[side] == size[other_side]) & (side > other_side)
    return is_second | (size[side] < size[other_side])
