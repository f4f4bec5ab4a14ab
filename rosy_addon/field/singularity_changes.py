"""Change singularities of a field: move them by hand, cancel nearby ones, and merge clusters of nearby ones."""

import numpy as np

from ..core.errors import RosyError
from ..core.progress import progress, report
from .blocks import bincount_rows, concatenated_ranges, mask, neighbors_of_nodes
from .connectivity import connected_components
from .prescribed import TurningError, change_singularities
from .rosy_field import RosyField
from .singularities import find_singularities, first_pairs
from .surface import Surface

#: Value for "no vertex": an index that is moved there leaves the surface across a border.
OUTSIDE = -1

#: Smallest distance over which a change of the directions falls off, relative to `Surface.extent`.
MIN_REACH = 0.01

#: Distance along edges within which pictures show singularities as one, relative to `Surface.extent`.
CLUSTER_REACH = 0.02

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

    `ends` holds the two vertices. The distance is 0 if one of them is `OUTSIDE` or not in the mesh.
    """
    if (ends < 0).any() or (ends >= len(surface.vertices)).any():
        return 0.0
    return float(np.linalg.norm(np.diff(surface.vertices[ends].astype(np.float64), axis=0)))


def cancel_pairs(surface: Surface, field: RosyField, max_distance: float) -> RosyField:
    """Return the field without nearby singularities whose indices sum to 0.

    Pairs with opposite indices are removed first, and then the clusters of all others whose sum is 0, such as
    +2/4 and two of -1/4. Directions change most near removed singularities, and less with the distance from
    them. All other singularities stay. A group is kept if the field without it would turn by pi / N or more
    between two faces. To find these groups, all are removed at once. If this fails, the groups nearest to such faces
    are kept, and the others are tried again. Each new attempt keeps about twice as many more.

    Parameters
    ----------
    surface : Surface
    field : RosyField
        A field whose directions are rotationally symmetric.
    max_distance : float
        Largest length of the shortest path along edges between the vertices of a pair, or from a singularity
        to the next one of its cluster, in object space.

    Returns
    -------
    RosyField
        The new field; the same object if it has no such singularities.

    Raises
    ------
    RosyError
        If the directions are not a RoSy.
    """
    field.check_rosy(surface.name)
    with progress(0.0, 0.2):
        vertex, index = find_singularities(surface, field)
    with progress(0.2, 0.4):
        group = _opposite_groups(surface, vertex, index, max_distance)
    start, least = 0.4, 1
    while (group >= 0).any():
        chosen = np.flatnonzero(group >= 0)
        change = vertex[chosen], -index[chosen]
        try:
            with progress(start, 1.0):
                return change_singularities(surface, field, *change, max_distance)
        except TurningError as error:
            is_near = _are_near(surface, vertex[chosen], error.vertices, least)
            group[np.isin(group, group[chosen[is_near]])] = -1
        start, least = 0.5 * (start + 1.0), 2 * least
    return field


def _opposite_groups(
    surface: Surface, vertex: np.ndarray, index: np.ndarray, max_distance: float
) -> np.ndarray:
    """Return (K,) int64 numbers of groups of nearby singularities whose indices sum to 0; -1 for all others.

    The groups are pairs of opposite indices (`opposite_pairs`), and clusters of the rest (`cluster_numbers`).
    `max_distance` is the largest distance in a pair, or to the next singularity of a cluster, along edges in
    object space.
    """
    pairs = opposite_pairs(surface, vertex, index, max_distance)
    group = np.full(len(vertex), -1)
    group[pairs] = np.arange(len(pairs))[:, None]
    rest = np.flatnonzero(group < 0)
    cluster = cluster_numbers(surface, vertex[rest], max_distance)
    is_zero = np.bincount(cluster, index[rest])[cluster] == 0
    group[rest[is_zero]] = len(pairs) + cluster[is_zero]
    return group


def cluster_numbers(surface: Surface, vertex: np.ndarray, max_distance: float) -> np.ndarray:
    """Return the (K,) int32 number of the cluster of each of K vertices, from 0 without gaps.

    Two of the vertices are in the same cluster if their distance is at most `max_distance`, along edges in
    object space, or if they are connected by a chain of such pairs.
    """
    first, second, _ = _near(surface, vertex, max_distance)
    return connected_components(len(vertex), np.stack([first, second], axis=1))


def cluster_singularities(
    surface: Surface, vertex: np.ndarray, index: np.ndarray, max_distance: float
) -> tuple[np.ndarray, np.ndarray]:
    """Replace each cluster of nearby singularities by one, with the sum of their indices. Leave out sums of 0.

    Noise divides the singularity at a pole into several, such as five of +1/4 around one of -1/4.

    Parameters
    ----------
    surface : Surface
    vertex, index : (K,) int ndarray
        Vertices and indices of the singularities.
    max_distance : float
        Largest distance from a singularity to the next one of its cluster, along edges in object space.

    Returns
    -------
    vertex, index : (n,) int32 ndarray
        For each cluster, its vertex nearest to the mean position of its vertices, and the sum of its indices.
        Vertices are in ascending order. The sum of all indices does not change.
    """
    cluster = cluster_numbers(surface, vertex, max_distance)
    point, total = surface.vertices[vertex], np.bincount(cluster, index).astype(np.int32)
    mean = bincount_rows(cluster, point, len(total)) / np.bincount(cluster)[:, None]
    order = np.lexsort((np.linalg.norm(point - mean[cluster], axis=1), cluster))
    nearest = order[np.unique(cluster[order], return_index=True)[1]]
    vertex, index = vertex[nearest[total != 0]], total[total != 0]
    order = np.argsort(vertex)
    return vertex[order], index[order]


def _are_near(surface: Surface, places: np.ndarray, vertices: np.ndarray, least: int) -> np.ndarray:
    """Return (n,) bool: which of the n vertices `places` are nearest to any of `vertices`.

    Distances are counted in rings of faces around `vertices`. The result is true up to the smallest distance within
    which there are at least `least` of the places.
    """
    is_near = mask(len(surface.vertices), vertices)
    corner_vertex, corner_face = surface.corner_vertex, surface.corner_face
    while is_near[places].sum() < least:
        touches = mask(surface.face_count, corner_face[is_near[corner_vertex]])
        before = int(is_near.sum())
        is_near[corner_vertex[touches[corner_face]]] = True
        if int(is_near.sum()) == before:
            return np.ones(len(places), dtype=bool)
    return is_near[places]


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
