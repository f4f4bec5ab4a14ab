"""Trace evenly spaced strokes on a tangent mesh, to `Strokes`."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..core.errors import RosyError
from ..core.progress import progress, report
from .closed_strokes import close_loops
from .lateral_neighbors import SeparationRules
from .placement import StreamlinePlacer
from .seeding import (
    candidate_seeds,
    seeds_around_singularities,
    thinned_seeds,
    uncovered_seeds,
)
from .separation import enforce_separation
from .spacing import CornerSpacing
from .stroke_set import Strokes
from .surface_particles import SurfaceParticles
from .tangent_mesh import TangentMesh

#: Label of the progress.
TRACING = "tracing strokes"

#: Samples by which tips grow between two attempts to seed beside strokes.
SAMPLES_PER_SEEDING = 8

#: Distances in spacings between seeds that are added at once, from round to round.
SEED_SPACINGS = (96.0, 24.0, 6.0)

#: A phase ends when fewer tips are left than this fraction of their largest number.
STRAGGLER_RATIO = 0.1

#: Factors of the minimum length of strokes in the first phase and in those after it, and factor of
#: the minimum separation for the strokes that fill the last gaps.
FIRST_LENGTH_FACTOR, SECOND_LENGTH_FACTOR, FILL_SEPARATION_FACTOR = 3.3, 1.7, 0.85

#: Strokes around singularities grow before all others, so that the ends of the others do not form a
#: ring around them: by these numbers of samples at once. At first they have another minimum separation,
#: in spacings.
FIRST_WARMUP, SECOND_WARMUP, WARMUP_SEPARATION = (3, 3), (2, 2, 2, 2, 2), 0.6


def trace_on_mesh(
    mesh: TangentMesh,
    spacing: CornerSpacing,
    rules: SeparationRules | None = None,
    surface_name: str = "mesh",
) -> Strokes:
    """Cover a tangent mesh with evenly spaced strokes along its field.

    Parameters
    ----------
    mesh : TangentMesh
    spacing : CornerSpacing
        Spacing between strokes of a family.
    rules : SeparationRules, optional
    surface_name : str
        For error messages.

    Returns
    -------
    Strokes
        World space. All are in one family; see `label_families`.

    Raises
    ------
    RosyError
        If the spacing is not above 0, or it is so small that there would be too many strokes.
    """
    if not (np.isfinite(spacing.values).all() and (spacing.values > 0).all()):
        raise RosyError(f"{surface_name}: the spacing of strokes must be above 0")
    placer = StreamlinePlacer(mesh, spacing, rules or SeparationRules())
    rules = placer.rules
    with progress(0.0, 0.9):
        place_streamlines(placer)
    with progress(0.9, 0.92):
        strokes = collect(placer)
    del placer  # its samples take more memory than the strokes
    with progress(0.92, 0.95):
        strokes = close_loops(mesh, strokes, spacing)
    with progress(0.95, 1.0):
        return enforce_separation(mesh, strokes, rules.min_length)


def place_streamlines(placer: StreamlinePlacer) -> None:
    """Seed strokes and let them grow until there is no room left.

    1. Start strokes around singularities.
    2. Add seeds in a few rounds, from coarse to fine, with a long minimum length.
    3. Seed again beside strokes, with a shorter minimum length.
    4. Let strokes that yielded at wide gaps continue, with a smaller separation.
    5. Fill the remaining gaps, with the minimum length of the rules.
    """
    rules = placer.rules
    placer.rules = replace(
        rules, min_separation=min(WARMUP_SEPARATION, rules.min_separation), max_gap=np.inf
    )
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
    fill_rules = replace(
        rules, min_separation=FILL_SEPARATION_FACTOR * rules.min_separation, max_gap=np.inf
    )
    placer.resume_yielded(replace(fill_rules, min_length=SECOND_LENGTH_FACTOR * rules.min_length))
    _grow_until(placer, STRAGGLER_RATIO)
    placer.rescan(fill_rules)
    _grow_until(placer)
    # There may be gaps that are not beside a stroke, where all were too short for the phases before.
    _add_uncovered_seeds(placer, candidates)
    _grow_until(placer)


def _add_uncovered_seeds(
    placer: StreamlinePlacer, candidates: SurfaceParticles, seed_spacing: float = 0.0
) -> None:
    """Start strokes at those candidates that are not near a stroke of their family.

    The points of the seeds are about `seed_spacing` apart, in spacings; all are tried if it is 0.
    """
    label = "looking for gaps"
    report(placer.samples.coverage, label)
    seeds = uncovered_seeds(placer.samples, candidates)
    report(placer.samples.coverage, label)
    if seed_spacing and len(seeds):
        median = float(np.median(placer.spacing.values))
        ratio = placer.samples.spacing_at(seeds) / median
        seeds = thinned_seeds(placer.mesh, seeds, seed_spacing * median, ratio)
    placer.add_seeds(seeds)


def _grow_until(placer: StreamlinePlacer, straggler_ratio: float = 0.0) -> None:
    """Alternate between steps and seeding beside strokes.

    It ends when fewer tips are left than `straggler_ratio` times their largest number, or when
    nothing grows any more.
    """
    max_tips = 0
    while True:
        report(placer.samples.coverage, TRACING)
        seeded = placer.seed_neighbors()
        if not seeded and not len(placer.tips):
            if not placer.samples.has_open_sides:
                return
            # Each call closes the sides that it tried. Try others twice more.
            if not placer.seed_neighbors() and not placer.seed_neighbors():
                return
        report(placer.samples.coverage, TRACING)
        tip_count = len(placer.tips)
        max_tips = max(max_tips, tip_count)
        if tip_count < straggler_ratio * max_tips:
            return
        if tip_count:
            placer.grow(SAMPLES_PER_SEEDING)


def collect(placer: StreamlinePlacer) -> Strokes:
    """Return the strokes of a placer. They are all in one family; see `label_families`."""
    label = "collecting strokes"
    report(0.0, label)
    samples = placer.samples
    columns = [np.concatenate(column) for column in zip(*placer.segments, strict=True)]
    placer.segments.clear()
    keep = np.flatnonzero(placer.strokes.alive[columns[0]])
    stroke, sign, triangle, begin_weights, weights, direction = (column[keep] for column in columns)
    del columns
    report(0.5, label)
    # Each segment adds one point: its end in the forward half of a stroke, its beginning in the
    # backward half. The first point is the end of the last backward segment, or the seed.
    backward = np.flatnonzero(sign < 0)
    stroke_ids = np.unique(stroke)
    last_backward = np.full(placer.strokes.count, -1)
    last_backward[stroke[backward]] = backward
    last_backward = last_backward[stroke_ids]
    seed, from_seed = placer.strokes.seed_sample[stroke_ids], last_backward[:, None] < 0
    first_triangle = np.where(last_backward < 0, samples.triangle[seed], triangle[last_backward])
    first_weights = np.where(from_seed, samples.weights[seed], weights[last_backward])
    first_direction = np.where(
        last_backward < 0, samples.local_direction[seed], -direction[last_backward]
    )
    weights[backward] = begin_weights[backward]
    rank = sign * (np.arange(len(stroke)) + 1.0)
    order = np.lexsort(
        (
            np.concatenate([rank, np.where(last_backward < 0, 0.0, -last_backward - 1.5)]),
            np.concatenate([stroke, stroke_ids]),
        )
    )
    report(0.6, label)
    stroke = np.concatenate([stroke, stroke_ids])[order]
    triangle = np.concatenate([triangle, first_triangle])[order]
    weights = np.concatenate([weights, first_weights])[order]
    direction = np.concatenate([direction * sign, first_direction])[order]
    report(0.8, label)
    count = np.bincount(np.searchsorted(stroke_ids, stroke), minlength=len(stroke_ids))
    spacing = placer.spacing.at(triangle, weights, direction)
    triangle = triangle.astype(np.int32)
    return Strokes.on_mesh(placer.mesh, count, triangle, weights, direction, spacing)
