"""Find the strokes beside samples of strokes, and the samples that are too near to another stroke.

Only samples of the same family (line direction of the field) are compared. Distances are measured on the
surface.
"""

from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from ..field.blocks import mask, row_blocks
from ..field.frames import dot
from .samples import SAMPLE_STEP, SEARCH_RADIUS, CoveringPairs, StrokeSamples

#: A side of a sample counts as covered if the gap to the next stroke on that side is smaller, in spacings.
MAX_COVERED_GAP = 1.5

#: A neighbor is beside a sample if it is at most this far ahead or behind, in spacings.
LATERAL_WINDOW = 0.36

#: Smallest distance between the ends of strokes that meet head on, in spacings.
HEAD_ON_DISTANCE = 0.35

#: Two points of the same stroke are compared only if they are farther apart along it than this, in spacings.
MIN_SELF_ARC = 2.5

#: Two points are on different sides of a fold if the cosine between their normals is below the first value,
#: or if the slope from one to the other (their distance along the mean normal, over their distance) is above
#: the second value.
MIN_NORMAL_COSINE, MAX_SLOPE = 0.1, 0.6

#: Number of pairs of samples that are compared at once. It bounds memory where surfaces lie on each other.
PAIR_BLOCK = 1 << 20

#: The columns of a table.
_Table = tuple[np.ndarray, ...]


@dataclass(frozen=True)
class SeparationRules:
    """Limits on the separation and the length of strokes.

    The unit is the spacing: the required distance between strokes of the same family.

    Attributes
    ----------
    min_separation : float
        Strokes end before they come nearer than this to another stroke of their family.
    max_gap : float
        Strokes end where the gap to the next stroke is wider than this but too narrow for another stroke
        between them (see `MAX_COVERED_GAP`).
    min_length : float
        Strokes that are shorter than this are removed.
    """

    min_separation: float = 0.75
    max_gap: float = 1.24
    min_length: float = 1.5


class LateralNeighbors(NamedTuple):
    """The strokes beside n samples of strokes. Side 0 is left, side 1 is right.

    Attributes
    ----------
    gap : (n, 2) float64 ndarray
        Distance to the nearest stroke on each side, in spacings; infinite if there is none.
    rejected : (n,) bool ndarray
        Whether the sample is too near to an older sample (added in an earlier step of growth), follows a
        rejected sample, or has yielded.
    yielded : (n,) bool ndarray
        Whether the sample has yielded: the gap beside it is wider than `SeparationRules.max_gap`, but too
        narrow for another stroke, so its stroke ends there.
    covering : CoveringPairs
        Pairs of a sample that is not rejected and a neighbor beside it, less than `MAX_COVERED_GAP` spacings
        away.
    """

    gap: np.ndarray
    rejected: np.ndarray
    yielded: np.ndarray
    covering: CoveringPairs


class _Pairs(NamedTuple):
    """m pairs of samples that are near each other on the surface, not only in space.

    The strokes of both samples follow the same line direction, so they belong to the same family.

    Attributes
    ----------
    query : (m,) intp ndarray
        Position of the sample in the array of samples that were given to be compared.
    sample, neighbor : (m,) ndarray of int
        Indices of the two samples in `StrokeSamples`.
    sample_frame, neighbor_frame : (m, 4, 3) float64 ndarray
        Position, normal, direction and member of the two samples, as in `StrokeSamples.frame`.
    offset : (m, 3) float64 ndarray
        Displacement on the surface from the neighbor to the sample, in world space.
    """

    query: np.ndarray
    sample: np.ndarray
    neighbor: np.ndarray
    sample_frame: np.ndarray
    neighbor_frame: np.ndarray
    offset: np.ndarray


def find_lateral_neighbors(
    samples: StrokeSamples,
    sample: np.ndarray,
    min_separation: float,
    max_gap: float,
    previous: np.ndarray | None = None,
) -> LateralNeighbors:
    """Find the neighbors beside samples, and reject the samples that are too near to others of their family.

    Parameters
    ----------
    samples : StrokeSamples
    sample : (n,) ndarray of int
        Indices of the samples that are compared with all others.
    min_separation, max_gap : float
        Distance below which a sample is rejected, and largest gap at which it does not yield, in spacings.
    previous : (n,) ndarray of int, optional
        For each sample, the position in `sample` of the sample before it at the same end of its stroke, or
        -1. It may only be given if `sample` holds the samples that were added last, sorted by step of growth.
        A sample is then compared only with samples of the same or an earlier step, and it is rejected if its
        previous sample is rejected.
    """
    pairs = _comparable_pairs(samples, sample)
    spacing = (samples.spacing[pairs.sample] + samples.spacing[pairs.neighbor]) / 2
    forward = dot(pairs.offset, pairs.neighbor_frame[:, 2])
    lateral = np.sqrt(np.maximum(dot(pairs.offset, pairs.offset) - forward * forward, 0))
    # Strokes may come closer to each other head on than side by side.
    forward_excess = np.maximum(np.abs(forward) - SAMPLE_STEP / 2 * spacing, 0)
    forward_excess *= max(min_separation, 1e-3) / HEAD_ON_DISTANCE
    distance = np.sqrt(lateral * lateral + forward_excess * forward_excess)
    too_near = np.flatnonzero(_is_older(samples, pairs) & (distance < min_separation * spacing))
    near_query, near_neighbor = pairs.query[too_near], pairs.neighbor[too_near]

    beside = np.abs(dot(pairs.offset, pairs.sample_frame[:, 2])) <= LATERAL_WINDOW * spacing
    beside = np.flatnonzero(beside & (lateral < SEARCH_RADIUS * spacing))
    lateral_gap = (lateral / spacing).take(beside)
    pairs = _Pairs(*(column.take(beside, axis=0) for column in pairs))
    side = (_left_component(pairs.offset, pairs.sample_frame) > 0).astype(np.intp)
    neighbor_side = (_left_component(pairs.offset, pairs.neighbor_frame) < 0).astype(np.intp)
    covers = lateral_gap < MAX_COVERED_GAP
    # Positions of neighbors in `sample`, or -1. All are -1 if `previous` is not given.
    if previous is None:
        first, step = samples.count, np.zeros(len(sample), dtype=int)
        previous = np.full(len(sample), -1)
    else:
        first, step = sample.min(initial=samples.count), samples.step[sample]
    index = np.maximum(pairs.neighbor - first, -1)
    near = near_query, np.maximum(near_neighbor - first, -1)
    beside = pairs.query, index, side, lateral_gap
    gap, yielded, rejected = _judge(step, previous, near, beside, max_gap)
    covers &= ~np.append(rejected, False)[index]
    covers &= ~rejected[pairs.query]
    columns = pairs.sample, pairs.neighbor, side, neighbor_side
    covering = CoveringPairs(*(column[covers] for column in columns))
    return LateralNeighbors(gap, rejected, yielded, covering)


def _judge(
    step: np.ndarray, previous: np.ndarray, near: _Table, beside: _Table, max_gap: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Decide which samples are rejected. Return `gap`, `yielded` and `rejected` of `LateralNeighbors`.

    The steps of growth are judged one after another. Samples that follow a rejected sample on their stroke
    are rejected too, and no other samples are compared with them.

    Parameters
    ----------
    step : (n,) ndarray of int
        Step of growth at which each sample was added, in ascending order.
    previous : (n,) ndarray of int
        For each sample, the position of the sample before it on its stroke among the n samples, or -1.
    near : tuple of (k,) ndarray
        Two columns: samples, and older neighbors that are too near to them, as positions among the n samples.
        Neighbors that are not among them are -1.
    beside : tuple of (m,) ndarray
        Four columns: samples, neighbors beside them, sides and distances in spacings.
    max_gap : float
        Largest gap at which a sample does not yield, in spacings.
    """
    near, beside = _sorted_by_first(near), _sorted_by_first(beside)
    # The last element is for the index -1.
    exists = np.ones(len(step) + 1, dtype=bool)
    gap, yielded = np.full((len(step), 2), np.inf), np.zeros(len(step), dtype=bool)
    starts = np.searchsorted(step, np.arange(step[0], step[-1] + 2)) if len(step) else [0]
    for first, end in pairwise(starts):
        rows = slice(first, end)
        exists[rows] = exists[previous[rows]]
        near_query, near_neighbor = _rows_of(near, first, end)
        query, neighbor, side, lateral_gap = _rows_of(beside, first, end)
        is_near = exists[near_neighbor]
        is_beside = (neighbor < end) & exists[neighbor]
        np.minimum.at(gap, (query[is_beside], side[is_beside]), lateral_gap[is_beside])
        is_accepted = ~mask(end - first, near_query[is_near] - first)
        is_wide = (gap[rows] > max_gap) & (gap[rows] < MAX_COVERED_GAP)
        yielded[rows] = exists[rows] & is_accepted & is_wide.any(axis=1)
        exists[rows] &= is_accepted & ~yielded[rows]
    return gap, yielded, ~exists[:-1]


def _sorted_by_first(columns: _Table) -> _Table:
    """Return the columns of a table with its rows sorted by the first column."""
    order = np.argsort(columns[0], kind="stable")
    return tuple(column[order] for column in columns)


def _rows_of(columns: _Table, first: int, end: int) -> _Table:
    """Return the rows of a table whose values in the first column are from `first` to `end` - 1.

    The first column must be sorted.
    """
    rows = slice(*np.searchsorted(columns[0], (first, end)))
    return tuple(column[rows] for column in columns)


def _comparable_pairs(samples: StrokeSamples, sample: np.ndarray) -> _Pairs:
    """Return all pairs of a given sample and another sample of its family that is near on the surface.

    `sample` holds the indices of the given samples. Near means within `SEARCH_RADIUS` spacings.
    """
    radius, direction = SEARCH_RADIUS * samples.spacing[sample], samples.direction[sample]
    query, neighbor = samples.grid.pairs_within(samples.position[sample], radius, direction)
    parts = row_blocks(len(query), PAIR_BLOCK)
    blocks = [_comparable_block(samples, sample, query[part], neighbor[part]) for part in parts]
    if len(blocks) == 1:
        return blocks[0]
    return _Pairs(*(np.concatenate(columns) for columns in zip(*blocks, strict=True)))


def _comparable_block(
    samples: StrokeSamples, sample: np.ndarray, query: np.ndarray, neighbor: np.ndarray
) -> _Pairs:
    """Return the pairs of samples of the same family that are near on the surface.

    The given pairs, row by row, are near each other in space. `query` holds the position of the first sample
    of each pair in `sample`, and `neighbor` the index of the other one.
    """
    current = sample[query]
    arc_gap = np.abs(samples.arc.take(current) - samples.arc.take(neighbor))
    keep = samples.stroke.take(current) != samples.stroke.take(neighbor)
    keep = np.flatnonzero(keep | (arc_gap > MIN_SELF_ARC * samples.spacing.take(current)))
    query, current, neighbor = query.take(keep), current.take(keep), neighbor.take(keep)
    frame, neighbor_frame = (samples.frame.take(one, axis=0) for one in (current, neighbor))
    normal, neighbor_normal = frame[:, 1], neighbor_frame[:, 1]
    normal_cosine = dot(normal, neighbor_normal)
    keep = normal_cosine > MIN_NORMAL_COSINE
    keep &= samples.mesh.is_same_family(frame[:, 3], normal, neighbor_frame[:, 3], neighbor_normal)
    delta = frame[:, 0] - neighbor_frame[:, 0]
    normal_sum = normal + neighbor_normal
    normal_sum_squared = np.maximum(2 + 2 * normal_cosine, 1e-9)
    height = dot(delta, normal_sum)
    keep &= height * height <= MAX_SLOPE**2 * dot(delta, delta) * normal_sum_squared
    keep = np.flatnonzero(keep)
    # Project the difference of the positions along the mean normal.
    offset = delta.take(keep, axis=0)
    offset -= (height / normal_sum_squared).take(keep)[:, None] * normal_sum.take(keep, axis=0)
    # Correct the length of the chord to the length of the arc on the bent surface.
    offset *= (1 + (1 - normal_cosine.take(keep)) / 12)[:, None]
    columns = query, current, neighbor, frame, neighbor_frame
    return _Pairs(*(column.take(keep, axis=0) for column in columns), offset)


def _is_older(samples: StrokeSamples, pairs: _Pairs) -> np.ndarray:
    """Return (m,) bool: whether the neighbor of each pair is older, which means added in an earlier step.

    If both were added in the same step, the sample of the stroke with the lower index counts as older.
    """
    step, neighbor_step = samples.step[pairs.sample], samples.step[pairs.neighbor]
    has_lower_stroke = samples.stroke[pairs.neighbor] < samples.stroke[pairs.sample]
    return (neighbor_step < step) | ((neighbor_step == step) & has_lower_stroke)


def _left_component(vectors: np.ndarray, frame: np.ndarray) -> np.ndarray:
    """Return the (n,) components of vectors along the unit vectors to the left of strokes.

    `frame`, (n, 4, 3), holds four vectors of a sample for each of the (n, 3) vectors. The second and third are the unit
    normal and the unit direction of the stroke.
    """
    return dot(vectors, np.cross(frame[:, 1], frame[:, 2]))
