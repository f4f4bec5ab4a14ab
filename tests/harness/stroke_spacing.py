"""Measure how evenly strokes are spaced, independently of the code that places them.

The gap is measured at points along all strokes, on both sides. It is the distance to the next
stroke of the same family, perpendicular to the stroke, divided by the required spacing. Distances
are chords, corrected to the length of an arc that bends by the angle between the two normals.
"""

from typing import NamedTuple

import numpy as np

from rosy_addon.field.frames import dot, normalize, transport
from rosy_addon.line_drawing.point_grid import PointGrid
from rosy_addon.line_drawing.stroke_set import Strokes
from rosy_addon.line_drawing.surface_particles import SurfaceParticles, trace_geodesics
from rosy_addon.line_drawing.tangent_mesh import TangentMesh

#: Distance between the points that are compared, and search radius, in spacings.
SAMPLE_STEP, SEARCH_RADIUS = 0.1, 2.0

#: Allowed difference of gaps from the spacing, and number of points at which they are measured.
TOLERANCE, MAX_POINTS = 0.25, 4000

#: Points of one stroke are compared only if they are farther apart along it than this, in spacings.
MIN_SELF_ARC = 2.5


class LateralGaps(NamedTuple):
    """The gaps of strokes on both sides.

    Attributes
    ----------
    evenness : float
        The fraction of gaps that differ from the required spacing by at most `TOLERANCE`. Sides on which the
        surface ends, or a crease, within 1.25 spacings do not count: no stroke is expected there.
    nearest : float
        Least distance to a point of another stroke of the family in any direction, in spacings.
    """

    evenness: float
    nearest: float


def lateral_gaps(mesh: TangentMesh, strokes: Strokes) -> LateralGaps:
    """Measure the gaps of strokes at about `MAX_POINTS` points, evenly distributed.

    Parameters
    ----------
    mesh : TangentMesh
        The mesh on which the strokes were traced.
    strokes : Strokes
        All strokes, before any are clipped or cut.
    """
    step = np.diff(strokes.arc, prepend=0)
    step[strokes.start[:-1]] = 0
    samples = strokes.subdivided(np.ceil(step / (SAMPLE_STEP * strokes.spacing)).clip(1, 1000))
    tangent = _tangents(samples)
    sample = np.flatnonzero(np.isfinite(samples.weights[:, 0]))
    sample = sample[:: max(len(sample) // MAX_POINTS, 1)]
    gap, nearest = _measure(mesh, samples, tangent, sample)
    gap = gap[_sides_with_room(mesh, samples, tangent, sample)]
    evenness = np.mean(np.abs(gap - 1) <= TOLERANCE) if len(gap) else 1.0
    return LateralGaps(float(evenness), nearest)


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
    mesh: TangentMesh, samples: Strokes, tangent: np.ndarray, sample: np.ndarray
) -> tuple[np.ndarray, float]:
    """Return the (n, 2) gaps at samples, infinite beyond the search radius, and `LateralGaps.nearest`."""
    grid = PointGrid(SEARCH_RADIUS * float(np.median(samples.spacing)), len(samples.points))
    grid.add(samples.points, SEARCH_RADIUS * samples.spacing)
    radius = SEARCH_RADIUS * samples.spacing[sample]
    query, other = grid.pairs_within(samples.points[sample], radius)
    own = sample[query]
    distinct = samples.stroke[own] != samples.stroke[other]
    distinct |= _arc_distance(samples, own, other) > MIN_SELF_ARC * samples.spacing[own]
    distinct &= dot(samples.normal[own], samples.normal[other]) > 0.3
    query, own, other = query[distinct], own[distinct], other[distinct]

    def member_at(at: np.ndarray) -> np.ndarray:
        return transport(samples.member[at], mesh.normal[samples.triangle[at]], samples.normal[at])

    delta = samples.points[other] - samples.points[own]
    height = dot(delta, normalize(samples.normal[own] + samples.normal[other]))
    compared = np.abs(height) < 0.5 * np.sqrt(dot(delta, delta))
    compared &= mesh.is_same_family(
        member_at(own), samples.normal[own], member_at(other), samples.normal[other]
    )
    query, own, other, delta, height = (
        values[compared] for values in (query, own, other, delta, height)
    )
    normal = normalize(samples.normal[own] + samples.normal[other])
    tangential = delta - height[:, None] * normal
    half_angle = np.arccos(np.clip(dot(samples.normal[own], samples.normal[other]), -1, 1)) / 2
    distance = np.sqrt(dot(tangential, tangential)) / np.sinc(half_angle / np.pi)
    forward = dot(tangential, tangent[own])
    alongside = np.abs(forward) <= 0.6 * SAMPLE_STEP * samples.spacing[own] + 0.05 * distance
    side = (dot(tangential, np.cross(samples.normal[own], tangent[own])) < 0).astype(np.intp)
    distance /= samples.spacing[own]
    gap = np.full((len(sample), 2), np.inf)
    np.minimum.at(gap, (query[alongside], side[alongside]), distance[alongside])
    return gap, float(distance.min(initial=np.inf))


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
    """Return (n, 2) bool: whether the surface continues on the sides of samples."""
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
