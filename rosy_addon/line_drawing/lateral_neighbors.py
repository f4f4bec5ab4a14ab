"""Find the strokes beside samples, and the samples that are too near to another stroke.

Only samples of the same family are compared. Distances are measured on the surface.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..field.frames import dot
from .point_grid import QueryBand
from .samples import SAMPLE_STEP, SEARCH_RADIUS, CoveringPairs, StrokeSamples
from .separation_rules import MAX_SLOPE, MIN_NORMAL_COSINE, MIN_SELF_ARC

#: Largest gap for which a side counts as covered, in spacings.
MAX_COVERED_GAP = 1.5

#: A neighbor is beside a sample if it is at most this far ahead or behind, in spacings.
LATERAL_WINDOW = 0.36

#: Separation of strokes that meet head on, in spacings.
HEAD_ON_DISTANCE = 0.35


class LateralNeighbors(NamedTuple):
    """The strokes beside n samples. Side 0 is left, side 1 is right.

    Attributes
    ----------
    gap : (n, 2) float64 ndarray
        Distance to the nearest stroke on each side, in spacings; infinite if there is none.
    rejected : (n,) bool ndarray
        Whether the sample is too near to an older one, or has yielded.
    yielded : (n,) bool ndarray
        Whether a gap beside it is too wide for one stroke and too narrow for two.
    covering : CoveringPairs
        The accepted samples and the neighbors beside them, at most `MAX_COVERED_GAP` away.
    """

    gap: np.ndarray
    rejected: np.ndarray
    yielded: np.ndarray
    covering: CoveringPairs


class _Pairs(NamedTuple):
    """m pairs of samples that are near each other, of the same family, and on one part of a fold.

    Attributes
    ----------
    query : (m,) intp ndarray
        Index into the samples that are compared.
    sample, neighbor : (m,) ndarray of int
        Numbers of the two samples.
    sample_frame, neighbor_frame : (m, 4, 3) float64 ndarray
        As in `StrokeSamples`.
    offset : (m, 3) float64 ndarray
        Displacement on the surface from the neighbor to the sample.
    """

    query: np.ndarray
    sample: np.ndarray
    neighbor: np.ndarray
    sample_frame: np.ndarray
    neighbor_frame: np.ndarray
    offset: np.ndarray


def find_lateral_neighbors(
    samples: StrokeSamples, sample: np.ndarray, min_separation: float, max_gap: float
) -> LateralNeighbors:
    """Compare samples with all nearby samples of the same family.

    Parameters
    ----------
    samples : StrokeSamples
    sample : (n,) ndarray of int
        Numbers of the samples that are compared.
    min_separation, max_gap : float
        In spacings, as in `SeparationRules`.
    """
    pairs = _comparable_pairs(samples, sample)
    spacing = (samples.spacing[pairs.sample] + samples.spacing[pairs.neighbor]) / 2
    forward = dot(pairs.offset, pairs.neighbor_frame[:, 2])
    lateral = np.sqrt(np.maximum(dot(pairs.offset, pairs.offset) - forward * forward, 0))
    # Strokes may come closer to each other head on than side by side.
    forward_excess = np.maximum(np.abs(forward) - SAMPLE_STEP / 2 * spacing, 0) * (
        max(min_separation, 1e-3) / HEAD_ON_DISTANCE
    )
    distance = np.sqrt(lateral * lateral + forward_excess * forward_excess)
    too_near = _is_older(samples, pairs) & (distance < min_separation * spacing)
    rejected = np.zeros(len(sample), dtype=bool)
    rejected[pairs.query[too_near]] = True

    beside = np.abs(dot(pairs.offset, pairs.sample_frame[:, 2])) <= LATERAL_WINDOW * spacing
    beside = np.flatnonzero(beside & (lateral < SEARCH_RADIUS * spacing))
    lateral_gap = (lateral / spacing).take(beside)
    pairs = _Pairs(*(column.take(beside, axis=0) for column in pairs))
    sample_side = (_left_component(pairs.offset, pairs.sample_frame) > 0).astype(np.intp)
    neighbor_side = (_left_component(pairs.offset, pairs.neighbor_frame) < 0).astype(np.intp)
    gap = np.full((len(sample), 2), np.inf)
    np.minimum.at(gap, (pairs.query, sample_side), lateral_gap)
    yielded = ~rejected & ((gap > max_gap) & (gap < MAX_COVERED_GAP)).any(axis=1)
    rejected |= yielded
    covers = (lateral_gap < MAX_COVERED_GAP) & ~rejected[pairs.query]
    covering = CoveringPairs(
        *(column[covers] for column in (pairs.sample, pairs.neighbor, sample_side, neighbor_side))
    )
    return LateralNeighbors(gap, rejected, yielded, covering)


def _comparable_pairs(samples: StrokeSamples, sample: np.ndarray) -> _Pairs:
    """Return the pairs of a given sample and another of its family that is near on the surface."""
    query, neighbor = samples.grid.pairs_within(
        samples.position[sample],
        SEARCH_RADIUS * samples.spacing[sample],
        QueryBand(samples.direction[sample]),
    )
    current = sample[query]
    arc_gap = np.abs(samples.arc.take(current) - samples.arc.take(neighbor))
    keep = samples.stroke.take(current) != samples.stroke.take(neighbor)
    keep = np.flatnonzero(keep | (arc_gap > MIN_SELF_ARC * samples.spacing.take(current)))
    query, current, neighbor = query.take(keep), current.take(keep), neighbor.take(keep)
    frame, neighbor_frame = (
        samples.frame.take(current, axis=0),
        samples.frame.take(neighbor, axis=0),
    )
    normal_cosine = dot(frame[:, 1], neighbor_frame[:, 1])
    keep = normal_cosine > MIN_NORMAL_COSINE
    keep &= samples.mesh.is_same_family(
        frame[:, 3], frame[:, 1], neighbor_frame[:, 3], neighbor_frame[:, 1]
    )
    delta = frame[:, 0] - neighbor_frame[:, 0]
    normal_sum = frame[:, 1] + neighbor_frame[:, 1]
    normal_sum_squared = np.maximum(2 + 2 * normal_cosine, 1e-9)
    height = dot(delta, normal_sum)
    keep = np.flatnonzero(
        keep & (height * height <= MAX_SLOPE**2 * dot(delta, delta) * normal_sum_squared)
    )
    # Project the difference of the positions along the mean normal.
    offset = delta.take(keep, axis=0)
    offset -= (height / normal_sum_squared).take(keep)[:, None] * normal_sum.take(keep, axis=0)
    # Correct the length of the chord to that of the arc on the bent surface.
    offset *= (1 + (1 - normal_cosine.take(keep)) / 12)[:, None]
    return _Pairs(
        query.take(keep),
        current.take(keep),
        neighbor.take(keep),
        frame.take(keep, axis=0),
        neighbor_frame.take(keep, axis=0),
        offset,
    )


def _is_older(samples: StrokeSamples, pairs: _Pairs) -> np.ndarray:
    """Return (m,) bool: whether the neighbor was added before the sample.

    If both were added in the same step, the sample of the stroke with the lower number is older.
    """
    step, neighbor_step = samples.step[pairs.sample], samples.step[pairs.neighbor]
    older = neighbor_step < step
    older |= (neighbor_step == step) & (
        samples.stroke[pairs.neighbor] < samples.stroke[pairs.sample]
    )
    return older


def _left_component(vectors: np.ndarray, frame: np.ndarray) -> np.ndarray:
    """Return the (n,) components of vectors to the left of the direction of frames."""
    return dot(vectors, np.cross(frame[:, 1], frame[:, 2]))
