"""Measure how evenly strokes are spaced, independently of the code that places them.

At sample points along all strokes, and on either side of each, the gap is the distance across the
stroke to the next stroke of its family, divided by the requested spacing. The next stroke is the first
one that the line across meets. Distances are chords, corrected for the curvature of the surface by the
angle between the two normals.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from rosy_addon.field.frames import dot, normalize
from rosy_addon.strokes.point_grid import PointGrid
from rosy_addon.strokes.stroke_set import Strokes
from rosy_addon.strokes.surface_particles import SurfaceParticles, trace_geodesics
from rosy_addon.strokes.tangent_mesh import TangentMesh

#: Distance between sample points, and search radius, as fractions of the spacing.
SAMPLE_STEP, SEARCH_RADIUS = 0.1, 2.0

#: Distance along a stroke, in spacings, beyond which it counts as another stroke.
MIN_SELF_ARC = 2.5


class LateralGaps(NamedTuple):
    """At n points of strokes, on their left (0) and right (1).

    Attributes
    ----------
    point : (n,) int64 ndarray
        Of the strokes.
    gap : (n, 2) float64 ndarray
        In spacings; inf if there is none within `SEARCH_RADIUS`.
    has_room : (n, 2) bool ndarray
        Whether the surface goes on to that side for 1.25 spacings: where it ends, or a crease
        stops strokes, none is to be expected.
    nearest_distance : (n,) float64 ndarray
        How far the nearest point of any other stroke of the family is, in any direction.
    """

    point: np.ndarray
    gap: np.ndarray
    has_room: np.ndarray
    nearest_distance: np.ndarray

    def evenness(self, tolerance: float = 0.25) -> float:
        """Return the fraction of the gaps, on sides with room, that are within a tolerance of 1."""
        gap = self.gap[self.has_room]
        return float(np.mean(np.abs(gap - 1) <= tolerance)) if len(gap) else 1.0


def lateral_gaps(mesh: TangentMesh, strokes: Strokes, max_points: int = 20_000) -> LateralGaps:
    """Measure all strokes that were traced on a tangent mesh, before hidden ones are removed.

    The gaps are measured at about `max_points` evenly distributed points.
    """
    arc = strokes.arc
    step = np.diff(arc, prepend=0)
    step[strokes.start[:-1]] = 0
    samples = strokes.subdivided(np.ceil(step / (SAMPLE_STEP * strokes.spacing)).clip(1, 1000))
    tangent = _tangents(samples)
    grid = PointGrid(SEARCH_RADIUS * float(np.median(samples.spacing)), len(samples.points))
    grid.add(samples.points)
    sample = np.flatnonzero(np.isfinite(samples.weights[:, 0]))
    point = np.flatnonzero(np.isfinite(strokes.weights[:, 0]))
    stride = max(len(sample) // max_points, 1)
    sample, point = sample[::stride], point[::stride]
    gap, nearest_distance = np.full((len(sample), 2), np.inf), np.full(len(sample), np.inf)
    for start in range(0, len(sample), 1 << 12):
        batch = slice(start, start + (1 << 12))
        gap[batch], nearest_distance[batch] = _measure(mesh, samples, tangent, grid, sample[batch])
    return LateralGaps(
        point, gap, _sides_with_room(mesh, samples, tangent, sample), nearest_distance
    )


def _measure(
    mesh: TangentMesh, samples: Strokes, tangent: np.ndarray, grid: PointGrid, batch: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    stroke = samples.stroke
    query, other = grid.pairs_within(samples.points[batch], SEARCH_RADIUS * samples.spacing[batch])
    sample = batch[query]
    distinct = stroke[sample] != stroke[other]
    distinct |= samples.arc_distance(sample, other) > MIN_SELF_ARC * samples.spacing[sample]
    distinct &= dot(samples.normal[sample], samples.normal[other]) > 0.3
    query, other, sample = query[distinct], other[distinct], sample[distinct]
    normal = normalize(samples.normal[sample] + samples.normal[other])
    delta = samples.points[other] - samples.points[sample]
    height = dot(delta, normal)
    same_family = np.abs(height) < 0.5 * np.sqrt(dot(delta, delta))
    sample_a, sample_b = sample[same_family], other[same_family]
    same_family[same_family] = mesh.is_same_family(
        mesh.transport_to_normal(
            samples.triangle[sample_a], samples.member[sample_a], samples.normal[sample_a]
        ),
        samples.normal[sample_a],
        mesh.transport_to_normal(
            samples.triangle[sample_b], samples.member[sample_b], samples.normal[sample_b]
        ),
        samples.normal[sample_b],
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
    other_stroke = stroke[sample] != stroke[other]
    np.minimum.at(nearest_distance, query[other_stroke], (distance / spacing)[other_stroke])
    forward = dot(tangential, tangent[sample])
    alongside = np.abs(forward) <= 0.6 * SAMPLE_STEP * spacing + 0.05 * distance
    side = (dot(tangential, np.cross(samples.normal[sample], tangent[sample])) < 0).astype(np.intp)
    gap = np.full((len(batch), 2), np.inf)
    np.minimum.at(gap, (query[alongside], side[alongside]), (distance / spacing)[alongside])
    return gap, nearest_distance


def _tangents(samples: Strokes) -> np.ndarray:
    """(n, 3) unit tangents."""
    tangent = np.zeros_like(samples.points)
    tangent[1:] = np.diff(samples.points, axis=0)
    first = samples.start[:-1]
    tangent[first] = tangent[first + 1]
    return normalize(tangent)


def _sides_with_room(
    mesh: TangentMesh, samples: Strokes, tangent: np.ndarray, sample: np.ndarray
) -> np.ndarray:
    triangle, weights = samples.triangle[sample], samples.weights[sample]
    direction = dot(tangent[sample], mesh.x[triangle]) + 1j * dot(tangent[sample], mesh.y[triangle])
    direction /= np.maximum(np.abs(direction), 1e-300)
    particles = SurfaceParticles(triangle, weights, direction, np.ones(len(sample)))
    has_room = np.empty((len(sample), 2), dtype=bool)
    for side, rotation in enumerate((1j, -1j)):
        length = 1.25 * samples.spacing[sample]
        _, walked = trace_geodesics(mesh, particles, direction * rotation, length)
        has_room[:, side] = walked >= 0.999 * length
    return has_room
