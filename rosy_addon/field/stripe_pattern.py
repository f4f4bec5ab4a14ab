"""Compute a phase function on a surface whose integer level lines are evenly spaced stripes along a field.

The *phase* counts stripes: it grows by 1 from one stripe to the next, and a stripe is drawn where it is an
integer. A field of N directions has M families of stripes: N / 2 if each direction has an opposite, because
both give the same stripes, and N otherwise. Each family has its own phase.

Along an edge, the phase should change by the component of the edge across the stripes, divided by the
spacing. On a curved surface, no phase satisfies this exactly. `stripe_pattern` computes the phase with the
least squared error of exp(2 pi i phase). Where stripes diverge too much, new stripes begin, at triangles
around which the phase changes by an integer.

For the energy, the covering and the interpolation, see Knöppel, Crane, Pinkall and Schröder, "Stripe Patterns
on Surfaces" (SIGGRAPH 2015). But here the energy is minimized over numbers of modulus 1
(`angular_synchronization`) instead of eigenvectors, because an eigenvector would be small on most parts of
the surface, and would take longer to compute.

Around a singularity, the families of a field are permuted. So the unknowns are on a covering of the
surface. A *node* of the covering is a vertex together with one of its families. Two nodes are connected
across an edge if their directions match. If a family continues as the opposite direction of another family,
its value is the complex conjugate of the value of the other family.
"""

from dataclasses import dataclass

import numpy as np

from ..core.progress import progress, report
from .angular_synchronization import LABEL, PhaseGraph, phase_graph, synchronize
from .blocks import mask, row_blocks
from .connection import umbrella_order
from .connectivity import build_edges, sums_from_roots
from .polygon_arrays import next_corners

#: Smallest and largest cotangent weight of an edge. The smallest weight is positive, so that obtuse triangles
#: are connected as well.
MIN_WEIGHT, MAX_WEIGHT = 0.02, 50.0


@dataclass(frozen=True, eq=False)
class CornerDirections:
    """The N directions of a field at the corners of T triangles, as angles in the planes of the triangles.

    Attributes
    ----------
    degree : int
        N.
    family_count : int
        M, the number of families of stripes: `FieldSymmetry.line_count`. It is N / 2 if direction k + N / 2
        is the opposite of direction k, and N otherwise.
    offset : (T, 3) complex128 ndarray
        Positions of the corners in a frame of the plane of the triangle.
    angle : (T, 3) float64 ndarray
        Angle of direction 0 in that frame, in radians. Direction 0 of one corner of a triangle matches
        direction 0 of the other two corners.
    deviation : (T, 3, N) complex128 ndarray or None
        Ratios of the directions to the members of the nearest RoSy, as numbers of modulus 1. None for a RoSy.
    defined : (T,) bool ndarray
        Whether the field is defined in the triangle.
    """

    degree: int
    family_count: int
    offset: np.ndarray
    angle: np.ndarray
    deviation: np.ndarray | None
    defined: np.ndarray

    def phase_changes(self, spacing: float) -> np.ndarray:
        """Return the (3 T, M) changes that the phase of each family should have from each corner to the next.

        Row 3 t + k is for corner k of triangle t. `spacing` is the distance between neighboring stripes, in
        the units of `offset`.
        """
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
        return result.reshape(-1, self.family_count)


@dataclass(frozen=True, eq=False)
class StripePattern:
    """The phases of M families of stripes on T triangles. A phase grows by 1 from one stripe to the next.

    Attributes
    ----------
    phase : (T, M, 3) float32 ndarray
        The linear part of the phase, at the three corners of each triangle. Where `index` is not 0,
        `evaluate` adds a second part.
    index : (T, M) float32 ndarray
        Number of stripes that begin or end in each triangle: the integer by which the phase grows on the way
        around the triangle, counter-clockwise. It may be negative, and is 0 in most triangles.
    """

    phase: np.ndarray
    index: np.ndarray

    def evaluate(self, triangle: np.ndarray, weights: np.ndarray, family: np.ndarray) -> np.ndarray:
        """Evaluate the phase of one family at points of triangles.

        Parameters
        ----------
        triangle : (P,) int ndarray
            Triangle of each of P points.
        weights : (3, P) float32 ndarray
            Barycentric coordinates of the points.
        family : (P,) int ndarray
            Family of stripes for each point.

        Returns
        -------
        (P,) float32 ndarray
            Phase, in units of the distance between stripes.

        Notes
        -----
        If the index of a triangle is not 0, the phase is the sum of a linear function and of a second part.
        The second part is linear along the edges, and constant on rays from the center (Knöppel et al.,
        section 4.3).
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
    """Return the position of P points around the center of their triangle, as a fraction of a full turn.

    It is 0 at corner 0, 1/3 at corner 1 and 2/3 at corner 2. It is linear along the edges and constant on
    rays from the center. `weights` holds the (3, P) barycentric coordinates of the points.
    """
    opposite = weights.argmin(axis=0)
    points = np.arange(weights.shape[1])
    # The nearest edge runs from corner `tail` to the next corner. It is opposite the corner of smallest
    # weight.
    tail = (opposite + 1) % 3
    smallest = weights[opposite, points]
    head_weight = weights[(opposite + 2) % 3, points]
    fraction = (head_weight - smallest) / np.maximum(1 - 3 * smallest, np.float32(1e-6))
    return (tail + np.clip(fraction, 0, 1)) * np.float32(1 / 3)


def stripe_pattern(
    triangle_vertex: np.ndarray, directions: CornerDirections, spacing: float
) -> StripePattern:
    """Compute the phases of evenly spaced stripes along all directions of a field.

    Parameters
    ----------
    triangle_vertex : (T, 3) int ndarray
        Vertices of the triangles. Edges should not be much longer than the spacing; see `bisection`.
    directions : CornerDirections
    spacing : float
        Distance between neighboring stripes, in the units of `CornerDirections.offset`.

    Returns
    -------
    StripePattern
    """
    report(0.0, LABEL)
    change = directions.phase_changes(spacing)
    gluing = _gluing(triangle_vertex, directions)
    change = _shared_changes(change, gluing, directions)
    report(0.2, LABEL)
    covering = _covering(triangle_vertex, gluing, directions)
    graph = _covering_graph(covering, gluing, change, directions)
    with progress(0.4, 0.9):
        z = synchronize(graph)
    change, node, conjugated = (
        values.reshape(-1, 3, directions.family_count)
        for values in (change, covering.node, covering.conjugated)
    )
    phase = np.empty((len(change), directions.family_count, 3), dtype=np.float32)
    index = np.empty(phase.shape[:2], dtype=np.float32)
    for block in row_blocks(len(phase)):
        report(0.95, LABEL)
        corner = z[node[block]]
        np.conjugate(corner, out=corner, where=conjugated[block])
        corner_phase = np.angle(corner) / (2 * np.pi)
        # The phase is known up to integers. Choose the integers so that its change from corner to corner is
        # nearest to the change that it should have.
        step = np.roll(corner_phase, -1, axis=1) - corner_phase
        step += np.rint(change[block] - step)
        index[block] = np.rint(step.sum(axis=1))
        step -= (index[block] / 3)[:, None]
        phase[block, :, 0] = corner_phase[:, 0]
        phase[block, :, 1] = corner_phase[:, 0] + step[:, 0]
        phase[block, :, 2] = corner_phase[:, 0] + step[:, 0] + step[:, 1]
    return StripePattern(phase, index)


@dataclass(frozen=True, eq=False)
class _Gluing:
    """How the directions of T triangles continue in the neighboring triangles.

    Corner k of triangle t has the index 3 t + k. There is one halfedge from each corner to the next one.

    Attributes
    ----------
    twin : (3 T,) int32 ndarray
        For the halfedge that starts at each corner, the corner at which the opposite halfedge starts, in the
        neighboring triangle; -1 if the field does not continue across the edge.
    shift : (3 T,) int32 ndarray
        Direction d continues across that edge as direction (d + shift) modulo N of the neighboring triangle.
    next_corner : (3 T,) int32 ndarray
        The next corner of the same triangle.
    """

    twin: np.ndarray
    shift: np.ndarray
    next_corner: np.ndarray


def _gluing(triangle_vertex: np.ndarray, directions: CornerDirections) -> _Gluing:
    """Match the directions of neighboring triangles, after unfolding the two triangles into one plane."""
    corner_vertex = np.ascontiguousarray(triangle_vertex, dtype=np.int32).reshape(-1)
    start = np.arange(0, len(corner_vertex) + 1, 3, dtype=np.int32)
    a, b = build_edges(corner_vertex, start).halfedges.T
    is_defined = directions.defined[a // 3] & directions.defined[b // 3]
    a, b = a[is_defined], b[is_defined]
    edge = (np.roll(directions.offset, -1, axis=1) - directions.offset).reshape(-1)
    angle = (0.5 * (directions.angle + np.roll(directions.angle, -1, axis=1))).reshape(-1)
    unfolding = np.angle(-edge[b] * edge[a].conj())
    turn = (angle[a] + unfolding - angle[b]) * directions.degree / (2 * np.pi)
    shift_from_a = np.rint(turn).astype(np.int32) % directions.degree
    twin, shift = np.full_like(corner_vertex, -1), np.zeros_like(corner_vertex)
    twin[a], twin[b] = b, a
    shift[a], shift[b] = shift_from_a, (-shift_from_a) % directions.degree
    return _Gluing(twin, shift, next_corners(start))


def _shared_changes(
    change: np.ndarray, gluing: _Gluing, directions: CornerDirections
) -> np.ndarray:
    """Return (3 T, M) changes of the phases along edges: means of the changes in both triangles of each edge.

    `change` holds the (3 T, M) changes in each triangle (`CornerDirections.phase_changes`). The result is
    exactly opposite for the two opposite halfedges of an edge.
    """
    families = directions.family_count
    result = change.copy()
    glued = np.flatnonzero(gluing.twin >= 0)
    twin, shift = gluing.twin[glued], gluing.shift[glued]
    for family in range(families):
        direction = (family + shift) % directions.degree
        neighbor = change.reshape(-1).take(twin * np.intp(families) + direction % families)
        np.negative(neighbor, out=neighbor, where=direction < families)
        result[glued, family] = 0.5 * (change[glued, family] + neighbor)
    return result


@dataclass(frozen=True, eq=False)
class _Covering:
    """The nodes of the covering: a node is a vertex together with one of its M families of stripes.

    Attributes
    ----------
    node : (3 T, M) int32 ndarray
        Node of each corner and family.
    conjugated : (3 T, M) bool ndarray
        Whether the value of the corner and family is the complex conjugate of the value of the node.
    node_count : int
        Number of nodes.
    is_singular : (3 T,) bool ndarray
        Whether the vertex of each corner is singular. Each corner of a singular vertex has its own nodes,
        because a family becomes another one when it is followed around the vertex.
    """

    node: np.ndarray
    conjugated: np.ndarray
    node_count: int
    is_singular: np.ndarray


def _covering(
    triangle_vertex: np.ndarray, gluing: _Gluing, directions: CornerDirections
) -> _Covering:
    """Find the nodes of the covering.

    The directions at all corners around a vertex are numbered consistently, starting from the same direction.
    """
    degree, families = directions.degree, directions.family_count
    corner = np.arange(len(gluing.twin), dtype=np.int32)
    previous, _ = umbrella_order(triangle_vertex.reshape(-1), gluing.twin, gluing.next_corner)
    start, shift = sums_from_roots(previous, gluing.shift)
    last = gluing.next_corner[gluing.twin]
    closes = (gluing.twin >= 0) & (start == corner)
    is_singular = (closes & ((gluing.shift + shift[last]) % degree != 0))[start]
    fan = np.where(is_singular, corner, start)
    shift = np.where(is_singular, 0, shift % degree)
    is_used = mask(len(corner), fan)
    number = (np.cumsum(is_used) - 1)[fan]
    node = np.empty((len(corner), families), dtype=np.int32)
    conjugated = np.empty(node.shape, dtype=bool)
    for family in range(families):
        direction = (family + shift) % degree
        node[:, family] = number * families + direction % families
        conjugated[:, family] = direction >= families
    return _Covering(node, conjugated, int(np.count_nonzero(is_used)) * families, is_singular)


def _edge_weights(directions: CornerDirections) -> np.ndarray:
    """Return (T, 3) weights for the edges from each corner to the next: half cotangents of opposite angles.

    They are limited to the range from `MIN_WEIGHT` to `MAX_WEIGHT`.
    """
    to_corner = directions.offset - np.roll(directions.offset, 1, axis=1)
    to_next = np.roll(directions.offset, -1, axis=1) - np.roll(directions.offset, 1, axis=1)
    product = to_corner.conj() * to_next
    with np.errstate(divide="ignore", invalid="ignore"):
        weight = 0.5 * product.real / np.abs(product.imag)
    weight = np.clip(np.nan_to_num(weight, nan=MIN_WEIGHT), MIN_WEIGHT, MAX_WEIGHT)
    weight[~directions.defined] = MIN_WEIGHT
    return weight


def _covering_graph(
    covering: _Covering, gluing: _Gluing, change: np.ndarray, directions: CornerDirections
) -> PhaseGraph:
    """Return the graph that connects the nodes of the covering along the edges of all triangles.

    Each entry relates the values at the ends of an edge. `change` holds the (3 T, M) changes of the phase
    from each corner to the next (`_shared_changes`).
    """
    weight = _edge_weights(directions).reshape(-1)
    corner = np.arange(len(weight))
    has_twin = gluing.twin >= 0
    weight = weight + np.where(has_twin, weight[gluing.twin], 0)
    # Take each edge once. If it ends at a singular vertex, take it for both triangles, whose nodes differ.
    cut = covering.is_singular | covering.is_singular[gluing.next_corner]
    tail = np.flatnonzero(~has_twin | (corner < gluing.twin) | cut)
    head = gluing.next_corner[tail]
    tail_flipped, head_flipped = covering.conjugated[tail], covering.conjugated[head]
    turn = change[tail]
    np.negative(turn, out=turn, where=head_flipped)
    value = np.exp((2j * np.pi) * turn)
    value *= weight[tail, None]
    flips = tail_flipped != head_flipped
    a, b = np.where(flips, 0, value).reshape(-1), np.where(flips, value, 0).reshape(-1)
    tail_node, head_node = covering.node[tail].reshape(-1), covering.node[head].reshape(-1)
    row, column = np.concatenate([head_node, tail_node]), np.concatenate([tail_node, head_node])
    a, b = np.concatenate([a, a.conj()]), np.concatenate([b, b])
    return phase_graph(covering.node_count, row, column, a, b)
