"""Trace evenly spaced strokes on a tangent mesh, and close the strokes that return to their first point."""

from dataclasses import replace

import numpy as np

from ..core.errors import RosyError
from ..core.progress import progress, report
from ..field.blocks import joined, mask
from ..field.formats.polygons import offsets_from_sizes
from ..field.frames import dot, normalize
from .placement import StreamlinePlacer
from .seeding import candidate_seeds, seeds_around_singularities, thinned_seeds, uncovered_seeds
from .separation import enforce_separation
from .spacing import CornerSpacing
from .stroke_set import Strokes
from .surface_particles import SurfaceParticles, TracedPath, advance
from .tangent_mesh import TangentMesh

#: Label of the progress.
TRACING = "tracing strokes"

#: Number of samples by which the ends of strokes grow between two attempts to seed beside strokes.
SAMPLES_PER_SEEDING = 8

#: Distances, in spacings, between the seeds of the first, second and third round of seeding.
SEED_SPACINGS = (96.0, 24.0, 6.0)

#: A phase of growth ends when the number of growing ends falls below this fraction of its maximum in the
#: phase.
STRAGGLER_RATIO = 0.1

#: Factors of the minimum length of strokes in the first phase and in later phases, and factor of
#: the minimum separation for the strokes that fill the last gaps.
FIRST_LENGTH_FACTOR, SECOND_LENGTH_FACTOR, FILL_SEPARATION_FACTOR = 3.3, 1.7, 0.85

#: Strokes around singularities grow before all others, so that the ends of others do not form a ring around
#: the singularity. They first grow by the numbers of samples `FIRST_WARMUP`, with a minimum separation of
#: `WARMUP_SEPARATION` spacings, and then by `SECOND_WARMUP` with the usual one.
FIRST_WARMUP, SECOND_WARMUP, WARMUP_SEPARATION = (3, 3), (2, 2, 2, 2, 2), 0.6

#: Largest angle in radians between the field and a stroke that is traced again to close.
MAX_CLOSING_ANGLE = np.radians(0.09)

#: A stroke can be closed only if the distance between its ends is at most this, along and across the stroke,
#: in spacings.
MAX_FORWARD_GAP, MAX_LATERAL_GAP = 1.5, 0.4

#: Minimum length of a loop in spacings.
MIN_LOOP_LENGTH = 6.0

#: Maximum number of iterations of the secant method, and largest distance in spacings between the end of a
#: loop and its first point after them.
MAX_ITERATIONS, CLOSING_TOLERANCE = 4, 1e-3

#: Step of a particle in spacings, and the number of steps between two reports.
TRACE_STEP, STEPS_PER_REPORT = 0.5, 8


def trace_on_mesh(mesh: TangentMesh, spacing: CornerSpacing, surface_name: str) -> Strokes:
    """Cover a tangent mesh with evenly spaced strokes along its field.

    Parameters
    ----------
    mesh : TangentMesh
    spacing : CornerSpacing
        Spacing between strokes of the same family.
    surface_name : str
        Name of the surface in error messages.

    Returns
    -------
    Strokes
        Strokes in world space, all with the same value of `Strokes.family`. `label_families` then assigns
        families.

    Raises
    ------
    RosyError
        If the spacing is not above 0, or it is so small that there would be too many strokes.
    """
    if not (np.isfinite(spacing.values).all() and (spacing.values > 0).all()):
        raise RosyError(f"{surface_name}: the spacing of strokes must be above 0")
    placer = StreamlinePlacer(mesh, spacing)
    min_length = placer.rules.min_length
    with progress(0.0, 0.9):
        place_streamlines(placer)
    with progress(0.9, 0.92):
        strokes = collect(placer)
    del placer  # its samples take more memory than the strokes
    with progress(0.92, 0.95):
        strokes = close_loops(mesh, strokes, spacing)
    with progress(0.95, 1.0):
        return enforce_separation(mesh, strokes, min_length)


def place_streamlines(placer: StreamlinePlacer) -> None:
    """Seed strokes and let them grow until there is no room left.

    1. Start strokes around singularities.
    2. Add seeds in a few rounds, from coarse to fine, with a long minimum length.
    3. Seed again beside strokes, with a shorter minimum length.
    4. Let strokes that yielded (ended at wide gaps) continue, with a smaller separation.
    5. Fill the remaining gaps, with the minimum length of the rules.
    """
    rules = placer.rules
    separation = min(WARMUP_SEPARATION, rules.min_separation)
    placer.rules = replace(rules, min_separation=separation, max_gap=np.inf)
    placer.add_seeds(seeds_around_singularities(placer.mesh, placer.spacing.values))
    for index, sample_count in enumerate(FIRST_WARMUP + SECOND_WARMUP):
        report(0.0, TRACING)
        if index == len(FIRST_WARMUP):
            placer.rules = replace(rules, max_gap=np.inf)
        if len(placer.tips):
            placer.grow(sample_count)
    placer.suspend()
    placer.rules = replace(rules, min_length=FIRST_LENGTH_FACTOR * rules.min_length)
    candidates = candidate_seeds(placer.mesh, placer.spacing.values)
    for seed_spacing in SEED_SPACINGS:
        _add_uncovered_seeds(placer, candidates, seed_spacing)
        _grow_until(placer, STRAGGLER_RATIO)
    placer.rescan(replace(rules, min_length=SECOND_LENGTH_FACTOR * rules.min_length))
    _add_uncovered_seeds(placer, candidates, SEED_SPACINGS[-1])
    _grow_until(placer, STRAGGLER_RATIO)
    separation = FILL_SEPARATION_FACTOR * rules.min_separation
    fill_rules = replace(rules, min_separation=separation, max_gap=np.inf)
    placer.resume_yielded(replace(fill_rules, min_length=SECOND_LENGTH_FACTOR * rules.min_length))
    _grow_until(placer, STRAGGLER_RATIO)
    placer.rescan(fill_rules)
    _grow_until(placer)
    # There may be gaps without a stroke beside them, where all strokes were too short for the earlier phases.
    _add_uncovered_seeds(placer, candidates)
    _grow_until(placer)


def _add_uncovered_seeds(
    placer: StreamlinePlacer, candidates: SurfaceParticles, seed_spacing: float = 0.0
) -> None:
    """Start strokes at candidate seeds that are not near a stroke of their family.

    Seeds are chosen about `seed_spacing` spacings apart. If it is 0, all candidates are tried.
    """
    seeds = uncovered_seeds(placer.samples, candidates)
    if seed_spacing and len(seeds):
        median = float(np.median(placer.spacing.values))
        ratio = placer.samples.spacing_at(seeds) / median
        seeds = thinned_seeds(placer.mesh, seeds, seed_spacing * median, ratio)
    placer.add_seeds(seeds)


def _grow_until(placer: StreamlinePlacer, straggler_ratio: float = 0.0) -> None:
    """Alternate between growing strokes and seeding new ones beside them, until few or none grow.

    It ends when the number of growing ends falls below `straggler_ratio` times its maximum so far, or when
    nothing grows any more.
    """
    max_tips = 0
    while True:
        report(placer.samples.coverage, TRACING)
        seeded = placer.seed_neighbors()
        if not seeded and not len(placer.tips):
            if not placer.samples.has_open_sides:
                return
            # Each call closes the sides that it tried. Try the remaining sides twice more.
            if not placer.seed_neighbors() and not placer.seed_neighbors():
                return
        tip_count = len(placer.tips)
        max_tips = max(max_tips, tip_count)
        if tip_count < straggler_ratio * max_tips:
            return
        if tip_count:
            placer.grow(SAMPLES_PER_SEEDING)


def collect(placer: StreamlinePlacer) -> Strokes:
    """Return the strokes of a placer, all with the same value of `Strokes.family`."""
    report(0.0, "collecting strokes")
    samples = placer.samples
    columns = [np.concatenate(column) for column in zip(*placer.segments, strict=True)]
    placer.segments.clear()
    keep = np.flatnonzero(placer.strokes.alive[columns[0]])
    stroke, sign, triangle, begin_weights, weights, direction = (column[keep] for column in columns)
    del columns
    report(0.5, "collecting strokes")
    # Each segment adds one point: its end in the forward half of a stroke, its beginning in the
    # backward half. The first point is the end of the last backward segment, or the seed.
    backward = np.flatnonzero(sign < 0)
    stroke_ids = np.unique(stroke)
    last_backward = np.full(placer.strokes.count, -1)
    last_backward[stroke[backward]] = backward
    last_backward = last_backward[stroke_ids]
    seed, is_seed = placer.strokes.seed_sample[stroke_ids], last_backward < 0
    first_triangle = np.where(is_seed, samples.triangle[seed], triangle[last_backward])
    first_weights = np.where(is_seed[:, None], samples.weights[seed], weights[last_backward])
    first_direction = np.where(is_seed, samples.local_direction[seed], -direction[last_backward])
    weights[backward] = begin_weights[backward]
    rank = sign * (np.arange(len(stroke)) + 1.0)
    rank = np.concatenate([rank, np.where(is_seed, 0.0, -last_backward - 1.5)])
    stroke = np.concatenate([stroke, stroke_ids])
    order = np.lexsort((rank, stroke))
    triangle = np.concatenate([triangle, first_triangle])[order].astype(np.int32)
    weights = np.concatenate([weights, first_weights])[order]
    direction = np.concatenate([direction * sign, first_direction])[order]
    points = triangle, weights, direction
    return _strokes_on_mesh(placer.mesh, placer.spacing, stroke[order], points)


def _strokes_on_mesh(
    mesh: TangentMesh, spacing: CornerSpacing, stroke: np.ndarray, points: tuple[np.ndarray, ...]
) -> Strokes:
    """Make open strokes from n points that were traced on a mesh. All strokes are in one family.

    Parameters
    ----------
    mesh : TangentMesh
    spacing : CornerSpacing
        Required spacing on the mesh.
    stroke : (n,) ndarray of int
        The stroke of each point, as an ascending number. Not all numbers have to occur.
    points : tuple of (n, ...) ndarray
        Triangles and barycentric coordinates of the points, and unit directions of the strokes in the frames
        of the triangles.
    """
    triangle, weights, direction = points
    count = np.unique(stroke, return_counts=True)[1]
    return Strokes(
        points=mesh.points_at(triangle, weights),
        start=offsets_from_sizes(count),
        family=np.zeros(len(count), dtype=np.int32),
        names=("family 1",),
        face=mesh.face[triangle],
        triangle=triangle,
        weights=weights,
        normal=mesh.shading_normals_at(triangle, weights),
        member=mesh.to_world(triangle, direction),
        spacing=spacing.at(*points),
        width=np.ones(len(triangle)),
        closed=np.zeros(len(count), dtype=bool),
    )


# --- closed strokes ---------------------------------------------------------------------------------


def close_loops(mesh: TangentMesh, strokes: Strokes, spacing: CornerSpacing) -> Strokes:
    """Close strokes whose two ends almost meet.

    A stroke around a tube stops growing when it comes near its own other end. If its ends almost meet, it is
    traced again from its first point, at a small constant angle to the field. The secant method finds
    the angle at which the stroke arrives at its first point. A stroke stays open if the method does not
    converge, or if the angle is larger than `MAX_CLOSING_ANGLE`.

    Parameters
    ----------
    mesh : TangentMesh
        The mesh on which the strokes were traced.
    strokes : Strokes
        Strokes before `label_families`, all with the same value of `Strokes.family`.
    spacing : CornerSpacing

    Returns
    -------
    Strokes
        The open strokes, followed by the closed ones.
    """
    candidates = _candidates(strokes)
    if not len(candidates):
        return strokes
    first, last = strokes.start[:-1][candidates], strokes.start[1:][candidates] - 1
    tolerance = CLOSING_TOLERANCE * strokes.spacing[first]
    # The first two points of the secant method are angle 0 with the offset of the stroke as it was
    # traced, and the angle that would remove this offset if the stroke were straight.
    angle_before = np.zeros(len(candidates))
    offset_before = _left_offset(strokes, first, strokes.points[last])
    angle = -offset_before / strokes.length[candidates]
    angle = np.clip(angle, -MAX_CLOSING_ANGLE, MAX_CLOSING_ANGLE)
    for iteration in range(MAX_ITERATIONS):
        with progress(iteration / MAX_ITERATIONS, (iteration + 1) / MAX_ITERATIONS):
            path, offset, passed = _trace_loops(mesh, strokes, candidates, angle)
        if (np.abs(offset) <= tolerance).all():
            break
        change = offset - offset_before
        step = -offset * (angle - angle_before)
        correction = np.divide(step, change, out=np.zeros_like(angle), where=change != 0)
        angle_before, offset_before = angle, offset
        angle = angle + np.clip(correction, -MAX_CLOSING_ANGLE, MAX_CLOSING_ANGLE)
    closes = passed & (np.abs(offset) <= tolerance) & (np.abs(angle) <= MAX_CLOSING_ANGLE)
    if not closes.any():
        return strokes
    is_open = ~mask(len(strokes), candidates[closes])
    start = _particles_at_start(mesh, strokes, first[closes])
    keep = closes[path.particle]
    particle = np.concatenate([np.flatnonzero(closes), path.particle[keep]])
    order = np.argsort(particle, kind="stable")
    triangle = np.concatenate([start.triangle, path.triangle[keep]])[order]
    weights = np.concatenate([start.weights, path.end_weights[keep]])[order]
    direction = np.concatenate([start.member, path.direction[keep]])[order]
    loops = _strokes_on_mesh(mesh, spacing, particle[order], (triangle, weights, direction))
    loops = replace(loops, closed=np.ones(len(loops), dtype=bool))
    return Strokes.join([strokes.select(is_open), loops])


def _left_offset(strokes: Strokes, first: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Return (n,) float64: how far points are to the left of the first points of strokes.

    Distances are in world space, and negative to the right. `first` holds the indices of the first points of
    n strokes, and `points`, (n, 3), one point for each of them. Left is relative to the direction of the
    stroke at its first point, seen from outside the surface.
    """
    left = np.cross(strokes.normal[first], strokes.member[first])
    return dot(points - strokes.points[first], normalize(left))


def _candidates(strokes: Strokes) -> np.ndarray:
    """Return the indices of open strokes whose last point is near their first point."""
    first, last = strokes.start[:-1], strokes.start[1:] - 1
    spacing, length = strokes.spacing[first], strokes.length
    gap = strokes.points[first] - strokes.points[last]
    forward = dot(gap, normalize(strokes.member[first] + strokes.member[last]))
    lateral = np.sqrt(np.maximum(dot(gap, gap) - forward * forward, 0))
    is_candidate = (dot(strokes.member[first], strokes.member[last]) > 0.8) & ~strokes.closed
    is_candidate &= dot(strokes.normal[first], strokes.normal[last]) > 0.8
    is_candidate &= np.abs(forward) < MAX_FORWARD_GAP * spacing
    is_candidate &= lateral < np.minimum(MAX_LATERAL_GAP * spacing, 2 * MAX_CLOSING_ANGLE * length)
    return np.flatnonzero(is_candidate & (length > MIN_LOOP_LENGTH * spacing))


def _trace_loops(
    mesh: TangentMesh, strokes: Strokes, candidates: np.ndarray, angle: np.ndarray
) -> tuple[TracedPath, np.ndarray, np.ndarray]:
    """Trace n strokes from their first points until they pass these points again or miss them.

    Parameters
    ----------
    mesh : TangentMesh
    strokes : Strokes
    candidates : (n,) ndarray of int
        Indices of the strokes that are traced.
    angle : (n,) ndarray
        Angle between the traced direction and the field, in radians, to the left of the field.

    Returns
    -------
    path : TracedPath
        Segments of the traced strokes. `TracedPath.particle` is the position in `candidates`.
    left_offset : (n,) float64 ndarray
        Signed distance, to the left of the first point, at which the stroke passed it, in world space.
    passed : (n,) bool ndarray
        Whether the stroke passed its first point.
    """
    first = strokes.start[:-1][candidates]
    origin, tangent = strokes.points[first], strokes.member[first]
    spacing, length = strokes.spacing[first], strokes.length[candidates]
    particles = _particles_at_start(mesh, strokes, first)
    total_walked = np.zeros(len(candidates))
    passed = np.zeros(len(candidates), dtype=bool)
    active = np.arange(len(candidates))
    paths: list[TracedPath] = []
    while len(active):
        if len(paths) % STEPS_PER_REPORT == 0:
            report(1 - len(active) / len(candidates), "closing loops")
        current = particles.take(active)
        to_origin = origin[active] - mesh.points_at(current.triangle, current.weights)
        forward = dot(to_origin, tangent[active])
        is_near = dot(to_origin, to_origin) < spacing[active] ** 2
        is_near &= (total_walked > length - 2 * spacing)[active]
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
        paths.append(path._replace(particle=active[path.particle]))
        particles.assign(active, current)
        total_walked[active] += walked
        active = active[~ended & (walked > 0)]
    end = mesh.points_at(particles.triangle, particles.weights)
    return joined(paths), _left_offset(strokes, first, end), passed


def _particles_at_start(mesh: TangentMesh, strokes: Strokes, first: np.ndarray) -> SurfaceParticles:
    """Return particles at the points with the indices `first`, which move along their strokes."""
    triangle, weights = strokes.triangle[first], strokes.weights[first]
    member = mesh.members_at(triangle, weights, mesh.to_frame(triangle, strokes.member[first]))
    return SurfaceParticles(triangle, weights, member, np.ones(len(first)))
