"""Evenly spaced lines along the directions of a field, as a phase on the surface.

A phase is a number of lines: it grows by 1 from one line to the next, and the lines are where it is
an integer. Along an edge, the phase of a family of lines changes by the component of the edge
across the lines divided by the spacing. On a curved surface no phase has exactly these changes; the
one sought has the least squared error of exp(2 pi i phase). Where lines diverge too much, new lines
begin, at triangles around which the phase changes by an integer.

Energy, covering and interpolation are those of Knöppel, Crane, Pinkall and Schröder, "Stripe
Patterns on Surfaces" (SIGGRAPH 2015). The energy is minimized over numbers of modulus 1 from coarse
to fine, as the position fields of Jakob, Tarini, Panozzo and Sorkine-Hornung, "Instant
Field-Aligned Meshes" (SIGGRAPH Asia 2015): an eigenvector would be small on most parts of the
surface, and take longer.

The families of a field change places around its singularities. So the unknowns live on the
covering: a *node* is a vertex with one of its families, joined across edges by the directions that
match. A family that comes back with the opposite direction has the conjugate unknown.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..progress import Progress, Task, run_to_completion, subtask
from .surface import connected_components_task, edges_task

#: Label of all steps.
STEP_LABEL = "spacing lines"

#: Bounds of the cotangent weights of edges. The lower one also connects obtuse triangles.
MIN_WEIGHT, MAX_WEIGHT = 0.02, 50.0

#: Smoothing steps on each level.
SMOOTHING_STEPS = 12

#: Share of the old value in a smoothing step. It damps oscillations.
INERTIA = 0.3

#: Levels have at least this many nodes, and are coarsened by at least this factor.
MIN_LEVEL_NODES, MIN_COARSENING = 12, 1.1

#: Rounds in which pairs of nodes are matched on a level.
MATCHING_ROUNDS = 6


@dataclass(frozen=True, eq=False)
class CornerDirections:
    """The directions of a field at the corners of T triangles, in the planes of the triangles.

    Attributes
    ----------
    degree : int
        N.
    has_opposites : bool
        Whether direction k + N / 2 is the opposite of direction k (see `FieldSymmetry`).
    offset : (T, 3) complex128 ndarray
        Positions of the corners in a frame of the plane.
    angle : (T, 3) float64 ndarray
        Angle of direction 0 in that frame, radians. Within a triangle direction 0 is the same
        branch at all corners.
    deviation : (T, 3, N) complex128 ndarray or None
        Ratios of the directions to those of a RoSy, of modulus 1. None for a RoSy.
    defined : (T,) bool ndarray
        Whether the field is defined in the triangle.
    """

    degree: int
    has_opposites: bool
    offset: np.ndarray
    angle: np.ndarray
    deviation: np.ndarray | None
    defined: np.ndarray

    @property
    def family_count(self) -> int:
        """M, the number of families of lines: N / 2 with opposites, N otherwise."""
        return self.degree // 2 if self.has_opposites else self.degree

    def phase_changes(self, spacing: float) -> np.ndarray:
        """(T, 3, M) changes of the phase from each corner to the next, for lines along the field."""
        edge = np.roll(self.offset, -1, axis=1) - self.offset
        middle = 0.5 * (self.angle + np.roll(self.angle, -1, axis=1))
        result = np.empty((*edge.shape, self.family_count))
        for family in range(self.family_count):
            direction = np.exp(1j * (middle + 2 * np.pi * family / self.degree))
            if self.deviation is not None:
                ends = self.deviation[:, :, family]
                ends = ends + np.roll(ends, -1, axis=1)
                direction = direction * ends / np.maximum(np.abs(ends), 1e-12)
            result[:, :, family] = (edge * direction.conj()).imag / spacing
        result[~self.defined] = 0
        return result


@dataclass(frozen=True, eq=False)
class StripePattern:
    """The phases of M families of lines on T triangles.

    Attributes
    ----------
    phase : (T, M, 3) float32 ndarray
        Phase at the corners, in lines: the linear part (see `evaluate`).
    index : (T, M) float32 ndarray
        Number of lines that end in the triangle: integers, 0 in most triangles.
    """

    phase: np.ndarray
    index: np.ndarray

    def evaluate(self, triangle: np.ndarray, weights: np.ndarray, family: np.ndarray) -> np.ndarray:
        """Evaluate the phase of one family at points of triangles.

        Parameters
        ----------
        triangle : (P,) int ndarray
        weights : (3, P) float32 ndarray
            Barycentric coordinates.
        family : (P,) int ndarray

        Returns
        -------
        (P,) float32 ndarray
            In lines.

        Notes
        -----
        In a triangle with an index, the phase is that of Knöppel et al. (section 4.3): linear along
        the edges, and constant on rays from the center of the triangle apart from a linear part.
        """
        entry = triangle * np.int32(self.index.shape[1]) + family
        corners = self.phase.reshape(-1, 3)
        result = weights[0] * corners[:, 0].take(entry)
        result += weights[1] * corners[:, 1].take(entry)
        result += weights[2] * corners[:, 2].take(entry)
        index = self.index.reshape(-1).take(entry)
        singular = np.flatnonzero(index)
        if len(singular):
            result[singular] += index[singular] * _turn_fraction(weights[:, singular])
        return result


def _turn_fraction(weights: np.ndarray) -> np.ndarray:
    """(P,) part of a turn around a triangle, from 0 at corner 0 through 1 / 3 at corner 1.

    It is linear along the edges and constant on rays from the center.
    """
    opposite = weights.argmin(axis=0)
    points = np.arange(weights.shape[1])
    # The nearest edge runs from `tail` to the next corner, opposite the smallest weight.
    tail = (opposite + 1) % 3
    smallest = weights[opposite, points]
    head_weight = weights[(opposite + 2) % 3, points]
    fraction = (head_weight - smallest) / np.maximum(1 - 3 * smallest, np.float32(1e-6))
    return (tail + np.clip(fraction, 0, 1)) * np.float32(1 / 3)


def stripe_pattern(
    triangle_vertex: np.ndarray, directions: CornerDirections, spacing: float
) -> StripePattern:
    """Run `stripe_pattern_task` to its end."""
    return run_to_completion(stripe_pattern_task(triangle_vertex, directions, spacing))


def stripe_pattern_task(
    triangle_vertex: np.ndarray, directions: CornerDirections, spacing: float
) -> Task[StripePattern]:
    """Compute phases of evenly spaced lines along all directions of a field.

    Parameters
    ----------
    triangle_vertex : (T, 3) int ndarray
        Triangles that share edges share their vertices. Their edges should not be much longer than
        the spacing; see `bisection`.
    directions : CornerDirections
    spacing : float
        Distance between neighboring lines, in the units of the corners.

    Yields
    ------
    Progress

    Returns
    -------
    StripePattern
    """
    yield Progress(0.0, STEP_LABEL)
    change = directions.phase_changes(spacing)
    gluing = yield from subtask(_gluing_task(triangle_vertex, directions), 0.0, 0.1)
    yield Progress(0.1, STEP_LABEL)
    change = _mean_of_neighbors(change, gluing, directions)
    node, conjugated, node_count = yield from subtask(
        _covering_nodes_task(triangle_vertex, directions, gluing), 0.1, 0.4
    )
    yield Progress(0.4, STEP_LABEL)
    graph = _covering_graph(node, conjugated, node_count, change, _edge_weights(directions))
    z = yield from subtask(_smoothest_task(graph), 0.4, 0.95, STEP_LABEL)
    yield Progress(0.95, STEP_LABEL)
    corner = z[node]
    corner[conjugated] = corner[conjugated].conj()
    corner_phase = np.angle(corner) / (2 * np.pi)
    # From corner to corner, the phase changes by nearly as much as it should.
    step = np.roll(corner_phase, -1, axis=1) - corner_phase
    step += np.rint(change - step)
    index = np.rint(step.sum(axis=1))
    step -= (index / 3)[:, None]
    phase = np.empty((len(node), directions.family_count, 3), dtype=np.float32)
    phase[..., 0] = corner_phase[:, 0]
    phase[..., 1] = corner_phase[:, 0] + step[:, 0]
    phase[..., 2] = corner_phase[:, 0] + step[:, 0] + step[:, 1]
    return StripePattern(phase, index.astype(np.float32))


@dataclass(frozen=True, eq=False)
class _Gluing:
    """How the directions of triangles continue across I interior edges.

    `a` and `b` are the corners (3 t + k) at which the edge starts in its two triangles. Direction d
    of the first continues as direction d + `shift` of the second.
    """

    a: np.ndarray
    b: np.ndarray
    shift: np.ndarray


def _gluing_task(triangle_vertex: np.ndarray, directions: CornerDirections) -> Task[_Gluing]:
    corner_vertex = np.ascontiguousarray(triangle_vertex, dtype=np.int32).reshape(-1)
    start = np.arange(0, len(corner_vertex) + 1, 3, dtype=np.int32)
    edges = yield from subtask(edges_task(corner_vertex, start), 0.0, 0.8, STEP_LABEL)
    yield Progress(0.8, STEP_LABEL)
    a, b = edges.halfedges.T.astype(np.intp)
    is_defined = directions.defined[a // 3] & directions.defined[b // 3]
    a, b = a[is_defined], b[is_defined]
    edge = (np.roll(directions.offset, -1, axis=1) - directions.offset).reshape(-1)
    angle = (0.5 * (directions.angle + np.roll(directions.angle, -1, axis=1))).reshape(-1)
    # The neighbor unfolds into the plane of the first triangle: the edge runs backward in it.
    unfolding = np.angle(-edge[b] * edge[a].conj())
    turn = (angle[a] + unfolding - angle[b]) * directions.degree / (2 * np.pi)
    return _Gluing(a, b, np.rint(turn).astype(np.int64) % directions.degree)


def _mean_of_neighbors(
    change: np.ndarray, gluing: _Gluing, directions: CornerDirections
) -> np.ndarray:
    """(T, 3, M) changes of phases that are exactly opposite in the two triangles of an edge."""
    families = directions.family_count
    flat = change.reshape(-1, families)
    result = flat.copy()
    for family in range(families):
        direction = (family + gluing.shift) % directions.degree
        sign = np.where(direction < families, 1.0, -1.0)
        neighbor = direction % families
        mean = 0.5 * (flat[gluing.a, family] - sign * flat[gluing.b, neighbor])
        result[gluing.a, family] = mean
        result[gluing.b, neighbor] = -sign * mean
    return result.reshape(change.shape)


def _covering_nodes_task(
    triangle_vertex: np.ndarray, directions: CornerDirections, gluing: _Gluing
) -> Task[tuple[np.ndarray, np.ndarray, int]]:
    """Find the nodes of the covering.

    Returns
    -------
    node : (T, 3, M) int32 ndarray
        Node of each corner and family.
    conjugated : (T, 3, M) bool ndarray
        Whether the family has the conjugate of the value of the node.
    node_count : int
    """
    degree, families = directions.degree, directions.family_count
    corner_count = triangle_vertex.size
    next_of = np.arange(corner_count) + 1
    next_of[2::3] -= 3
    ends = [(gluing.a, next_of[gluing.b]), (next_of[gluing.a], gluing.b)]
    pairs = np.empty((degree, 2, len(gluing.a), 2), dtype=np.int32)
    for direction in range(degree):
        neighbor = (direction + gluing.shift) % degree
        for end, (first, second) in enumerate(ends):
            pairs[direction, end, :, 0] = first * degree + direction
            pairs[direction, end, :, 1] = second * degree + neighbor
    task = connected_components_task(corner_count * degree, pairs.reshape(-1, 2))
    component = yield from subtask(task, 0.0, 0.9, STEP_LABEL)
    component = component.reshape(corner_count, degree)
    yield Progress(0.9, STEP_LABEL)
    # Around a singular vertex two families of a corner become the same: its corners are cut apart.
    ordered = np.sort(component, axis=1)
    singular = np.flatnonzero((ordered[:, 1:] == ordered[:, :-1]).any(axis=1))
    opposite = component
    if directions.has_opposites:
        opposite = np.roll(component, -families, axis=1)
    component, opposite = component[:, :families], opposite[:, :families]
    conjugated = component > opposite
    node = np.minimum(component, opposite)
    node[singular] = corner_count * degree + np.arange(len(singular) * families).reshape(
        -1, families
    )
    conjugated[singular] = False
    used, node = np.unique(node, return_inverse=True)
    shape = (*triangle_vertex.shape, families)
    return node.reshape(shape).astype(np.int32), conjugated.reshape(shape), len(used)


def _edge_weights(directions: CornerDirections) -> np.ndarray:
    """(T, 3) half the cotangents of the angles opposite the edge from each corner to the next."""
    to_corner = directions.offset - np.roll(directions.offset, 1, axis=1)
    to_next = np.roll(directions.offset, -1, axis=1) - np.roll(directions.offset, 1, axis=1)
    product = to_corner.conj() * to_next
    with np.errstate(divide="ignore", invalid="ignore"):
        weight = 0.5 * product.real / np.abs(product.imag)
    weight = np.clip(np.nan_to_num(weight, nan=MIN_WEIGHT), MIN_WEIGHT, MAX_WEIGHT)
    weight[~directions.defined] = MIN_WEIGHT
    return weight


@dataclass(frozen=True, eq=False)
class _Graph:
    """Nodes and what their neighbors say about their values.

    An entry says that the value at `row` should be ``a z + b conj(z)``, with the value z at
    `column`. Its moduli are weights. Entries are sorted by row, and come in both directions.
    """

    node_count: int
    row: np.ndarray
    column: np.ndarray
    a: np.ndarray
    b: np.ndarray


def _covering_graph(
    node: np.ndarray,
    conjugated: np.ndarray,
    node_count: int,
    change: np.ndarray,
    weight: np.ndarray,
) -> _Graph:
    """The graph of the edges of all triangles on the covering."""
    tail, head = node, np.roll(node, -1, axis=1)
    tail_flipped, head_flipped = conjugated, np.roll(conjugated, -1, axis=1)
    value = weight[:, :, None] * np.exp(2j * np.pi * np.where(head_flipped, -change, change))
    flips = tail_flipped != head_flipped
    tail, head, value, flips = (x.reshape(-1) for x in (tail, head, value, flips))
    a, b = np.where(flips, 0, value), np.where(flips, value, 0)
    return _sum_entries(
        node_count,
        np.concatenate([head, tail]),
        np.concatenate([tail, head]),
        np.concatenate([a, a.conj()]),
        np.concatenate([b, b]),
    )


def _sum_entries(
    node_count: int, row: np.ndarray, column: np.ndarray, a: np.ndarray, b: np.ndarray
) -> _Graph:
    """A graph of entries in any order; those between the same nodes add up."""
    off_diagonal = row != column
    row, column, a, b = (x[off_diagonal] for x in (row, column, a, b))
    key = row.astype(np.int64) * node_count + column
    order = np.argsort(key, kind="stable")
    key = key[order]
    if not len(key):
        return _Graph(node_count, row, column, a, b)
    first = np.flatnonzero(np.concatenate([[True], key[1:] != key[:-1]]))
    group = np.repeat(np.arange(len(first)), np.diff(first, append=len(key)))
    a, b = (_complex_sums(group, x[order], len(first)) for x in (a, b))
    key = key[first]
    return _Graph(node_count, key // node_count, key % node_count, a, b)


def _complex_sums(index: np.ndarray, values: np.ndarray, count: int) -> np.ndarray:
    result = np.empty(count, dtype=np.complex128)
    result.real = np.bincount(index, values.real, count)
    result.imag = np.bincount(index, values.imag, count)
    return result


def _smoothest_task(graph: _Graph) -> Task[np.ndarray]:
    """(n,) complex128 values of modulus 1 that agree with their neighbors, from coarse to fine."""
    levels = [graph]
    clusterings = []
    while graph.node_count > MIN_LEVEL_NODES and len(graph.row):
        yield Progress(0.3, STEP_LABEL)
        clustering = _clusters(graph)
        yield Progress(0.3, STEP_LABEL)
        coarse = _coarse_graph(graph, *clustering)
        if coarse.node_count * MIN_COARSENING > graph.node_count:
            break
        clusterings.append(clustering)
        levels.append(coarse)
        graph = coarse
    z = np.ones(graph.node_count, dtype=np.complex128)
    while True:
        for _ in range(SMOOTHING_STEPS):
            yield Progress(1 - 0.7 * len(clusterings) / len(levels), STEP_LABEL)
            z = _smoothed(levels[len(clusterings)], z)
        if not clusterings:
            return z
        cluster, p, q = clusterings.pop()[:3]
        z = p * z[cluster] + q * z[cluster].conj()


def _smoothed(graph: _Graph, z: np.ndarray) -> np.ndarray:
    """Replace each value by the one that its neighbors agree on."""
    neighbor = z[graph.column]
    terms = graph.a * neighbor
    terms += graph.b * neighbor.conj()
    total = _complex_sums(graph.row, terms, graph.node_count)
    weight = np.bincount(graph.row, np.abs(graph.a) + np.abs(graph.b), graph.node_count)
    total += INERTIA * weight * z
    modulus = np.abs(total)
    return np.divide(total, modulus, out=z.copy(), where=modulus > 0)


def _clusters(graph: _Graph) -> tuple[np.ndarray, np.ndarray, np.ndarray, int]:
    """Group nodes into pairs and triples along their strongest edges.

    Returns
    -------
    cluster : (n,) int ndarray
    p, q : (n,) complex128 ndarray
        The value of a node is p z + q conj(z), with the value z of its cluster.
    cluster_count : int
    """
    count, row, column = graph.node_count, graph.row, graph.column
    # A hash makes the strengths distinct, so that many nodes find a partner at once.
    low, high = np.minimum(row, column), np.maximum(row, column)
    mixed = (low.astype(np.uint64) * np.uint64(count) + high.astype(np.uint64)) * np.uint64(
        0x9E3779B97F4A7C15
    )
    strength = np.abs(graph.a) + np.abs(graph.b)
    strength *= 1 + 0.5 * (mixed >> np.uint64(40)).astype(np.float64) / 2**24
    order = np.lexsort((-strength, row))
    row, column = row[order], column[order]
    partner = np.full(count, -1, dtype=np.int64)
    entry_row, entry_column, entry = row, column, order
    entry_of = np.full(count, -1, dtype=np.int64)
    for _ in range(MATCHING_ROUNDS):
        free = (partner[entry_row] < 0) & (partner[entry_column] < 0)
        entry_row, entry_column, entry = entry_row[free], entry_column[free], entry[free]
        if not len(entry_row):
            break
        first = np.flatnonzero(np.concatenate([[True], entry_row[1:] != entry_row[:-1]]))
        choice = np.full(count, -1, dtype=np.int64)
        choice[entry_row[first]] = entry_column[first]
        chooser = entry_row[first]
        mutual = choice[choice[chooser]] == chooser
        partner[chooser[mutual]] = choice[chooser[mutual]]
        entry_of[chooser[mutual]] = entry[first[mutual]]
    # Each pair has a root; the others take their value from it. Single nodes join a root.
    nodes = np.arange(count)
    root = np.where((partner >= 0) & (partner < nodes), partner, nodes)
    is_pair_root = (partner >= 0) & (partner > nodes)
    joins = (partner[row] < 0) & is_pair_root[column]
    joining_row, joining_column, joining_entry = row[joins], column[joins], order[joins]
    if len(joining_row):
        first = np.flatnonzero(np.concatenate([[True], joining_row[1:] != joining_row[:-1]]))
        root[joining_row[first]] = joining_column[first]
        entry_of[joining_row[first]] = joining_entry[first]
    p, q = np.ones(count, dtype=np.complex128), np.zeros(count, dtype=np.complex128)
    follower = np.flatnonzero(root != nodes)
    a, b = graph.a[entry_of[follower]], graph.b[entry_of[follower]]
    keeps = np.abs(a) >= np.abs(b)
    chosen = np.where(keeps, a, b)
    modulus = np.abs(chosen)
    chosen = np.divide(chosen, modulus, out=np.ones_like(chosen), where=modulus > 0)
    p[follower], q[follower] = np.where(keeps, chosen, 0), np.where(keeps, 0, chosen)
    is_root = root == nodes
    number = np.cumsum(is_root) - 1
    return number[root], p, q, int(number[-1]) + 1


def _coarse_graph(
    graph: _Graph, cluster: np.ndarray, p: np.ndarray, q: np.ndarray, count: int
) -> _Graph:
    """The graph of clusters: the entries in terms of their values."""
    p_column, q_column = p[graph.column], q[graph.column]
    # (a, b) after the map of the column.
    a = graph.a * p_column + graph.b * q_column.conj()
    b = graph.a * q_column + graph.b * p_column.conj()
    # The inverse map of the row: p is a rotation, or q a rotation of the conjugate.
    p_row, q_row = p[graph.row], q[graph.row]
    a, b = p_row.conj() * a + q_row * b.conj(), p_row.conj() * b + q_row * a.conj()
    return _sum_entries(count, cluster[graph.row], cluster[graph.column], a, b)
