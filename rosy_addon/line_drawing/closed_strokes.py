"""Close strokes that return to their first point into seamless loops.

A stroke around a tube stops when it comes near its own other end. If its ends almost meet, the
stroke is traced again from its first point, at a small constant angle to the field. The angle is
chosen such that the stroke arrives exactly at its first point.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..core.progress import progress, report
from ..field.frames import dot, normalize
from .spacing import CornerSpacing
from .stroke_set import Strokes
from .surface_particles import SurfaceParticles, advance
from .tangent_mesh import TangentMesh

#: Largest angle in radians between the field and a stroke that is traced again to close.
MAX_CLOSING_ANGLE = np.radians(0.09)

#: Largest distances between the ends of a stroke that can be closed, along and across the stroke,
#: in spacings.
MAX_FORWARD_GAP, MAX_LATERAL_GAP = 1.5, 0.4

#: Minimum length of a loop in spacings.
MIN_LOOP_LENGTH = 6.0

#: Maximum number of secant iterations, and the largest distance in spacings by which the end of a
#: loop may miss its first point after them.
MAX_ITERATIONS, CLOSING_TOLERANCE = 4, 1e-3

#: Step of a particle in spacings, and the number of steps between two reports.
TRACE_STEP, STEPS_PER_REPORT = 0.5, 8


class _ClosingTrace(NamedTuple):
    """The paths of n particles around their loops, m segments in all.

    Attributes
    ----------
    particle, triangle, weights, direction : (m, ...) ndarray
        As in `TracedPath`; the weights are its `end_weights`.
    left_offset : (n,) float64 ndarray
        Signed distance to the left of the first point at which a particle passed it, in world
        space.
    passed : (n,) bool ndarray
        Whether the particle passed its first point.
    """

    particle: np.ndarray
    triangle: np.ndarray
    weights: np.ndarray
    direction: np.ndarray
    left_offset: np.ndarray
    passed: np.ndarray


def close_loops(mesh: TangentMesh, strokes: Strokes, spacing: CornerSpacing) -> Strokes:
    """Close the strokes whose ends almost meet.

    The angle to the field that closes a loop is found with the secant method. Strokes for which it
    does not converge, or for which the angle is larger than `MAX_CLOSING_ANGLE`, stay open.

    Parameters
    ----------
    mesh : TangentMesh
        The mesh on which the strokes were traced.
    strokes : Strokes
        Strokes before `label_families`: all are in one family.
    spacing : CornerSpacing

    Returns
    -------
    Strokes
        The open strokes, then the loops.
    """
    candidates = _candidates(strokes)
    if not len(candidates):
        return strokes
    first, last = strokes.start[:-1][candidates], strokes.start[1:][candidates] - 1
    tolerance = CLOSING_TOLERANCE * strokes.spacing[first]
    # Secant method. The first two samples are angle 0 with the offset of the stroke as it was
    # traced, and the angle that would remove this offset if the stroke were straight.
    previous_angle, offset = (
        np.zeros(len(candidates)),
        _left_offset(strokes, first, strokes.points[last]),
    )
    angle = np.clip(-offset / strokes.length[candidates], -MAX_CLOSING_ANGLE, MAX_CLOSING_ANGLE)
    for iteration in range(MAX_ITERATIONS):
        start, stop = iteration / MAX_ITERATIONS, (iteration + 1) / MAX_ITERATIONS
        with progress(start, stop):
            trace = _trace_loops(mesh, strokes, candidates, angle)
        offset_change, angle_change = trace.left_offset - offset, angle - previous_angle
        if (np.abs(trace.left_offset) <= tolerance).all():
            break
        correction = np.divide(
            -trace.left_offset * angle_change,
            offset_change,
            out=np.zeros_like(angle),
            where=offset_change != 0,
        )
        previous_angle, offset, angle = (
            angle,
            trace.left_offset,
            angle + np.clip(correction, -MAX_CLOSING_ANGLE, MAX_CLOSING_ANGLE),
        )
    closes = (
        trace.passed
        & (np.abs(trace.left_offset) <= tolerance)
        & (np.abs(angle) <= MAX_CLOSING_ANGLE)
    )
    if not closes.any():
        return strokes
    is_open = np.ones(len(strokes), dtype=bool)
    is_open[candidates[closes]] = False
    loops = _loop_strokes(mesh, strokes.select(candidates), trace, closes, spacing)
    return Strokes.join([strokes.select(is_open), loops])


def _left_offset(strokes: Strokes, first: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Return the (n,) signed distances of points to the left of the first points of strokes.

    `first` holds the numbers of the first points. Left is relative to the direction of the stroke
    there, seen from outside the surface.
    """
    left = np.cross(strokes.normal[first], strokes.member[first])
    return dot(points - strokes.points[first], normalize(left))


def _candidates(strokes: Strokes) -> np.ndarray:
    """Return the numbers of open strokes whose last point is near their first point."""
    first, last = strokes.start[:-1], strokes.start[1:] - 1
    spacing = strokes.spacing[first]
    gap = strokes.points[first] - strokes.points[last]
    direction = normalize(strokes.member[first] + strokes.member[last])
    forward = dot(gap, direction)
    lateral = np.sqrt(np.maximum(dot(gap, gap) - forward * forward, 0))
    is_candidate = (dot(strokes.member[first], strokes.member[last]) > 0.8) & ~strokes.closed
    is_candidate &= dot(strokes.normal[first], strokes.normal[last]) > 0.8
    is_candidate &= (np.abs(forward) < MAX_FORWARD_GAP * spacing) & (
        lateral < MAX_LATERAL_GAP * spacing
    )
    length = strokes.length
    return np.flatnonzero(
        is_candidate
        & (length > MIN_LOOP_LENGTH * spacing)
        & (lateral < 2 * MAX_CLOSING_ANGLE * length)
    )


def _trace_loops(
    mesh: TangentMesh, strokes: Strokes, candidates: np.ndarray, angle: np.ndarray
) -> _ClosingTrace:
    """Trace candidates from their first points until they pass these points again or miss them.

    `angle` is the (n,) angle in radians to the left of the field.
    """
    first = strokes.start[:-1][candidates]
    origin, tangent = strokes.points[first], strokes.member[first]
    spacing, length = strokes.spacing[first], strokes.length[candidates]
    particles = _particles_at_start(mesh, strokes, first)
    total_walked = np.zeros(len(candidates))
    passed = np.zeros(len(candidates), dtype=bool)
    active = np.arange(len(candidates))
    segments: list[tuple[np.ndarray, ...]] = []
    while len(active):
        if len(segments) % STEPS_PER_REPORT == 0:
            report(1 - len(active) / len(candidates), "closing loops")
        current = particles.take(active)
        to_origin = origin[active] - mesh.points_at(current.triangle, current.weights)
        forward = dot(to_origin, tangent[active])
        is_near = (total_walked > length - 2 * spacing)[active] & (
            dot(to_origin, to_origin) < spacing[active] ** 2
        )
        arrived = is_near & (forward < 1e-6 * spacing[active])
        passed[active[arrived]] = True
        overran = total_walked[active] > length[active] + (MAX_FORWARD_GAP + 1) * spacing[active]
        continuing = np.flatnonzero(~arrived & ~overran)
        if not len(continuing):
            break
        step = TRACE_STEP * spacing[active]
        step = np.where(is_near, np.minimum(forward, step), step)[continuing]
        active, current = active[continuing], current.take(continuing)
        current, walked, ended, path = advance(mesh, current, step, angle[active])
        segments.append((active[path.particle], path.triangle, path.end_weights, path.direction))
        particles.assign(active, current)
        total_walked[active] += walked
        active = active[~ended & (walked > 0)]
    columns = [np.concatenate(column) for column in zip(*segments, strict=True)]
    left_offset = _left_offset(
        strokes, first, mesh.points_at(particles.triangle, particles.weights)
    )
    return _ClosingTrace(*columns, left_offset, passed)


def _particles_at_start(mesh: TangentMesh, strokes: Strokes, first: np.ndarray) -> SurfaceParticles:
    """Return particles at the first points of strokes that move along the strokes."""
    triangle, weights = strokes.triangle[first], strokes.weights[first]
    reference = mesh.to_frame(triangle, strokes.member[first])
    member = mesh.members_at(triangle, weights, reference)
    return SurfaceParticles(triangle, weights, member, np.ones(len(first)))


def _loop_strokes(
    mesh: TangentMesh,
    strokes: Strokes,
    trace: _ClosingTrace,
    closes: np.ndarray,
    spacing: CornerSpacing,
) -> Strokes:
    """Return the traced paths of the strokes that close, as closed strokes."""
    loop_index = np.flatnonzero(closes)
    first = strokes.start[:-1][loop_index]
    start = _particles_at_start(mesh, strokes, first)
    keep = closes[trace.particle]
    particle = np.concatenate([loop_index, trace.particle[keep]])
    order = np.argsort(particle, kind="stable")
    triangle = np.concatenate([start.triangle, trace.triangle[keep]])[order]
    weights = np.concatenate([start.weights, trace.weights[keep]])[order]
    direction = np.concatenate([start.member, trace.direction[keep]])[order]
    count = np.bincount(particle, minlength=len(strokes))[loop_index]
    spacings = spacing.at(triangle, weights, direction)
    return Strokes.on_mesh(mesh, count, triangle, weights, direction, spacings, closed=True)
