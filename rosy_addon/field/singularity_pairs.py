"""Pairs of singularities with opposite indices that are near to each other."""

from __future__ import annotations

import numpy as np

from ..progress import report
from .blocks import concatenated_ranges
from .surface import Surface, build_edges

#: Label of the progress.
LABEL = "pairing singularities"


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
    is_free = np.ones(len(vertex), dtype=bool)
    pairs = []
    for a, b in zip(first[order].tolist(), second[order].tolist(), strict=True):
        if is_free[a] and is_free[b]:
            pairs.append((a, b))
            is_free[[a, b]] = False
    return np.array(pairs, dtype=np.intp).reshape(-1, 2)


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
    tail, head = ends[near].T
    tail, head = np.concatenate([tail, head]), np.concatenate([head, tail])
    order = np.argsort(tail, kind="stable")
    neighbor, length = head[order].astype(np.int64), np.tile(length[near], 2)[order]
    start = np.concatenate([[0], np.cumsum(np.bincount(tail, minlength=count))])
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
