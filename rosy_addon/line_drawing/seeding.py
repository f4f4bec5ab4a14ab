"""Choose seeds of strokes: around singularities, evenly distributed on a mesh, or beside strokes.

Seeds beside strokes follow Jobard and Lefer (1997). Along each side of a stroke only one seed is tried at a
time, in the middle of the longest open run: consecutive samples of the stroke that have no stroke beside them
on that side yet.

Around singularities, there is one seed in each sector (the region between two streamlines that end at the
singularity), all at the same distance. For a singularity of index i at z = 0 of the complex plane, the map
z -> z^(1 - i) turns nearby streamlines into parallel straight lines on a cone. A streamline is nearest to the
apex where its tangent is perpendicular to the direction from the apex. If the nearest streamlines have the
same distance in all sectors, the spacing is consistent all around the singularity.
Without these seeds, strokes would reach the singularity from elsewhere, at different distances in different
sectors.
"""

import numpy as np

from ..core.progress import report
from ..field.blocks import mask, row_blocks
from ..field.frames import dot
from .lateral_neighbors import MAX_COVERED_GAP, find_lateral_neighbors
from .point_grid import LEVEL_RATIO, PointGrid, grid_levels
from .samples import SAMPLE_STEP, StrokeSamples
from .surface_particles import SurfaceParticles, trace_geodesics
from .tangent_mesh import TangentMesh

#: Points with candidate seeds, per area of one squared spacing.
CANDIDATE_DENSITY = 0.35

#: After a seed was tried beside a stroke, no other seed is tried within this distance along the stroke,
#: in spacings.
RETRY_ARC = 1.0

#: Largest distance between consecutive open samples in one run, in multiples of `SAMPLE_STEP`.
MAX_RUN_STEP = 1.6

#: A seed has room if the geodesic to it covers at least this fraction of its length before the surface ends.
MIN_WALKED_RATIO = 0.999

#: Gaps between strokes that are wider than this, in spacings, get two new strokes; other gaps get one.
MIN_TWO_STROKE_GAP = 2.5

#: Number of seeds that are compared with samples at once. It bounds memory.
SEED_BATCH_SIZE = 1 << 12

#: Number of geodesic rays that are traced from each singularity.
RAY_COUNT = 72

#: Distance from a singularity, in spacings, at which the strokes on both sides of a separatrix are
#: one spacing apart. The first value is for positive indices, where strokes diverge; the second is for
#: negative indices, where they converge.
DIVERGING_DISTANCE, CONVERGING_DISTANCE = 0.8, 1.0

#: A singularity gets seeds only if the nearest other one is at least this far away, in spacings.
MIN_ISOLATION = 6.0

#: A triangle can have a singularity only if its three values z span a triangle in the complex plane whose
#: doubled area is more than this fraction of the sum of their squared magnitudes.
MIN_TURN_RATIO = 1e-6


# --- around singularities ---------------------------------------------------------------------------


def singularities(mesh: TangentMesh) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Find the zeros of the interpolated field.

    A triangle contains a zero if the phase of z does not return to its value on the way around it, but changes by a
    multiple of 2 pi. Along an edge on which the phase changes by nearly pi, the two triangles may disagree on the sign
    of the change, because z is not quite continuous across edges. A zero near the edge would then be counted in both
    triangles or in none. So the sign of the smaller change is used in both. On a closed surface, the sum of the indices
    is then the Euler characteristic (Poincare-Hopf theorem), unless triangles are too large for the curvature.

    Returns
    -------
    triangle : (n,) int32 ndarray
        Triangles that contain a zero.
    weights : (n, 3) float64 ndarray
        Barycentric coordinates of the zeros.
    index : (n,) float64 ndarray
        Singularity index, a multiple of 1/N: how many times a member of the field rotates on a path around the
        zero.
    """
    z = mesh.z
    turn = np.angle(z[:, [2, 0, 1]] * z[:, [1, 2, 0]].conj())  # along edge k
    other_turn = np.where(mesh.neighbor < 0, -turn, turn[mesh.neighbor, mesh.neighbor_edge])
    excess = np.rint((turn + other_turn) / (2 * np.pi))
    is_first = np.arange(len(z))[:, None] < mesh.neighbor
    size, other_size = np.abs(turn), np.abs(other_turn)
    excess[(size < other_size) | ((size == other_size) & ~is_first)] = 0
    winding = np.rint(turn.sum(axis=1) / (2 * np.pi) - excess.sum(axis=1))
    # The point 0 divides the triangle of the three values z into three triangles. These are twice their
    # signed areas.
    sub_area = (z[:, [1, 2, 0]].conj() * z[:, [2, 0, 1]]).imag
    is_wide = np.abs(sub_area.sum(axis=1)) > MIN_TURN_RATIO * (z.real**2 + z.imag**2).sum(axis=1)
    triangle = np.flatnonzero((winding != 0) & (is_wide | excess.any(axis=1)))
    weights = np.maximum(sub_area[triangle] * np.sign(winding[triangle])[:, None], 0)
    weights[~weights.any(axis=1)] = 1
    weights /= weights.sum(axis=1, keepdims=True)
    return triangle.astype(np.int32), weights, winding[triangle] / mesh.degree


def seeds_around_singularities(mesh: TangentMesh, spacing: np.ndarray) -> SurfaceParticles:
    """Return seeds around singularities, one in each sector between two streamlines that end there.

    Only singularities that are `MIN_ISOLATION` spacings away from all others get seeds.

    Parameters
    ----------
    mesh : TangentMesh
    spacing : (T, 3) ndarray
        Spacing at the corners of the triangles, in world space.

    Returns
    -------
    SurfaceParticles
    """
    triangle, weights, index = singularities(mesh)
    local_spacing = np.einsum("nk,nk->n", weights, spacing[triangle])
    is_isolated = _is_isolated(mesh.points_at(triangle, weights), MIN_ISOLATION * local_spacing)
    isolated = np.flatnonzero(is_isolated & (index < 1))
    distance = (seed_distance(index[isolated]) * local_spacing[isolated]).repeat(RAY_COUNT)
    ray = np.tile(np.exp(2j * np.pi * np.arange(RAY_COUNT) / RAY_COUNT), len(isolated))
    triangle = triangle[isolated].repeat(RAY_COUNT)
    weights = weights[isolated].repeat(RAY_COUNT, axis=0)
    particles = SurfaceParticles(triangle, weights, 1j * ray, np.ones(len(ray)))
    arrived, _, walked = trace_geodesics(mesh, particles, ray, distance)
    radial = mesh.points_at(arrived.triangle, arrived.weights) - mesh.points_at(triangle, weights)
    tangential = 1j * mesh.to_frame(arrived.triangle, radial)
    tangential /= np.maximum(np.abs(tangential), 1e-300)
    arrived.member = mesh.members_at(arrived.triangle, arrived.weights, tangential)
    deviation = np.angle(arrived.member * tangential.conj())
    deviation[(walked < 0.999 * distance) | (arrived.member == 0)] = np.nan
    deviation = deviation.reshape(-1, RAY_COUNT)
    # On the circle around the singularity, the angle from the tangent of the circle to the member decreases.
    # Seeds are at the points where this angle is zero.
    next_deviation = np.roll(deviation, -1, axis=1)
    is_seed = (deviation > 0) & (next_deviation <= 0)
    is_seed &= deviation - next_deviation < np.pi / mesh.degree
    return arrived.take(np.flatnonzero(is_seed))


def seed_distance(index: np.ndarray) -> np.ndarray:
    """Return (n,) float64: the distance from a singularity to the strokes around it, in spacings.

    Near a singularity, streamlines are parallel lines on a cone. The nearest lines pass the apex at half the
    distance between two lines. If the index is 1/2 or more, they pass it at the full distance between two
    lines, because another stroke then lies on the only separatrix.
    """
    ratio = np.where(index < 0.5, 0.5, 1.0)
    separation_distance = np.where(index > 0, DIVERGING_DISTANCE, CONVERGING_DISTANCE)
    return ((1 - index) * ratio * separation_distance**-index) ** (1 / (1 - index))


def _is_isolated(points: np.ndarray, radius: np.ndarray) -> np.ndarray:
    """Return (n,) bool: whether no other point is within the distance `radius`, (n,), of each point."""
    if not len(points):
        return np.zeros(0, dtype=bool)
    grid = PointGrid(float(np.median(radius)), len(points))
    grid.add(points, radius)
    query, other = grid.pairs_within(points, radius)
    return ~mask(len(points), query[query != other])


# --- on the mesh ----------------------------------------------------------------------------------


def candidate_seeds(mesh: TangentMesh, corner_spacing: np.ndarray) -> SurfaceParticles:
    """Return seeds at evenly distributed points of the mesh, `CANDIDATE_DENSITY` points per squared spacing.

    Each point has a seed for each of the M different directions in which a streamline runs through it.

    Parameters
    ----------
    mesh : TangentMesh
    corner_spacing : (T, 3) ndarray
        Spacing at the corners of the triangles, in world space.
    """
    spacing = corner_spacing.mean(axis=1)
    cumulative = np.cumsum(CANDIDATE_DENSITY * mesh.area / spacing**2 * (mesh.z != 0).any(axis=1))
    count = int(np.ceil(cumulative[-1]))
    triangle = np.searchsorted(cumulative, (np.arange(count) + 0.5) * cumulative[-1] / count)
    triangle = np.minimum(triangle, len(cumulative) - 1).astype(np.int32)
    # A low-discrepancy sequence within triangles: multiples of irrational numbers.
    u = np.modf((np.arange(count) + 1) * 0.7548776662466927)[0]
    v = np.modf((np.arange(count) + 1) * 0.5698402909980532)[0]
    fold = u + v > 1
    u, v = np.where(fold, 1 - u, u), np.where(fold, 1 - v, v)
    weights = np.stack([1 - u - v, u, v], axis=1)
    member = mesh.members_at(triangle, weights, np.ones(count, dtype=complex))
    family = np.arange(mesh.family_count)
    member = (member[:, None] * np.exp(2j * np.pi * family / mesh.degree)).ravel()
    point = np.repeat(np.arange(count), len(family))
    seeds = SurfaceParticles(triangle[point], weights[point], member, np.ones(len(point)))
    return seeds.take(np.flatnonzero(member != 0))


def uncovered_seeds(samples: StrokeSamples, seeds: SurfaceParticles) -> SurfaceParticles:
    """Return the seeds that are not near a stroke of their family (one of the M line directions).

    Near means less than `MAX_COVERED_GAP` spacings away.
    """
    is_uncovered = np.zeros(len(seeds), dtype=bool)
    for batch in row_blocks(len(seeds), SEED_BATCH_SIZE):
        report(samples.coverage, "looking for gaps")
        with samples.probes(seeds.take(batch)) as probes:
            neighbors = find_lateral_neighbors(samples, probes, MAX_COVERED_GAP, np.inf)
        is_uncovered[batch] = ~neighbors.rejected
    return seeds.take(np.flatnonzero(is_uncovered))


def thinned_seeds(
    mesh: TangentMesh, seeds: SurfaceParticles, cell_size: float, spacing_ratio: np.ndarray
) -> SurfaceParticles:
    """Choose points of seeds about `cell_size` apart in world space, and return all seeds at these points.

    Each point has a seed for each line direction of the field.

    Parameters
    ----------
    mesh : TangentMesh
    seeds : SurfaceParticles
    cell_size : float
        Distance of the points where `spacing_ratio` is 1, in world space.
    spacing_ratio : (n,) ndarray
        Spacing of strokes at the seeds, relative to the median spacing on the mesh. The distance of the
        chosen points is `cell_size` times this ratio, rounded to a power of `LEVEL_RATIO` by
        `point_grid.grid_levels`.
    """
    position = mesh.points_at(seeds.triangle, seeds.weights)
    level = grid_levels(spacing_ratio, 1.0)
    chosen = np.zeros(len(seeds), dtype=bool)
    for number in np.unique(level).tolist():
        members = np.flatnonzero(level == number)
        size = cell_size * LEVEL_RATIO**number
        chosen[members[_is_nearest_to_cell_center(position[members], size)]] = True
    return seeds.take(np.flatnonzero(chosen))


def _is_nearest_to_cell_center(position: np.ndarray, cell_size: float) -> np.ndarray:
    """Return (n,) bool: whether a point is chosen as the nearest to the center of its grid cell.

    The bounding box of all points is divided into a grid of cells of at most `cell_size`. One point of each
    cell is chosen, and with it all points at exactly the same position.
    """
    low, extent = position.min(axis=0), np.ptp(position, axis=0)
    cell_counts = np.maximum(np.ceil(extent / cell_size), 1)
    grid_position = (position - low) * cell_counts / np.maximum(extent, 1e-300)
    cell = np.minimum(np.floor(grid_position), cell_counts - 1)
    center_offset = grid_position - cell - 0.5
    cell_index = (cell[:, 0] * cell_counts[1] + cell[:, 1]) * cell_counts[2] + cell[:, 2]
    order = np.lexsort((np.round(dot(center_offset, center_offset), 9), cell_index))
    first = order[np.unique(cell_index[order], return_index=True)[1]]
    to_chosen = position - position[first[np.searchsorted(cell_index[first], cell_index)]]
    return dot(to_chosen, to_chosen) == 0


# --- beside strokes -------------------------------------------------------------------------------


def longest_open_runs(
    samples: StrokeSamples, sample: np.ndarray, side: np.ndarray
) -> tuple[np.ndarray, ...]:
    """Find the middle of the longest open run on each side of each stroke.

    An open run consists of consecutive samples of a stroke that have no other stroke beside them on this
    side.

    Parameters
    ----------
    samples : StrokeSamples
    sample, side : (n,) ndarray of int
        Samples of strokes, each with a side on which it is open: 0 is left, 1 is right.

    Returns
    -------
    sample, side : (k,) ndarray of int
        The sample in the middle of each longest run, and its open side.
    nearby, nearby_side : (m,) ndarray of int
        All given samples and sides within `RETRY_ARC` of a middle on the same side of the same stroke. If a
        seed does not fit at the middle, a seed at these samples rarely does.
    """
    arc, key = samples.arc[sample], 2 * samples.stroke[sample].astype(np.int64) + side
    order = np.lexsort((arc, key))
    sample, side, arc, key = sample[order], side[order], arc[order], key[order]
    is_gap = np.diff(arc) > MAX_RUN_STEP * SAMPLE_STEP * samples.spacing[sample[1:]]
    first = np.concatenate([[0], np.flatnonzero((key[1:] != key[:-1]) | is_gap) + 1])
    length = np.diff(np.append(first, len(key)))
    by_length = np.lexsort((-length, key[first]))
    run = by_length[np.unique(key[first][by_length], return_index=True)[1]]
    middle = first[run] + length[run] // 2
    run_middle = middle[np.searchsorted(key[middle], key)]
    is_nearby = np.abs(arc - arc[run_middle]) <= RETRY_ARC * samples.spacing[sample]
    return sample[middle], side[middle], sample[is_nearby], side[is_nearby]


def lateral_seeds(
    samples: StrokeSamples, sample: np.ndarray, side: np.ndarray
) -> tuple[SurfaceParticles, np.ndarray]:
    """Return seeds for new strokes, one beside each of n samples.

    A seed is one spacing away from its sample. If there is a stroke on the other side of the gap, the seed is
    at half of the gap, or at a third of it if two new strokes fit.

    Parameters
    ----------
    samples : StrokeSamples
    sample, side : (n,) ndarray of int
        Samples, and the side on which each gets a seed: 0 is left, 1 is right.

    Returns
    -------
    seeds : SurfaceParticles
        The n seeds.
    has_room : (n,) bool ndarray
        False if the surface ends before the seed, or the field is zero there.
    """
    seeds, has_room = _lateral_points(samples, sample, side, np.ones(len(sample)))
    free_gap = _free_gap(samples, sample, seeds, has_room)
    bounded = np.flatnonzero(np.isfinite(free_gap))
    full_gap = 1 + free_gap[bounded]
    distance = full_gap / np.where(full_gap > MIN_TWO_STROKE_GAP, 3, 2)
    moved, has_room[bounded] = _lateral_points(samples, sample[bounded], side[bounded], distance)
    seeds.assign(bounded, moved)
    return seeds, has_room


def _lateral_points(
    samples: StrokeSamples, sample: np.ndarray, side: np.ndarray, distance: np.ndarray
) -> tuple[SurfaceParticles, np.ndarray]:
    """Return points beside samples, and (n,) bool: whether the surface and the field extend to the point.

    `side`, (n,), is the side of the sample on which the point is: 0 is left, 1 is right. `distance`, (n,), is
    the distance of the point from its sample in spacings.
    """
    particles = samples.particles(sample, np.ones(len(sample)))
    direction = samples.local_direction[sample] * np.where(side == 0, 1j, -1j)
    length = distance * samples.spacing[sample]
    arrived, _, walked = trace_geodesics(samples.mesh, particles, direction, length)
    return arrived, (walked >= MIN_WALKED_RATIO * length) & (arrived.member != 0)


def _free_gap(
    samples: StrokeSamples, sample: np.ndarray, seeds: SurfaceParticles, has_room: np.ndarray
) -> np.ndarray:
    """Return (n,) float64: the distances from seeds to the next stroke on the side away from their sample.

    They are in spacings, and infinite if there is no such stroke or if `has_room`, (n,), is false. `sample`
    holds the index of the sample of each seed.
    """
    free_gap = np.full(len(sample), np.inf)
    indices = np.flatnonzero(has_room)
    with samples.probes(seeds.take(indices)) as probes:
        to_sample = samples.position[sample[indices]] - samples.position[probes]
        left = np.cross(samples.normal[probes], samples.direction[probes])
        opposite_side = (dot(to_sample, left) > 0).astype(np.intp)
        gap = find_lateral_neighbors(samples, probes, 0.0, np.inf).gap
    free_gap[indices] = gap[np.arange(len(indices)), opposite_side]
    return free_gap
