"""Change singularities of a field: move them by hand, and cancel pairs with opposite indices."""

from __future__ import annotations

import numpy as np

from ..core.errors import RosyError
from ..core.progress import progress, report
from .blocks import concatenated_ranges, mask, neighbors_of_nodes
from .connectivity import build_edges
from .prescribed import TurningError, change_singularities
from .rosy_field import RosyField
from .singularities import find_singularities, first_pairs
from .surface import Surface

#: Instead of a vertex: an index that is moved there leaves the surface across a border.
OUTSIDE = -1

#: Least distance over which the change falls off, relative to `Surface.extent`.
MIN_REACH = 0.01

#: Label of the progress.
LABEL = "pairing singularities"


def move_index(
    surface: Surface, field: RosyField, source: int, target: int, index: int = 0, reach: float = 0.0
) -> RosyField:
    """Move a singularity index from one vertex to another.

    All ways to edit singularities by hand are such moves. The index of a singularity that is moved onto
    another one is added to it, so that opposite ones vanish. An index that is moved from a vertex without
    one leaves its opposite there: a new pair. A part of an index splits a singularity.

    Parameters
    ----------
    surface : Surface
    field : RosyField
        A RoSy.
    source, target : int
        Vertices. `OUTSIDE` stands for none, on a surface with a border.
    index : int
        What is moved, in units of 1 / N. 0 is all that `source` has.
    reach : float
        Distance over which the change of direction falls off, in object space. The distance between the
        vertices is used if that is larger.

    Returns
    -------
    RosyField
        A field with the same other singularities.

    Raises
    ------
    RosyError
        If the directions are not a RoSy, both vertices are the same, a vertex can have no index or has
        none to move, or nothing can leave the surface because it is closed.
    TurningError
        If the field would turn too fast for the size of the faces.
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
    """Return the distance between two vertices; 0 if one is `OUTSIDE`, or not in the mesh."""
    if (ends < 0).any() or (ends >= len(surface.vertices)).any():
        return 0.0
    return float(np.linalg.norm(np.diff(surface.vertices[ends].astype(np.float64), axis=0)))


def cancel_pairs(surface: Surface, field: RosyField, max_distance: float) -> RosyField:
    """Remove pairs of singularities with opposite indices.

    Far from them, the field turns by an angle that falls with the distance. All other singularities stay, and
    so do pairs without which the field would turn too fast for the size of the faces.

    Parameters
    ----------
    surface : Surface
    field : RosyField
        A RoSy.
    max_distance : float
        Largest length of a path along edges between the two of a pair, in object space.

    Returns
    -------
    RosyField
        The field itself if it has no such pairs.

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
    """Return (P,) bool, which (P, 2) pairs of vertices are the fewest faces away from other vertices."""
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
    """Pair singularities with opposite indices, the nearest ones first.

    Parameters
    ----------
    surface : Surface
    vertex, index : (K,) int ndarray
        The singularities.
    max_distance : float
        Largest length of a path along edges between the two of a pair, in object space.

    Returns
    -------
    (P, 2) intp ndarray
        Pairs of positions in `vertex`; each occurs once at most.
    """
    first, second, distance = _near(surface, vertex, max_distance)
    is_opposite = (first < second) & (index[first] == -index[second])
    order = np.flatnonzero(is_opposite)[np.argsort(distance[is_opposite], kind="stable")]
    pairs = np.stack([first[order], second[order]], axis=1)
    return pairs[first_pairs(pairs)]


def _near(
    surface: Surface, vertex: np.ndarray, max_distance: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Find which of some vertices are near to each other.

    Returns
    -------
    first, second : (n,) intp ndarray
        Positions in `vertex`.
    distance : (n,) float64 ndarray
        Length of the shortest path along edges.
    """
    ends = build_edges(surface.corner_vertex, surface.face_start).ends
    count = len(surface.vertices)
    length = np.linalg.norm(surface.vertices[ends[:, 0]] - surface.vertices[ends[:, 1]], axis=1)
    near = length <= max_distance
    start, neighbor, order = neighbors_of_nodes(count, *ends[near].T)
    neighbor, length = neighbor.astype(np.int64), np.tile(length[near], 2)[order]
    # All paths from all sources, by the number of their edges. A state is a source and a vertex.
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
        # The nearest of each state, if it is nearer than before.
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
