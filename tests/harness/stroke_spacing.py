"""Measure how evenly strokes are spaced, independently of the code that places them.

The gap is measured at points along all strokes, on both sides. It is the distance to the next
stroke of the same family, perpendicular to the stroke, divided by the required spacing. Distances
are chords, corrected to the length of an arc that bends by the angle between the two normals.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from rosy_addon.field.frames import dot, normalize, transport
from rosy_addon.line_drawing.point_grid import PointGrid
from rosy_addon.line_drawing.stroke_set import Strokes
from rosy_addon.line_drawing.surface_particles import SurfaceParticles, trace_geodesics
from rosy_addon.line_drawing.tangent_mesh import TangentMesh

#: Distance between the points that are compared, and search radius, in spacings.
SAMPLE_STEP, SEARCH_RADIUS = 0.1, 2.0

#: Points of one stroke are compared only if they are farther apart along it than this, in spacings.
MIN_SELF_ARC = 2.5


class LateralGaps(NamedTuple):
    """The gaps at n points of strokes, on the left (0) and the right (1) side.

    Attributes
    ----------
    point : (n,) int64 ndarray
        Numbers of the points in the strokes.
    gap : (n, 2) float64 ndarray
        Distance to the next stroke in spacings; infinite if there is none within `SEARCH_RADIUS`.
    has_room : (n, 2) bool ndarray
        Whether the surface continues on that side for 1.25 spacings. If it does not, or if a crease
        stops strokes, no stroke is expected there.
    nearest_distance : (n,) float64 ndarray
        Distance to the nearest point of a stroke of the family in any direction, in spacings.
    """

    point: np.ndarray
    gap: np.ndarray
    has_room: np.ndarray
    nearest_distance: np.ndarray

    def evenness(self, tolerance: float = 0.25) -> float:
        """Return the fraction of gaps on sides with room that differ from 1 by at most `tolerance`."""
        gap = self.gap[self.has_room]
        return float(np.mean(np.abs(gap - 1) <= tolerance)) if len(gap) else 1.0


def lateral_gaps(mesh: TangentMesh, strokes: Strokes, max_points: int = 20_000) -> LateralGaps:
    """Measure the gaps of strokes.

    Parameters
    ----------
    mesh : TangentMesh
        The mesh on which the strokes were traced.
    strokes : Strokes
        All strokes, before any are clipped or cut.
    max_points : int
        About the number of points at which gaps are measured, evenly distributed.
    """
    step = np.diff(strokes.arc, prepend=0)
    step[strokes.start[:-1]] = 0
    samples = strokes.subdivided(np.ceil(step / (SAMPLE_STEP * strokes.spacing)).clip(1, 1000))
    tangent = _tangents(samples)
    grid = PointGrid(SEARCH_RADIUS * float(np.median(samples.spacing)), len(samples.points))
    grid.add(samples.points, SEARCH_RADIUS * samples.spacing)
    sample = np.flatnonzero(np.isfinite(samples.weights[:, 0]))
    point = np.flatnonzero(np.isfinite(strokes.weights[:, 0]))
    stride = max(len(sample) // max_points, 1)
    sample, point = sample[::stride], point[::stride]
    gap, nearest_distance = np.full((len(sample), 2), np.inf), np.full(len(sample), np.inf)
    for start in range(0, len(sample), 1 << 12):
        batch = slice(start, start + (1 << 12))
        gap[batch], nearest_distance[batch] = _measure(mesh, samples, tangent, grid, sample[batch])
    has_room = _sides_with_room(mesh, samples, tangent, sample)
    return LateralGaps(point, gap, has_room, nearest_distance)


def _arc_distance(strokes: Strokes, point_a: np.ndarray, point_b: np.ndarray) -> np.ndarray:
    """Return (m,) float64: the distances along strokes between pairs of points, in world space.

    On a closed stroke it is the shorter of the two directions. It is infinite if the points are on
    different strokes.
    """
    arc, stroke = strokes.arc, strokes.stroke
    direct = np.abs(arc[point_a] - arc[point_b])
    around = np.where(strokes.closed, strokes.length, np.inf)[stroke[point_a]] - direct
    return np.where(stroke[point_a] == stroke[point_b], np.minimum(direct, np.abs(around)), np.inf)


def _measure(
    mesh: TangentMesh, samples: Strokes, tangent: np.ndarray, grid: PointGrid, batch: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return `LateralGaps.gap` and `nearest_distance` for the samples of a batch."""
    stroke = samples.stroke
    query, other = grid.pairs_within(samples.points[batch], SEARCH_RADIUS * samples.spacing[batch])
    sample = batch[query]
    distinct = stroke[sample] != stroke[other]
    distinct |= _arc_distance(samples, sample, other) > MIN_SELF_ARC * samples.spacing[sample]
    distinct &= dot(samples.normal[sample], samples.normal[other]) > 0.3
    query, other, sample = query[distinct], other[distinct], sample[distinct]
    normal = normalize(samples.normal[sample] + samples.normal[other])
    delta = samples.points[other] - samples.points[sample]
    height = dot(delta, normal)
    same_family = np.abs(height) < 0.5 * np.sqrt(dot(delta, delta))
    sample_a, sample_b = sample[same_family], other[same_family]

    def member_at(at: np.ndarray) -> np.ndarray:
        return transport(samples.member[at], mesh.normal[samples.triangle[at]], samples.normal[at])

    same_family[same_family] = mesh.is_same_family(
        member_at(sample_a), samples.normal[sample_a], member_at(sample_b), samples.normal[sample_b]
    )
    query, other, sample, normal, delta, height = (
        values[same_family] for values in (query, other, sample, normal, delta, height)
    )
    tangential = delta - height[:, None] * normal
    half_angle = np.arccos(np.clip(dot(samples.normal[sample], samples.normal[other]), -1, 1)) / 2
    arc_ratio = np.where(half_angle > 1e-6, half_angle / np.sin(np.maximum(half_angle, 1e-6)), 1)
    distance = np.sqrt(dot(tangential, tangential)) * arc_ratio
    spacing = samples.spacing[sample]
    nearest_distance = np.full(len(batch), np.inf)
    np.minimum.at(nearest_distance, query, distance / spacing)
    forward = dot(tangential, tangent[sample])
    alongside = np.abs(forward) <= 0.6 * SAMPLE_STEP * spacing + 0.05 * distance
    side = (dot(tangential, np.cross(samples.normal[sample], tangent[sample])) < 0).astype(np.intp)
    gap = np.full((len(batch), 2), np.inf)
    np.minimum.at(gap, (query[alongside], side[alongside]), (distance / spacing)[alongside])
    return gap, nearest_distance


def _tangents(samples: Strokes) -> np.ndarray:
    """Return the (n, 3) unit tangents of strokes."""
    tangent = np.zeros_like(samples.points)
    tangent[1:] = np.diff(samples.points, axis=0)
    first = samples.start[:-1]
    tangent[first] = tangent[first + 1]
    return normalize(tangent)


def _sides_with_room(
    mesh: TangentMesh, samples: Strokes, tangent: np.ndarray, sample: np.ndarray
) -> np.ndarray:
    """Return `LateralGaps.has_room` for samples."""
    triangle, weights = samples.triangle[sample], samples.weights[sample]
    direction = dot(tangent[sample], mesh.x[triangle]) + 1j * dot(tangent[sample], mesh.y[triangle])
    direction /= np.maximum(np.abs(direction), 1e-300)
    particles = SurfaceParticles(triangle, weights, direction, np.ones(len(sample)))
    has_room = np.empty((len(sample), 2), dtype=bool)
    for side, rotation in enumerate((1j, -1j)):
        length = 1.25 * samples.spacing[sample]
        *_, walked = trace_geodesics(mesh, particles, direction * rotation, length)
        has_room[:, side] = walked >= 0.999 * length
    return has_room
