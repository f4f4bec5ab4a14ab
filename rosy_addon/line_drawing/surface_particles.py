"""Particles on a tangent mesh, which trace many streamlines or geodesics at once.

A particle moves in straight segments, each within one triangle. At an edge, its direction and its
member of the field are transported to the next triangle by unfolding. A segment has the direction of the
field at its midpoint (the midpoint rule) and is short enough that the field rotates little along it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple, Self

import numpy as np

from ..field.blocks import joined
from ..projection.pixel_blocks import part_of
from .tangent_mesh import ZERO_FIELD_RATIO, TangentMesh, nearest_member

#: Largest angle by which the field rotates along a segment, in radians, as estimated at the start of the
#: segment.
MAX_TURN_PER_SEGMENT = np.radians(1.0)

#: Largest angle in radians between a segment and the field at its ends. A segment that exceeds it is tried
#: again with half the length, up to `MAX_HALVINGS` tries in all.
MAX_DIRECTION_ERROR, MAX_HALVINGS = np.radians(0.9), 5

#: Largest number of segments that a particle traces in one call of `advance`, by default.
MAX_SEGMENTS = 32

#: A particle is stuck if the rotation of the field limits a segment to less than this fraction of the
#: largest length of a segment.
MIN_SEGMENT_RATIO = 0.002

#: A direction counts as parallel to an edge if the derivative of the barycentric coordinate that is 0 on the
#: edge, along the direction, is below this fraction of the largest such derivative.
PARALLEL_EPS = 1e-9


@dataclass(eq=False)
class SurfaceParticles:
    """The positions and directions of n particles.

    Attributes
    ----------
    triangle : (n,) int32 ndarray
        Triangle in which each particle is.
    weights : (n, 3) float64 ndarray
        Barycentric coordinates in the triangle.
    member : (n,) complex128 ndarray
        Unit member of the field that the particle follows, in the frame of the triangle.
    sign : (n,) float64 ndarray
        1 to move along the direction of the member, -1 to move against it.
    """

    triangle: np.ndarray
    weights: np.ndarray
    member: np.ndarray
    sign: np.ndarray

    @staticmethod
    def empty() -> SurfaceParticles:
        """Return a set of 0 particles."""
        triangle, member = np.empty(0, np.int32), np.empty(0, complex)
        return SurfaceParticles(triangle, np.empty((0, 3)), member, np.empty(0))

    def __len__(self) -> int:
        return len(self.triangle)

    def take(self, indices: np.ndarray) -> Self:
        """Return a copy of the particles with the given indices."""
        return type(self)(*(column[indices] for column in self.columns))

    @property
    def columns(self) -> tuple[np.ndarray, ...]:
        """All attributes, which are arrays with a row for each particle, in their order."""
        return tuple(vars(self).values())

    def assign(self, indices: np.ndarray, source: SurfaceParticles) -> None:
        """Overwrite the particles at `indices` with the particles of `source`."""
        for column, values in zip(self.columns, source.columns, strict=True):
            column[indices] = values

    def join(self, other: Self) -> Self:
        """Return the particles of both sets: first these, then the particles of `other`."""
        pairs = zip(self.columns, other.columns, strict=True)
        return type(self)(*(np.concatenate(pair) for pair in pairs))


class TracedPath(NamedTuple):
    """The m straight segments that particles have traced, in the order in which they were traced.

    Attributes
    ----------
    particle : (m,) intp ndarray
        Index of the particle that traced each segment.
    triangle : (m,) int32 ndarray
        Triangle in which the segment lies.
    begin_weights, end_weights : (m, 3) float64 ndarray
        Barycentric coordinates of the ends of the segment in this triangle.
    direction, member : (m,) complex128 ndarray
        Unit direction of the segment, and the unit member of the field that it follows, in the frame of the
        triangle.
    length : (m,) float64 ndarray
        Length of the segment in world space.
    """

    particle: np.ndarray
    triangle: np.ndarray
    begin_weights: np.ndarray
    end_weights: np.ndarray
    direction: np.ndarray
    member: np.ndarray
    length: np.ndarray


def advance(
    mesh: TangentMesh,
    particles: SurfaceParticles,
    length: np.ndarray,
    steering: np.ndarray | None = None,
    max_segment_length: np.ndarray | None = None,
    max_segments: int = MAX_SEGMENTS,
) -> tuple[SurfaceParticles, np.ndarray, np.ndarray, TracedPath]:
    """Move particles along the field, and return them with the path that they traced.

    Parameters
    ----------
    mesh : TangentMesh
    particles : SurfaceParticles
    length : (n,) float64 ndarray
        Length to move, in world space.
    steering : (n,) float64 ndarray, optional
        Small angles in radians that are added to the direction of the field, counter-clockwise.
    max_segment_length : (n,) float64 ndarray, optional
        Largest length of a segment, in world space.
    max_segments : int
        Largest number of segments that a particle traces.

    Returns
    -------
    particles : SurfaceParticles
        The particles after the move.
    walked : (n,) float64 ndarray
        Length that was moved. It is less than requested if the particle ended, or after `max_segments`
        segments.
    ended : (n,) bool ndarray
        Whether the particle cannot continue, because it is at a border, at a crease or at a zero of the
        field.
    path : TracedPath
        Segments that were traced.
    """
    result = particles.take(np.arange(len(particles)))
    remaining = length.astype(np.float64)
    ended = np.zeros(len(particles), dtype=bool)
    active = np.arange(len(particles))
    rotation = particles.sign.astype(np.complex128)
    if steering is not None:
        rotation *= np.exp(1j * steering)
    if max_segment_length is None:
        max_segment_length = length
    paths: list[TracedPath] = []
    for _ in range(max_segments):
        if not len(active):
            break
        current = result.take(active)
        max_length = np.minimum(remaining[active], max_segment_length[active])
        weights, direction, member, edge, step, stuck = _next_segment(
            mesh, current, max_length, max_segment_length[active], rotation[active]
        )
        path = TracedPath(active, *current.columns[:2], weights, direction, member, step)
        paths.append(part_of(path, ~stuck))
        current.weights, current.member = weights, member
        remaining[active] -= step
        stopped = stuck | _cross_edges(mesh, current, edge)[0]
        result.assign(active[~stuck], current.take(~stuck))
        ended[active[stopped]] = True
        active = active[~stopped & (remaining[active] > 1e-9 * length[active])]
    return result, length - remaining, ended, joined(paths)


def trace_geodesics(
    mesh: TangentMesh, particles: SurfaceParticles, direction: np.ndarray, length: np.ndarray
) -> tuple[SurfaceParticles, np.ndarray, np.ndarray]:
    """Move particles along straight geodesics, and transport their members of the field.

    Parameters
    ----------
    mesh : TangentMesh
    particles : SurfaceParticles
    direction : (n,) complex128 ndarray
        Unit directions of the geodesics, in the frames of the triangles of the particles.
    length : (n,) float64 ndarray
        Length to move, in world space.

    Returns
    -------
    particles : SurfaceParticles
        The particles after the move. Each has the member of the field that is nearest to its transported
        member, or 0 where the field is zero.
    direction : (n,) complex128 ndarray
        Directions of the geodesics after the move, in the frames of the triangles there.
    walked : (n,) float64 ndarray
        Length that was moved. It is less than requested at borders and creases.
    """
    result = particles.take(np.arange(len(particles)))
    direction, remaining = direction.copy(), length.astype(np.float64)
    active = np.arange(len(particles))
    for _ in range(8 * MAX_SEGMENTS):
        if not len(active):
            break
        current = result.take(active)
        slope = _weight_slopes(mesh, current.triangle, direction[active])
        edge_distance, edge = _distance_to_edge(current.weights, slope)
        step = np.minimum(edge_distance, remaining[active])
        edge = np.where(edge_distance <= remaining[active], edge, -1)
        current.weights = _moved_weights(current.weights, slope, step)
        remaining[active] -= step
        stopped, crossed, transport = _cross_edges(mesh, current, edge)
        result.assign(active, current)
        crossing = active[crossed]
        direction[crossing] = direction[crossing] * transport
        active = active[~stopped & (remaining[active] > 1e-9 * length[active])]
    result.member = mesh.members_at(result.triangle, result.weights, result.member)
    return result, direction, length - remaining


def _next_segment(
    mesh: TangentMesh,
    particles: SurfaceParticles,
    length: np.ndarray,
    usual_length: np.ndarray,
    rotation: np.ndarray,
) -> tuple[np.ndarray, ...]:
    """Compute the next segment of each particle. It has the direction of the field at its midpoint.

    A segment is at most `length`, (n,), long. Particles are stuck if the field rotates so fast that a segment
    would be much shorter than `usual_length`, (n,). Both are in world space. `rotation`, (n,) complex128, is
    the factor that rotates the direction of the field to the direction of motion.

    Returns
    -------
    new_weights : (n, 3) float64 ndarray
        Barycentric coordinates of the end of the segment.
    direction, member : (n,) complex128 ndarray
        Unit direction of the segment, and unit member of the field at its midpoint.
    edge : (n,) int64 ndarray
        Edge, 0 to 2, at which the segment ends; -1 if it ends inside the triangle.
    step : (n,) float64 ndarray
        Length of the segment, in world space.
    stuck : (n,) bool ndarray
        Whether there is no segment, because the field is zero or rotates too fast.
    """
    corner_z = mesh.z[particles.triangle]
    z = np.einsum("nk,nk->n", particles.weights, corner_z)
    stuck = np.abs(z) <= ZERO_FIELD_RATIO * np.abs(corner_z).max(axis=1)
    member = nearest_member(particles.member, np.where(stuck, 1, z), mesh.degree)
    particles = replace(particles, member=member)
    direction = rotation * mesh.directions_at(particles.triangle, particles.weights, member)
    slope = _weight_slopes(mesh, particles.triangle, direction)
    edge_distance, _ = _distance_to_edge(particles.weights, slope)
    turn_rate = np.abs((np.einsum("nk,nk->n", slope, corner_z) * z.conj()).imag)
    max_step = np.full(len(z), np.inf)
    largest = MAX_TURN_PER_SEGMENT * mesh.degree * (z.real**2 + z.imag**2)
    np.divide(largest, turn_rate, out=max_step, where=turn_rate > 0)
    stuck |= max_step < MIN_SEGMENT_RATIO * usual_length
    edge, step = np.full(len(z), -1), np.zeros(len(z))
    segments = particles.weights.copy(), direction, member.copy(), edge, step
    pending = np.flatnonzero(~stuck)
    for _ in range(MAX_HALVINGS):
        allowed = np.minimum(length, max_step)[pending]
        start = particles.take(pending)
        half = 0.5 * np.minimum(edge_distance[pending], allowed)
        midpoint = _moved_weights(start.weights, slope[pending], half)
        trial, is_straight = _midpoint_segments(mesh, start, midpoint, rotation[pending], allowed)
        for column, values in zip(segments, trial, strict=True):
            column[pending[is_straight]] = values[is_straight]
        pending = pending[~is_straight]
        if not len(pending):
            break
        # The field rotates more than estimated. Try a shorter segment.
        max_step[pending] = 0.5 * trial[-1][~is_straight]
    stuck[pending] = True
    return *segments, stuck


def _midpoint_segments(
    mesh: TangentMesh,
    start: SurfaceParticles,
    midpoint: np.ndarray,
    rotation: np.ndarray,
    allowed: np.ndarray,
) -> tuple[tuple[np.ndarray, ...], np.ndarray]:
    """Return segments by the midpoint rule, and whether the field rotates little along them.

    Parameters
    ----------
    mesh : TangentMesh
    start : SurfaceParticles
        Particles at the start of the segments, with members of the field there.
    midpoint : (n, 3) float64 ndarray
        Barycentric coordinates of the estimated midpoints of the segments.
    rotation : (n,) complex128 ndarray
        Unit factor that rotates the direction of the field to the direction of motion.
    allowed : (n,) float64 ndarray
        Largest lengths of the segments, in world space.

    Returns
    -------
    segments : tuple of ndarray
        The values `new_weights`, `direction`, `member`, `edge` and `step` of `_next_segment`.
    is_straight : (n,) bool ndarray
        Whether the angle between the segment and the field at its ends is at most `MAX_DIRECTION_ERROR`.
    """
    z = mesh.z[start.triangle]
    member = nearest_member(start.member, np.einsum("nk,nk->n", midpoint, z), mesh.degree)
    direction = rotation * mesh.directions_at(start.triangle, midpoint, member)
    slope = _weight_slopes(mesh, start.triangle, direction)
    edge_distance, edge = _distance_to_edge(start.weights, slope)
    step = np.minimum(edge_distance, allowed)
    weights = _moved_weights(start.weights, slope, step)
    end_member = nearest_member(member, np.einsum("nk,nk->n", weights, z), mesh.degree)
    cosine = np.minimum((end_member * member.conj()).real, (start.member * member.conj()).real)
    edge = np.where(edge_distance <= allowed, edge, -1)
    return (weights, direction, member, edge, step), cosine >= np.cos(MAX_DIRECTION_ERROR)


def _weight_slopes(mesh: TangentMesh, triangle: np.ndarray, direction: np.ndarray) -> np.ndarray:
    """Return the (n, 3) derivatives of the barycentric coordinates along unit directions.

    They are changes per unit of length in world space. `direction`, (n,) complex, is in the frames of the
    triangles.
    """
    gradient = mesh.gradient[triangle]
    return gradient.real * direction.real[:, None] + gradient.imag * direction.imag[:, None]


def _distance_to_edge(weights: np.ndarray, slope: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the (n,) distances from points to the boundary of their triangle, and the (n,) edges there.

    `weights`, (n, 3), are the barycentric coordinates of the points, and `slope`, (n, 3), their derivatives
    along the direction in which the distance is measured.
    """
    decreasing = slope < -PARALLEL_EPS * np.abs(slope).max(axis=1, keepdims=True)
    distances = np.where(decreasing, weights / np.where(decreasing, -slope, 1), np.inf)
    return np.minimum.reduce(distances, axis=1), np.argmin(distances, axis=1)


def _moved_weights(weights: np.ndarray, slope: np.ndarray, step: np.ndarray) -> np.ndarray:
    """Return the (n, 3) barycentric coordinates after steps of the (n,) lengths `step`.

    `slope` holds the derivatives of the coordinates along the steps. The result is kept inside the triangle.
    """
    weights = np.maximum(weights + slope * step[:, None], 0)
    return weights / weights.sum(axis=1, keepdims=True)


def _cross_edges(
    mesh: TangentMesh, particles: SurfaceParticles, edge: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Move particles across the edges that they have reached, in place.

    Parameters
    ----------
    mesh : TangentMesh
    particles : SurfaceParticles
    edge : (n,) ndarray of int
        Edge, 0 to 2, that each particle has reached, or -1.

    Returns
    -------
    stopped : (n,) bool ndarray
        Whether the particle is stopped by a border or a crease at its edge.
    crossed : (k,) intp ndarray
        Indices of the particles that crossed an edge.
    transport : (k,) complex128 ndarray
        Factors that transport tangents across these edges, from the frame of the old triangle to the frame of
        the new one.
    """
    neighbor = mesh.neighbor[particles.triangle, edge]
    stopped = (edge >= 0) & (neighbor < 0)
    crossed = np.flatnonzero((edge >= 0) & (neighbor >= 0))
    triangle, k = particles.triangle[crossed], edge[crossed]
    j = mesh.neighbor_edge[triangle, k].astype(np.intp)
    transport = mesh.edge_transport[triangle, k]
    weights = particles.weights[crossed]
    row = np.arange(len(crossed))
    new_weights = np.zeros_like(weights)
    # Neighboring triangles have opposite directions along their common edge.
    new_weights[row, (j + 1) % 3] = weights[row, (k + 2) % 3]
    new_weights[row, (j + 2) % 3] = weights[row, (k + 1) % 3]
    particles.weights[crossed] = new_weights / new_weights.sum(axis=1, keepdims=True)
    particles.triangle[crossed] = neighbor[crossed]
    particles.member[crossed] *= transport
    return stopped, crossed, transport
