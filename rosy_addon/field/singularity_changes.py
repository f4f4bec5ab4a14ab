"""Change singularities of a field: move them by hand, and cancel pairs with opposite indices."""

from __future__ import annotations

import numpy as np

from ..core.errors import RosyError
from ..core.progress import progress, report
from .blocks import concatenated_ranges, mask, neighbors_of_nodes
from .prescribed import TurningError, change_singularities
from .rosy_field import RosyField
from .singularities import find_singularities, first_pairs
from .surface import Surface

#: Value for "no vertex": an index that is moved there leaves the surface across a border.
OUTSIDE = -1

#: Smallest distance over which a change of the directions falls off, relative to `Surface.extent`.
MIN_REACH = 0.01

#: Text that is shown with the progress bar.
LABEL = "pairing singularities"


def move_index(
    surface: Surface, field: RosyField, source: int, target: int, index: int = 0, reach: float = 0.0
) -> RosyField:
    """Return the field with a singularity index moved from one vertex to another.

    All edits of singularities by hand are such moves. A singularity that is moved onto another one adds its
    index to that one, so opposite indices cancel. Moving an index away from a vertex that is not singular
    leaves the opposite index there, which creates a pair. Moving a part of an index splits a singularity.

    Parameters
    ----------
    surface : Surface
    field : RosyField
        A field whose directions are rotationally symmetric.
    source, target : int
        Vertices. `OUTSIDE` instead of a vertex means that the index enters or leaves over the border.
    index : int
        Index to move, in units of 1 / N; 0 for the whole index of `source`.
    reach : float
        Distance over which the change of direction falls off, in object space. If the two vertices are
        farther apart, it is the distance between them.

    Returns
    -------
    RosyField
        The new field. All other singularities are the same.

    Raises
    ------
    RosyError
        If the directions are not a RoSy, if both vertices are the same, if one of them cannot be singular (at
        a border, for example), if `source` has no index to move, or if one of them is `OUTSIDE` and the
        surface is closed.
    TurningError
        If the field would turn by pi / N or more between two faces; smaller faces would allow the move.
    """
    field.check_rosy(surface.name)
    if source == target:
        raise RosyError(
            f"{surface.name}: vertex {source} is both source and target: choose another target"
        )
    if index == 0:
        with progress(0.0, 0.2):
            vertex, indices = find_singularities(surface, field)
        index = int(indices[vertex == source].sum())
        if index == 0:
            raise RosyError(
                f"{surface.name}: vertex {source} is not singular: choose a singular vertex, or give the index "
                "to move"
            )
    ends = np.array([source, target])
    is_vertex = ends != OUTSIDE
    change = np.array([-index, index])[is_vertex]
    reach = max(reach, _distance(surface, ends), MIN_REACH * surface.extent)
    with progress(0.2, 1.0):
        return change_singularities(surface, field, ends[is_vertex], change, reach)


def _distance(surface: Surface, ends: np.ndarray) -> float:
    """Return the straight-line distance between two vertices, in object space.

    It is 0 if one of them is `OUTSIDE` or not in the mesh.
    """
    if (ends < 0).any() or (ends >= len(surface.vertices)).any():
        return 0.0
    return float(np.linalg.norm(np.diff(surface.vertices[ends].astype(np.float64), axis=0)))


def cancel_pairs(surface: Surface, field: RosyField, max_distance: float) -> RosyField:
    """Return the field without nearby pairs of singularities that have opposite indices.

    Directions change most near a removed pair, and less with the distance from it. All other singularities
    stay. A pair is kept if the field without it would turn by pi / N or more between two faces.

    Parameters
    ----------
    surface : Surface
    field : RosyField
        A field whose directions are rotationally symmetric.
    max_distance : float
        Largest length of the shortest path along edges between the vertices of a pair, in object space.

    Returns
    -------
    RosyField
        The new field; the same object if it has no such pairs.

    Raises
    ------
    RosyError
        If the directions are not a RoSy.
    """
    field.check_rosy(surface.name)
    with progress(0.0, 0.2):
        vertex, index = find_singularities(surface, field)
    with progress(0.2, 0.4):
        pairs = opposite_pairs(surface, vertex, index, max_distance)
    start = 0.4
    while len(pairs):
        chosen = pairs.ravel()
        try:
            with progress(start, 1.0):
                return change_singularities(
                    surface, field, vertex[chosen], -index[chosen], max_distance
                )
        except TurningError as error:
            pairs = pairs[~_are_near(surface, vertex[pairs], error.vertices)]
        start = 0.5 * (start + 1.0)
    return field


def _are_near(surface: Surface, pairs: np.ndarray, vertices: np.ndarray) -> np.ndarray:
    """Return (P,) bool: which of the (P, 2) pairs of vertices are nearest to the given other vertices.

    The distance of a pair is the number of rings of faces from the given vertices to the nearer vertex of the
    pair. All pairs with the smallest distance are marked.
    """
    is_near = mask(len(surface.vertices), vertices)
    corner_vertex, corner_face = surface.corner_vertex, surface.corner_face
    while not is_near[pairs].any():
        touches = mask(surface.face_count, corner_face[is_near[corner_vertex]])
        before = int(is_near.sum())
        is_near[corner_vertex[touches[corner_face]]] = True
        if int(is_near.sum()) == before:
            return np.ones(len(pairs), dtype=bool)
    return is_near[pairs].any(axis=1)


def opposite_pairs(
    surface: Surface, vertex: np.ndarray, index: np.ndarray, max_distance: float
) -> np.ndarray:
    """Find pairs of nearby singularities with opposite indices. The nearest ones are paired first.

    Parameters
    ----------
    surface : Surface
    vertex, index : (K,) int ndarray
        Vertices and indices of the singularities.
    max_distance : float
        Largest length of the shortest path along edges between the vertices of a pair, in object space.

    Returns
    -------
    (P, 2) intp ndarray
        Each row holds the positions in `vertex` of the two singularities of a pair. Each singularity is in at
        most one pair.
    """
    first, second, distance = _near(surface, vertex, max_distance)
    is_opposite = (first < second) & (index[first] == -index[second])
    order = np.flatnonzero(is_opposite)[np.argsort(distance[is_opposite], kind="stable")]
    pairs = np.stack([first[order], second[order]], axis=1)
    return pairs[first_pairs(pairs)]


def _near(
    surface: Surface, vertex: np.ndarray, max_distance: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Find all pairs of the given vertices that are at most `max_distance` apart, along edges.

    Returns
    -------
    first, second : (n,) intp ndarray
        Positions in `vertex` of the two vertices of each pair.
    distance : (n,) float64 ndarray
        Length of the shortest path along edges between them.
    """
    ends = surface.edges.ends
    count = len(surface.vertices)
    length = np.linalg.norm(surface.vertices[ends[:, 0]] - surface.vertices[ends[:, 1]], axis=1)
    near = length <= max_distance
    start, neighbor, order = neighbors_of_nodes(count, *ends[near].T)
    neighbor, length = neighbor.astype(np.int64), np.tile(length[near], 2)[order]
    # Extend the paths from all sources by one edge at a time. A state is a pair of a source and a vertex.
    state = np.arange(len(vertex), dtype=np.int64) * count + vertex
    distance = np.zeros(len(vertex))
    known_state, known_distance = state, distance
    while len(state):
        report(0.5, LABEL)
        source, place = np.divmod(state, count)
        counts = start[place + 1] - start[place]
        entry = concatenated_ranges(start[place], counts)
        reached = np.repeat(distance, counts) + length[entry]
        following = np.repeat(source, counts) * count + neighbor[entry]
        is_near = reached <= max_distance
        reached, following = reached[is_near], following[is_near]
        # Keep the shortest path to each state, if it is shorter than before.
        order = np.lexsort((reached, following))
        following, kept = np.unique(following[order], return_index=True)
        reached = reached[order][kept]
        place = np.minimum(np.searchsorted(known_state, following), len(known_state) - 1)
        is_known = known_state[place] == following
        improves = ~is_known | (reached < known_distance[place])
        known_distance[place[is_known & improves]] = reached[is_known & improves]
        state, distance = following[improves], reached[improves]
        is_new = ~is_known
        known_state = np.concatenate([known_state, following[is_new]])
        known_distance = np.concatenate([known_distance, reached[is_new]])
        order = np.argsort(known_state, kind="stable")
        known_state, known_distance = known_state[order], known_distance[order]
    position = np.full(count, -1)
    position[vertex] = np.arange(len(vertex))
    source, place = np.divmod(known_state, count)
    is_singular = position[place] >= 0
    return source[is_singular], position[place[is_singular]], known_distance[is_singular]
