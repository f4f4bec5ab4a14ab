"""Trace evenly spaced strokes along the field of a mesh instance: seeding phases and collection."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..cache import Cache
from ..errors import RosyError
from ..field.frames import dot
from ..progress import Progress, Task, run_to_completion
from ..projection.gbuffer import MeshInstance
from .closed_strokes import close_loops
from .families import label_families
from .placement import MIN_TIPS, ROUNDS_PER_SEEDING, SeparationRules, StreamlinePlacer
from .separation import enforce_separation
from .singularity_seeds import seeds_around_singularities
from .stroke_set import Strokes
from .surface_particles import SurfaceParticles
from .tangent_mesh import build_tangent_mesh, corner_values, nearest_member

#: Candidate seeds per area of one squared spacing.
PROBE_DENSITY = 0.35

#: Distance in spacings between seeds that are added at once: in the first round, and the value at
#: which rounds stop. Each round divides it by 4.
MAX_SEED_SPACING, MIN_SEED_SPACING = 96.0, 6.0

#: A phase ends when fewer tips are left than this fraction of their largest number.
STRAGGLER_RATIO = 0.1

#: Factors of the minimum length of strokes in the first phase and in those after it, and factor of
#: the minimum separation for the strokes that fill the last gaps.
FIRST_LENGTH_FACTOR, SECOND_LENGTH_FACTOR, FILL_SEPARATION_FACTOR = 3.3, 1.7, 0.85

#: Steps by which strokes around singularities grow before all others, and their minimum separation
#: in spacings during these steps.
WARMUP_STEPS, WARMUP_SEPARATION = 6, 0.6


def trace_strokes(instance: MeshInstance, spacing: np.ndarray | float, **options) -> Strokes:
    """Run `trace_strokes_task` to its end."""
    return run_to_completion(trace_strokes_task(instance, spacing, **options))


def trace_strokes_task(
    instance: MeshInstance,
    spacing: np.ndarray | float,
    *,
    rules: SeparationRules | None = None,
    display: str = "smooth",
    cross_creases: bool = False,
    cache: Cache | None = None,
) -> Task[Strokes]:
    """Cover a mesh instance with evenly spaced strokes along its field.

    Parameters
    ----------
    instance : MeshInstance
        With a field.
    spacing : float, or (V,) or (F,) array_like
        Spacing between strokes of a family in world space: one value, or one for each vertex or
        face.
    rules : SeparationRules, optional
    display : {"smooth", "flat"}
        As in `build_tangent_mesh`.
    cross_creases : bool
        As in `build_tangent_mesh`.
    cache : Cache, optional
        Cache for corner fields.

    Yields
    ------
    Progress

    Returns
    -------
    Strokes
        World space, with families.

    Raises
    ------
    RosyError
        If there is no field, the spacing is not above 0, or it is so small that there would be too
        many strokes.
    """
    mesh = build_tangent_mesh(instance, display=display, cross_creases=cross_creases, cache=cache)
    corner_spacing = corner_values(mesh, spacing, instance.surface.name)
    if not (np.isfinite(corner_spacing).all() and (corner_spacing > 0).all()):
        raise RosyError(f"{instance.surface.name}: the spacing of strokes must be above 0")
    placer = StreamlinePlacer(mesh, corner_spacing, rules or SeparationRules())
    rules = placer.rules
    yield from place_streamlines_task(placer)
    strokes = close_loops(mesh, collect_strokes(placer), corner_spacing)
    strokes = enforce_separation(mesh, strokes, rules.min_length)
    return label_families(strokes, mesh)


def place_streamlines_task(placer: StreamlinePlacer) -> Task[None]:
    """Seed strokes and let them grow until there is no room left.

    1. Start strokes around singularities.
    2. Add seeds in a few rounds, from coarse to fine, with a long minimum length.
    3. Seed again beside strokes, with a shorter minimum length.
    4. Let strokes that yielded at wide gaps continue, with a smaller separation.
    5. Fill the remaining gaps, with the minimum length of the rules.
    """
    label = "tracing strokes"
    rules = placer.rules
    placer.rules = replace(
        rules, min_separation=min(WARMUP_SEPARATION, rules.min_separation), max_gap=np.inf
    )
    placer.add_seeds(seeds_around_singularities(placer.mesh, placer.spacing))
    for _ in range(WARMUP_STEPS):
        if len(placer.tips.stroke):
            placer.step()
    placer.suspend()
    seeds = candidate_seeds(placer)
    seeds = seeds.take(uncovered_seeds(placer, seeds))
    seed_spacing = MAX_SEED_SPACING
    placer.rules = replace(rules, min_length=FIRST_LENGTH_FACTOR * rules.min_length)
    while len(seeds):
        placer.add_seeds(seeds.take(thinned_seeds(placer, seeds, seed_spacing)))
        yield from _grow_until(placer, label, STRAGGLER_RATIO)
        if seed_spacing <= MIN_SEED_SPACING:
            break
        seed_spacing /= 4
        seeds = seeds.take(uncovered_seeds(placer, seeds))
    placer.rescan(replace(rules, min_length=SECOND_LENGTH_FACTOR * rules.min_length))
    yield from _grow_until(placer, label, STRAGGLER_RATIO)
    fill_rules = replace(
        rules, min_separation=FILL_SEPARATION_FACTOR * rules.min_separation, max_gap=np.inf
    )
    placer.resume_yielded(replace(fill_rules, min_length=SECOND_LENGTH_FACTOR * rules.min_length))
    yield from _grow_until(placer, label, STRAGGLER_RATIO)
    placer.rescan(fill_rules)
    yield from _grow_until(placer, label)


def _grow_until(placer: StreamlinePlacer, label: str, straggler_ratio: float = 0.0) -> Task[None]:
    """Alternate between steps and seeding beside strokes.

    It ends when fewer tips are left than `straggler_ratio` times their largest number, or when
    nothing grows any more.
    """
    rounds, max_tips = 0, 0
    while True:
        if rounds % ROUNDS_PER_SEEDING == 0 or len(placer.tips.stroke) < MIN_TIPS:
            seeded = placer.seed_neighbors()
            if not seeded and not len(placer.tips.stroke):
                if not len(placer.open_sides):
                    return
                if not placer.seed_neighbors() and not placer.seed_neighbors():
                    return
            fraction = placer.samples.count / max(placer.expected_samples, 1)
            yield Progress(min(fraction, 0.99), label)
        tip_count = len(placer.tips.stroke)
        max_tips = max(max_tips, tip_count)
        if tip_count < straggler_ratio * max_tips:
            return
        if tip_count:
            placer.step()
        rounds += 1


def candidate_seeds(placer: StreamlinePlacer) -> SurfaceParticles:
    """Return seeds at evenly distributed points of the mesh, one for each line at each point."""
    mesh = placer.mesh
    spacing = placer.spacing.mean(axis=1)
    cumulative = np.cumsum(PROBE_DENSITY * mesh.area / spacing**2 * (mesh.z != 0).any(axis=1))
    count = int(np.ceil(cumulative[-1]))
    triangle = np.searchsorted(cumulative, (np.arange(count) + 0.5) * cumulative[-1] / count)
    triangle = np.minimum(triangle, len(cumulative) - 1).astype(np.int32)
    # A low-discrepancy sequence within triangles: multiples of irrational numbers.
    u = np.modf((np.arange(count) + 1) * 0.7548776662466927)[0]
    v = np.modf((np.arange(count) + 1) * 0.5698402909980532)[0]
    fold = u + v > 1
    u, v = np.where(fold, 1 - u, u), np.where(fold, 1 - v, v)
    weights = np.stack([1 - u - v, u, v], axis=1)
    z = np.einsum("nk,nk->n", weights, mesh.z[triangle])
    member = nearest_member(np.ones(count, dtype=complex), z, mesh.degree)
    rotations = np.exp(2j * np.pi * np.arange(mesh.family_count) / mesh.degree)
    seeds = SurfaceParticles(
        np.repeat(triangle, mesh.family_count),
        np.repeat(weights, mesh.family_count, axis=0),
        (member[:, None] * rotations).ravel(),
        np.ones(count * mesh.family_count),
    )
    return seeds.take(np.flatnonzero(seeds.member != 0))


def uncovered_seeds(placer: StreamlinePlacer, seeds: SurfaceParticles) -> np.ndarray:
    """Return the numbers of seeds that have no stroke of their family near."""
    if not len(seeds):
        return np.empty(0, dtype=np.intp)
    return np.flatnonzero(placer.is_uncovered(seeds))


def thinned_seeds(
    placer: StreamlinePlacer, seeds: SurfaceParticles, seed_spacing: float
) -> np.ndarray:
    """Return the numbers of seeds at points that are about `seed_spacing` spacings apart.

    All seeds at a chosen point are returned, one for each line.
    """
    if not len(seeds):
        return np.empty(0, dtype=np.intp)
    position = placer.mesh.points_at(seeds.triangle, seeds.weights)
    low, cell_size = position.min(axis=0), seed_spacing * float(np.median(placer.spacing))
    # Divide the bounding box into cells, and choose the point nearest to the center of each cell.
    cell_counts = np.maximum(np.ceil(np.ptp(position, axis=0) / cell_size), 1)
    grid_position = (position - low) * cell_counts / np.maximum(np.ptp(position, axis=0), 1e-300)
    cell = np.minimum(np.floor(grid_position), cell_counts - 1)
    center_offset = grid_position - cell - 0.5
    cell_index = (cell[:, 0] * cell_counts[1] + cell[:, 1]) * cell_counts[2] + cell[:, 2]
    order = np.lexsort((np.round(dot(center_offset, center_offset), 9), cell_index))
    first = order[np.unique(cell_index[order], return_index=True)[1]]
    cell_rank = np.searchsorted(cell_index[first], cell_index)
    to_chosen = position - position[first[cell_rank]]
    return np.flatnonzero(dot(to_chosen, to_chosen) == 0)


def collect_strokes(placer: StreamlinePlacer) -> Strokes:
    """Return the strokes of a placer. They are all in one family; see `label_families`."""
    mesh, samples = placer.mesh, placer.samples
    stroke, sign, triangle, begin, weights, direction = (
        np.concatenate(column) for column in zip(*placer.segments, strict=True)
    )
    alive = placer.strokes.alive[: placer.strokes.count]
    keep = np.flatnonzero(alive[stroke])
    stroke, sign, triangle, begin, weights, direction = (
        column[keep] for column in (stroke, sign, triangle, begin, weights, direction)
    )
    # Each segment adds one point: its end in the forward half of a stroke, its beginning in the
    # backward half. The first point is the end of the last backward segment, or the seed.
    backward = np.flatnonzero(sign < 0)
    stroke_ids = np.unique(stroke)
    last_backward = np.full(placer.strokes.count, -1)
    last_backward[stroke[backward]] = backward
    last_backward = last_backward[stroke_ids]
    seed, from_seed = placer.strokes.seed[stroke_ids], last_backward[:, None] < 0
    first_triangle = np.where(last_backward < 0, samples.triangle[seed], triangle[last_backward])
    first_weights = np.where(from_seed, samples.weights[seed], weights[last_backward])
    first_direction = np.where(last_backward < 0, samples.own_way[seed], -direction[last_backward])
    weights[backward] = begin[backward]
    rank = sign * (np.arange(len(stroke)) + 1.0)
    order = np.lexsort(
        (
            np.concatenate([rank, np.where(last_backward < 0, 0.0, -last_backward - 1.5)]),
            np.concatenate([stroke, stroke_ids]),
        )
    )
    stroke = np.concatenate([stroke, stroke_ids])[order]
    triangle = np.concatenate([triangle, first_triangle])[order]
    weights = np.concatenate([weights, first_weights])[order]
    direction = np.concatenate([direction * sign, first_direction])[order]
    row = np.searchsorted(stroke_ids, stroke)
    points = mesh.points_at(triangle, weights)
    start = np.concatenate([[0], np.cumsum(np.bincount(row, minlength=len(stroke_ids)))])
    spacing = np.einsum("nk,nk->n", weights, placer.spacing[triangle])
    return Strokes(
        points=points,
        start=start,
        family=np.zeros(len(stroke_ids), dtype=np.int32),
        names=("family 1",),
        face=mesh.face[triangle],
        triangle=triangle.astype(np.int32),
        weights=weights,
        normal=mesh.shading_normals_at(triangle, weights),
        member=mesh.to_world(triangle, direction),
        spacing=spacing,
        width=np.ones(len(points)),
        opacity=np.ones(len(points)),
        closed=np.zeros(len(stroke_ids), dtype=bool),
    )
