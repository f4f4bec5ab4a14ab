"""Find the singularities of a field on faces, and their indices."""

from collections.abc import Sequence

import numpy as np

from ..core.errors import counted
from ..core.progress import report
from .blocks import mask
from .connectivity import connected_corners
from .frames import dot
from .polygon_arrays import face_blocks, next_corners
from .representation import face_representation, is_tie, matching_angles
from .rosy_field import RosyField
from .surface import Surface


def find_singularities(surface: Surface, field: RosyField) -> tuple[np.ndarray, np.ndarray]:
    """Find the singular vertices of a field, and their indices.

    A field on faces is singular at vertices. The rotation of the field around a vertex is the sum
    of the angles between matching members of consecutive faces, plus the angle defect of the
    vertex. It is an integer multiple of 2 pi / N; this integer is the index in units of 1 / N. On a closed
    surface, the indices in these units sum to N times the Euler characteristic (Poincaré-Hopf theorem).

    No index is computed for vertices on a boundary or a nonmanifold edge, next to a face where the field is
    undefined, or where parts of the surface meet that share no edge there.

    Parameters
    ----------
    surface : Surface
    field : RosyField
        Field on the faces of the surface.

    Returns
    -------
    vertex : (K,) int32 ndarray
        Indices of the vertices, in ascending order.
    index : (K,) int32 ndarray
        Singularity indices in units of 1 / N; never 0.
    """
    report(0.0, "counting singularities")
    z = face_representation(surface, field)
    matching = matching_angles(surface, z, field.degree)
    edges, corner_vertex, count = surface.edges, surface.corner_vertex, len(surface.vertices)
    tail, head = corner_vertex[edges.halfedges].T
    report(0.7, "counting singularities")
    # A counter-clockwise loop around the head of an edge crosses the edge from side a to side b. A loop
    # around its tail crosses it from side b to side a.
    angle_sum = np.bincount(head, matching, count) - np.bincount(tail, matching, count)
    defect = 2 * np.pi - np.bincount(corner_vertex, signed_corner_angles(surface), count)
    index = np.rint((angle_sum + defect) * field.degree / (2 * np.pi)).astype(np.int32)

    has_index = mask(count, corner_vertex)
    has_index[edges.ends[~mask(len(edges.ends), edges.interior)]] = False
    has_index[corner_vertex[(z == 0)[surface.corner_face]]] = False
    vertex = np.flatnonzero(has_index & (index != 0)).astype(np.int32)
    vertex = vertex[_fan_counts(surface, vertex) == 1]
    return vertex, index[vertex]


def _fan_counts(surface: Surface, vertex: np.ndarray) -> np.ndarray:
    """Return the (K,) number of groups of faces at each of K vertices. Faces of a group are connected by edges there."""
    is_chosen = mask(len(surface.vertices), vertex)
    a, b = surface.edges.halfedges.T
    tail, head = surface.corner_vertex[a], surface.corner_vertex[b]
    is_near = is_chosen[tail] | is_chosen[head]
    fan = connected_corners(a[is_near], b[is_near], surface.next_corner)
    corner = np.flatnonzero(is_chosen[surface.corner_vertex])
    first = corner[np.unique(fan[corner], return_index=True)[1]]
    return np.bincount(surface.corner_vertex[first], minlength=len(is_chosen))[vertex]


def count_ties(surface: Surface, field: RosyField) -> int:
    """Return the number of edges at which the field turns by half the angle between its members.

    There, two members of the second face match equally well, and the choice between them decides where
    singularities are; see `representation.matching_angles`.
    """
    z = face_representation(surface, field)
    angle = field.degree * matching_angles(surface, z, field.degree)
    defined = (z != 0)[surface.corner_face[surface.edges.halfedges]].all(axis=1)
    return int(np.count_nonzero(is_tie(angle) & defined))


def format_index(index: int, degree: int) -> str:
    """Return the text of a singularity index as a fraction, such as "+1/4", "-1" or "+3/2".

    `index` is in units of 1 / `degree`.
    """
    divisor = int(np.gcd(index, degree))
    numerator, denominator = index // divisor, degree // divisor
    return f"{numerator:+d}" if denominator == 1 else f"{numerator:+d}/{denominator}"


def description(fields: Sequence[tuple[Surface, RosyField]], *, count_singularities: bool) -> str:
    """Return a text for a message: how many singularities and undefined faces some fields have in total.

    Parameters
    ----------
    fields : sequence of (Surface, RosyField)
    count_singularities : bool
        Whether to count singularities, which takes some time.

    Returns
    -------
    str
        A text such as "12 singularities, 3 faces without a direction"; empty if there is nothing to report.
    """
    parts = []
    if count_singularities:
        count = sum(len(find_singularities(*pair)[0]) for pair in fields)
        parts.append(counted(count, "singularity", "singularities"))
    undefined = sum(int((~field.vectors.any(axis=1)).sum()) for _, field in fields)
    if undefined:
        parts.append(f"{counted(undefined, 'face')} without a direction")
    return ", ".join(parts)


def first_pairs(pairs: np.ndarray) -> np.ndarray:
    """Choose pairs greedily, in their order, so that no element is in two chosen pairs.

    Parameters
    ----------
    pairs : (n, 2) int ndarray
        Each row holds the indices of the two elements of a pair.

    Returns
    -------
    (m,) intp ndarray
        Rows of the chosen pairs.
    """
    taken: set[int] = set()
    chosen = []
    for number, pair in enumerate(pairs.tolist()):
        if taken.isdisjoint(pair):
            taken.update(pair)
            chosen.append(number)
    return np.array(chosen, dtype=np.intp)


def signed_corner_angles(surface: Surface) -> np.ndarray:
    """Return (C,) interior angles at the corners of the faces, in radians from 0 to 2 pi.

    Angles are measured in the plane of each face, from the next edge counter-clockwise to the previous edge.
    So concave corners have angles above pi.
    """
    x, y = surface.face_frames
    angles = np.empty(len(surface.corner_vertex))
    for _, corners, starts in face_blocks(surface.face_start):
        points, following = surface.vertices[surface.corner_vertex[corners]], next_corners(starts)
        edge = points[following] - points
        face = surface.corner_face[corners]
        to_next = dot(edge, x[face]) + 1j * dot(edge, y[face])
        to_previous = np.empty_like(to_next)
        to_previous[following] = -to_next
        angles[corners] = np.angle(to_previous * to_next.conj()) % (2 * np.pi)
    return angles
