"""Place evenly spaced streamlines on a tangent mesh: they grow from seeds until it is covered.

After Jobard and Lefer, "Creating Evenly-Spaced Streamlines of Arbitrary Density" (1997). A stroke
starts beside an existing one, at the required spacing, and ends where it comes too near to another.
The differences are:

- Distances are measured on the surface.
- All strokes grow at the same time, each with two tips. New strokes are seeded beside a stroke that
  still grows, so fronts spread from few points and meet along few seams.
- A stroke also ends where the gap beside it is wider than the spacing but too narrow for another
  stroke, as in diverging fields. Strokes that are seeded farther on are spaced better.

Only strokes of the same family keep a distance. Near each other, two strokes are of the same family
if their members match there. Their members elsewhere do not matter.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..errors import RosyError
from ..field.frames import dot
from .point_grid import PointGrid, QueryBand
from .surface_particles import SurfaceParticles, TracedPath, advance, trace_geodesics
from .tangent_mesh import TangentMesh

#: Distance between consecutive samples of a stroke, in spacings.
SAMPLE_STEP = 0.5

#: Search radius for strokes beside a sample, and the largest gap for which a side counts as
#: covered, in spacings.
SEARCH_RADIUS, MAX_COVERED_GAP = 1.6, 1.5

#: A neighbor is beside a sample if it is at most this far ahead or behind, in spacings.
LATERAL_WINDOW = 0.36

#: Separation of strokes that meet head on, in spacings.
HEAD_ON_DISTANCE = 0.35

#: If a step is rejected, a tip tries half of it, as long as this fraction of a full step is left.
MIN_STEP_SCALE = 0.2

#: Samples of one stroke are compared only if they are farther apart along it than this, in spacings.
MIN_SELF_ARC = 2.5

#: Samples or probes that are compared at once. Bounds memory.
PROBE_BATCH_SIZE = 1 << 14

#: Steps between two rounds of seeding; the distance in spacings by which the tips of a parent have
#: to be ahead of a seed beside it; and the number of tips below which seeds are added at every
#: step.
ROUNDS_PER_SEEDING, PARENT_LEAD, MIN_TIPS = 3, 2.5, 64

#: After a seed was tried beside a stroke, no other is tried within this distance along the stroke,
#: in spacings.
RETRY_ARC = 1.0

#: Points are on different parts of a fold if the cosine between their normals is below the first
#: value, or the slope between them relative to the mean normal (height over distance) is above the
#: second.
MIN_NORMAL_COSINE, MAX_SLOPE = 0.1, 0.6


@dataclass(frozen=True)
class SeparationRules:
    """Limits on the separation and the length of strokes, in spacings.

    Attributes
    ----------
    min_separation : float
        Strokes end before they come nearer than this to another stroke of their family.
    max_gap : float
        Strokes end where a gap beside them is wider than this but narrower than `MAX_COVERED_GAP`.
    min_length : float
        Shorter strokes are removed.
    max_length : float
        Strokes end when they are longer than this.

    Raises
    ------
    RosyError
        If a limit is out of range.
    """

    min_separation: float = 0.75
    max_gap: float = 1.24
    min_length: float = 1.5
    max_length: float = np.inf

    def __post_init__(self) -> None:
        if not 0.1 <= self.min_separation < 1 < self.max_gap:
            raise RosyError(
                f"min_separation ({self.min_separation:g}) must be from 0.1 to below 1, and max_gap "
                f"({self.max_gap:g}) above 1"
            )
        if not 0 <= self.min_length < self.max_length:
            raise RosyError("min_length of strokes must be less than max_length")


class _ColumnTable:
    """A table of growing columns with equal row counts; each column is an attribute.

    Columns are larger than `count`; their remaining rows are reserve.

    Parameters
    ----------
    **columns : (tuple of int, type)
        Shape of a row and dtype of each column.
    """

    def __init__(self, **columns: tuple[tuple[int, ...], type]) -> None:
        self.count = 0
        self.columns = columns
        for name, (shape, dtype) in columns.items():
            setattr(self, name, np.zeros((1024, *shape), dtype=dtype))

    def add(self, **values: np.ndarray) -> np.ndarray:
        """Append rows and return their numbers. Columns that are not given are 0 in new rows."""
        row_count = len(next(iter(values.values())))
        first, self.count = self.count, self.count + row_count
        for name in self.columns:
            column = getattr(self, name)
            while self.count > len(column):
                column = np.concatenate([column, np.zeros_like(column)])
                setattr(self, name, column)
            if name in values:
                column[first : self.count] = values[name]
        return np.arange(first, self.count)


class _SampleTable(_ColumnTable):
    """The samples of strokes. The vectors that samples are compared by are stored in `frame`."""

    frame: np.ndarray

    @property
    def position(self) -> np.ndarray:
        return self.frame[:, 0]

    @property
    def normal(self) -> np.ndarray:
        return self.frame[:, 1]

    @property
    def direction(self) -> np.ndarray:
        return self.frame[:, 2]


@dataclass(eq=False)
class _Tips:
    """The growing ends of strokes, n of them.

    Attributes
    ----------
    particles : SurfaceParticles
        Their positions. The sign is that of the half of the stroke.
    stroke : (n,) int32 ndarray
    arc : (n,) float64 ndarray
        Signed arc length from the seed, in world space.
    step_scale : (n,) float64 ndarray
        Fraction of a full step to try next.
    """

    particles: SurfaceParticles
    stroke: np.ndarray
    arc: np.ndarray
    step_scale: np.ndarray

    def take(self, indices: np.ndarray) -> _Tips:
        return _Tips(
            self.particles.take(indices),
            self.stroke[indices],
            self.arc[indices],
            self.step_scale[indices],
        )


@dataclass(eq=False)
class _LateralNeighbors:
    """The strokes beside n samples, and m pairs of a sample and a neighbor beside it.

    Sides are 0 for left and 1 for right.

    Attributes
    ----------
    gap : (n, 2) float64 ndarray
        Distance to the nearest stroke on each side, in spacings; infinite if there is none.
    rejected : (n,) bool ndarray
        Whether the sample is too near to an older one, or has yielded.
    yielded : (n,) bool ndarray
        Whether a gap beside it is too wide for one stroke and too narrow for two.
    sample : (m,) intp ndarray
        The sample of each pair, from 0 to n - 1.
    neighbor : (m,) int32 ndarray
        Number of the neighbor in the table of samples.
    sample_side, neighbor_side : (m,) intp ndarray
        The side of the sample on which the neighbor is, and the reverse.
    """

    gap: np.ndarray
    rejected: np.ndarray
    yielded: np.ndarray
    sample: np.ndarray
    neighbor: np.ndarray
    sample_side: np.ndarray
    neighbor_side: np.ndarray


class StreamlinePlacer:
    """The state of strokes that grow on a tangent mesh, and the steps that let them grow.

    Parameters
    ----------
    mesh : TangentMesh
    spacing : (T, 3) ndarray
        Spacing at the corners of the triangles, in world space.
    rules : SeparationRules

    Raises
    ------
    RosyError
        If the expected number of samples is too large.

    See Also
    --------
    rosy_addon.strokes.trace.place_streamlines_task : Runs the steps in their order.
    """

    def __init__(self, mesh: TangentMesh, spacing: np.ndarray, rules: SeparationRules) -> None:
        self.mesh, self.spacing, self.rules = mesh, spacing, rules
        self.samples = _SampleTable(
            # Rows: position, normal, direction and member.
            frame=((4, 3), float),
            spacing=((), float),
            stroke=((), np.int32),
            # Signed arc length from the seed, in world space.
            arc=((), float),
            # The step at which the sample was added.
            time=((), np.int32),
            alive=((), bool),
            # For the left and the right side; `beside` is the number of a neighbor plus 1, or 0.
            covered=((2,), bool),
            beside=((2,), np.int32),
            triangle=((), np.int32),
            weights=((3,), float),
            own_member=((), complex),
            own_way=((), complex),
        )
        self.strokes = _ColumnTable(
            # The number of growing tips.
            heads=((), np.int32),
            # As in `add_seeds`.
            parent=((), np.int64),
            # Range of the signed arc length, and whether its ends are final.
            low=((), float),
            high=((), float),
            low_done=((), bool),
            high_done=((), bool),
            # The samples at both ends, and whether the ends have yielded (see `_LateralNeighbors`).
            ends=((2,), np.int32),
            gave_way=((2,), bool),
            # The sample at the seed.
            seed=((), np.int32),
            alive=((), bool),
            spacing=((), float),
        )
        # Growing strokes that were seeded from each side, 2 * stroke + side.
        self.active_children = np.zeros(1024, dtype=np.int32)
        mean_spacing = np.einsum("tk->t", spacing) / 3
        expected_samples = (
            float((mesh.area / mean_spacing**2).sum()) * mesh.family_count / SAMPLE_STEP
        )
        if not expected_samples < 5e7:
            raise RosyError("there would be too many strokes: increase the spacing")
        self.grid = PointGrid(
            1.01 * SEARCH_RADIUS * float(np.median(mean_spacing)), int(expected_samples)
        )
        self.expected_samples = expected_samples
        self.tips = _Tips(
            SurfaceParticles(
                np.empty(0, np.int32), np.empty((0, 3)), np.empty(0, complex), np.empty(0)
            ),
            np.empty(0, np.int32),
            np.empty(0),
            np.empty(0),
        )
        self.time = 0
        # Sides of samples at which a stroke may be seeded, 2 * sample + side.
        self.open_sides = np.empty(0, dtype=np.int64)
        # Segments of all strokes; see `_record_path` for the columns.
        self.segments: list[tuple[np.ndarray, ...]] = []
        # Samples whose sides `rescan` checks again.
        self.recheck: list[np.ndarray] = []

    # --- samples ----------------------------------------------------------------------------------

    def _spacing_at(self, particles: SurfaceParticles) -> np.ndarray:
        return np.einsum("nk,nk->n", particles.weights, self.spacing[particles.triangle])

    def _add_samples(
        self, particles: SurfaceParticles, stroke: np.ndarray, arc: np.ndarray
    ) -> np.ndarray:
        """Append samples at particles to the table and the grid, and return their numbers."""
        mesh, triangle, weights = self.mesh, particles.triangle, particles.weights
        member = mesh.members_at(triangle, weights, particles.member)
        member = np.where(member == 0, particles.member, member)
        direction = mesh.directions_at(triangle, weights, member)
        position = mesh.points_at(triangle, weights)
        normal = mesh.shading_normals_at(triangle, weights)
        world_direction = mesh.transport_to_normal(
            triangle, mesh.to_world(triangle, direction), normal
        )
        world_member = world_direction
        if direction is not member:
            world_member = mesh.transport_to_normal(
                triangle, mesh.to_world(triangle, member), normal
            )
        sample = self.samples.add(
            frame=np.stack([position, normal, world_direction, world_member], axis=1),
            spacing=self._spacing_at(particles),
            stroke=stroke,
            arc=arc,
            time=np.full(len(triangle), self.time),
            alive=np.ones(len(triangle), dtype=bool),
            triangle=triangle,
            weights=weights,
            own_member=member,
            own_way=direction,
        )
        self.grid.add(position)
        return sample

    def _remove_samples(self, sample: np.ndarray) -> None:
        self.samples.alive[sample] = False
        self.grid.remove(sample)

    def _find_neighbors(
        self, sample: np.ndarray, min_separation: float, max_gap: float
    ) -> _LateralNeighbors:
        """Compare samples with all nearby samples of the same family.

        `min_separation` and `max_gap` are in spacings, as in `SeparationRules`.
        """
        samples = self.samples
        query, neighbor = self.grid.pairs_within(
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
        keep &= self.mesh.is_same_family(
            frame[:, 3], frame[:, 1], neighbor_frame[:, 3], neighbor_frame[:, 1]
        )
        delta = frame[:, 0] - neighbor_frame[:, 0]
        normal_sum = frame[:, 1] + neighbor_frame[:, 1]
        normal_sum_squared = np.maximum(2 + 2 * normal_cosine, 1e-9)
        height = dot(delta, normal_sum)
        keep = np.flatnonzero(
            keep & (height * height <= MAX_SLOPE**2 * dot(delta, delta) * normal_sum_squared)
        )
        query, current, neighbor, normal_cosine = (
            values.take(keep) for values in (query, current, neighbor, normal_cosine)
        )
        frame, neighbor_frame = frame.take(keep, axis=0), neighbor_frame.take(keep, axis=0)
        tangential = delta.take(keep, axis=0)
        tangential -= (height / normal_sum_squared).take(keep)[:, None] * normal_sum.take(
            keep, axis=0
        )
        # Correct the length of the chord to that of the arc on the bent surface.
        tangential *= (1 + (1 - normal_cosine) / 12)[:, None]
        distance_squared = dot(tangential, tangential)
        spacing = (samples.spacing[current] + samples.spacing[neighbor]) / 2
        forward = dot(tangential, neighbor_frame[:, 2])
        lateral = np.sqrt(np.maximum(distance_squared - forward * forward, 0))
        forward_distance = np.abs(forward)
        forward_excess = np.maximum(forward_distance - SAMPLE_STEP / 2 * spacing, 0) * (
            max(min_separation, 1e-3) / HEAD_ON_DISTANCE
        )
        distance = np.sqrt(lateral * lateral + forward_excess * forward_excess)
        older = samples.time[neighbor] < samples.time[current]
        older |= (samples.time[neighbor] == samples.time[current]) & (
            samples.stroke[neighbor] < samples.stroke[current]
        )
        rejected = np.zeros(len(sample), dtype=bool)
        rejected[query[older & (distance < min_separation * spacing)]] = True

        alongside = np.abs(dot(tangential, frame[:, 2])) <= LATERAL_WINDOW * spacing
        alongside = np.flatnonzero(alongside & (lateral < SEARCH_RADIUS * spacing))
        query, neighbor = query.take(alongside), neighbor.take(alongside)
        frame, neighbor_frame, tangential = (
            values.take(alongside, axis=0) for values in (frame, neighbor_frame, tangential)
        )
        lateral_gap = (lateral / spacing).take(alongside)
        sample_side = (_left_component(tangential, frame) > 0).astype(np.intp)
        neighbor_side = (_left_component(tangential, neighbor_frame) < 0).astype(np.intp)
        gap = np.full((len(sample), 2), np.inf)
        np.minimum.at(gap, (query, sample_side), lateral_gap)
        yielded = ~rejected & ((gap > max_gap) & (gap < MAX_COVERED_GAP)).any(axis=1)
        rejected |= yielded
        covering = lateral_gap < MAX_COVERED_GAP
        return _LateralNeighbors(
            gap,
            rejected,
            yielded,
            query[covering],
            neighbor[covering],
            sample_side[covering],
            neighbor_side[covering],
        )

    def _mark_covered(self, sample: np.ndarray, neighbors: _LateralNeighbors) -> None:
        """Mark the sides on which accepted samples and their neighbors have each other."""
        accepted = ~neighbors.rejected[neighbors.sample]
        samples = self.samples
        current, neighbor = sample[neighbors.sample[accepted]], neighbors.neighbor[accepted]
        samples.covered[current, neighbors.sample_side[accepted]] = True
        samples.covered[neighbor, neighbors.neighbor_side[accepted]] = True
        # Number of a neighbor plus 1. It is checked again if this sample is removed.
        samples.beside[current, neighbors.sample_side[accepted]] = neighbor + 1

    # --- growing ----------------------------------------------------------------------------------

    def step(self) -> None:
        """Advance all tips by one sample. Tips that cannot advance end."""
        self.time += 1
        tips, rules = self.tips, self.rules
        spacing = self._spacing_at(tips.particles)
        length = SAMPLE_STEP * spacing * tips.step_scale
        particles, walked, ended, path = advance(self.mesh, tips.particles, length)
        has_moved = walked > 0.02 * length
        chord = self.mesh.points_at(particles.triangle, particles.weights) - self.mesh.points_at(
            tips.particles.triangle, tips.particles.weights
        )
        # In sliver triangles, a particle may walk without a change of position.
        has_moved &= dot(chord, chord) > (0.02 * length) ** 2
        ended |= ~has_moved
        sign = tips.particles.sign
        arc = tips.arc + sign * walked
        moving = np.flatnonzero(has_moved)
        sample = self._add_samples(particles.take(moving), tips.stroke[moving], arc[moving])
        neighbors = self._find_neighbors(sample, rules.min_separation, rules.max_gap)
        self._remove_samples(sample[neighbors.rejected])
        self._mark_covered(sample, neighbors)
        rejected = np.zeros(len(ended), dtype=bool)
        rejected[moving[neighbors.rejected]] = True
        accepted = np.zeros(len(ended), dtype=bool)
        accepted[moving[~neighbors.rejected]] = True
        tips.step_scale[rejected] /= 2
        ended = np.where(rejected, tips.step_scale < MIN_STEP_SCALE, ended)
        self._record_open_sides(sample[~neighbors.rejected])
        self._record_path(path, tips, accepted)
        end = np.where(sign > 0, 1, 0)
        accepted_tips = moving[~neighbors.rejected]
        self.strokes.ends[tips.stroke[accepted_tips], end[accepted_tips]] = sample[
            ~neighbors.rejected
        ]
        self.strokes.gave_way[tips.stroke[moving], end[moving]] = neighbors.yielded
        self._update_extent(tips.stroke[accepted], arc[accepted])
        extent = self.strokes.high[tips.stroke] - self.strokes.low[tips.stroke]
        ended |= extent > rules.max_length * self.strokes.spacing[tips.stroke]
        self._finish_tips(tips.stroke[ended], sign[ended])
        rejected_tips = np.flatnonzero(rejected)
        particles.assign(rejected_tips, tips.particles.take(rejected_tips))
        arc = np.where(rejected, tips.arc, arc)
        continuing = np.flatnonzero(~ended)
        self.tips = _Tips(
            particles.take(continuing),
            tips.stroke[continuing],
            arc[continuing],
            tips.step_scale[continuing],
        )

    def _record_path(self, path: TracedPath, tips: _Tips, accepted: np.ndarray) -> None:
        """Store the segments of accepted tips, in the order of the path."""
        keep = accepted[path.particle]
        particle = path.particle[keep]
        self.segments.append(
            (
                tips.stroke[particle],
                tips.particles.sign[particle].astype(np.int8),
                path.triangle[keep],
                path.begin_weights[keep],
                path.end_weights[keep],
                path.direction[keep],
            )
        )

    def _record_open_sides(self, sample: np.ndarray) -> None:
        """Add the uncovered sides of samples to `open_sides`: 2 * sample, plus 1 for the right."""
        covered = self.samples.covered[sample]
        open_sides = np.concatenate([2 * sample[~covered[:, 0]], 2 * sample[~covered[:, 1]] + 1])
        self.open_sides = np.concatenate([self.open_sides, open_sides])

    def _update_extent(self, stroke: np.ndarray, arc: np.ndarray) -> None:
        """Extend the ranges of signed arc length of strokes to the given values."""
        np.maximum.at(self.strokes.high, stroke, arc)
        np.minimum.at(self.strokes.low, stroke, arc)

    def _finish_tips(self, stroke: np.ndarray, sign: np.ndarray) -> None:
        """End tips. Strokes without tips that are too short are dropped."""
        strokes = self.strokes
        strokes.high_done[stroke[sign > 0]] = True
        strokes.low_done[stroke[sign < 0]] = True
        np.subtract.at(strokes.heads, stroke, 1)
        finished = np.unique(stroke)
        finished = finished[strokes.heads[finished] == 0]
        parent = strokes.parent[finished]
        np.subtract.at(self.active_children, parent[parent >= 0], 1)
        too_short = finished[
            strokes.high[finished] - strokes.low[finished]
            < self.rules.min_length * strokes.spacing[finished]
        ]
        self._drop_strokes(too_short)

    def _drop_strokes(self, dropped: np.ndarray) -> None:
        """Remove strokes.

        The sides that they covered stay covered until `rescan`. Otherwise the same strokes would be
        seeded again.
        """
        if not len(dropped):
            return
        self.strokes.alive[dropped] = False
        samples = self.samples
        # Their samples follow the first of their seeds.
        first = int(self.strokes.seed[dropped].min())
        removed = ~self.strokes.alive[samples.stroke[first : samples.count]]
        removed &= samples.alive[first : samples.count]
        sample = first + np.flatnonzero(removed)
        neighbor = samples.beside[sample].ravel() - 1
        self.recheck.append(neighbor[neighbor >= 0])
        self._remove_samples(sample)

    def resume_yielded(self, rules: SeparationRules) -> None:
        """Change the rules, and let strokes that have yielded grow again."""
        self.rules = rules
        strokes, samples = self.strokes, self.samples
        done = np.stack(
            [strokes.low_done[: strokes.count], strokes.high_done[: strokes.count]], axis=1
        )
        stroke, end = np.nonzero(
            strokes.gave_way[: strokes.count] & strokes.alive[: strokes.count, None] & done
        )
        sample = strokes.ends[stroke, end]
        particles = SurfaceParticles(
            samples.triangle[sample],
            samples.weights[sample],
            samples.own_member[sample],
            np.where(end > 0, 1.0, -1.0),
        )
        # Strokes that had ended are no longer counted as active children of their parents.
        strokes.parent[stroke[strokes.heads[stroke] == 0]] = -1
        np.add.at(strokes.heads, stroke, 1)
        self._append_tips(
            _Tips(particles, stroke.astype(np.int32), samples.arc[sample], np.ones(len(stroke)))
        )

    def suspend(self) -> None:
        """End all tips as if they had yielded. No stroke is seeded beside them before `rescan`."""
        tips = self.tips
        end = np.where(tips.particles.sign > 0, 1, 0)
        self.strokes.gave_way[tips.stroke, end] = True
        self._finish_tips(tips.stroke, tips.particles.sign)
        self.tips = tips.take(np.empty(0, dtype=np.intp))
        self.recheck.append(np.unique(self.open_sides >> 1))
        self.open_sides = np.empty(0, dtype=np.int64)

    def rescan(self, rules: SeparationRules) -> None:
        """Change the rules, and open sides again where no stroke has stayed."""
        self.rules = rules
        samples = self.samples
        sample = np.unique(np.concatenate([np.empty(0, dtype=np.int64), *self.recheck]))
        sample = sample[samples.alive[sample]]
        self.recheck = []
        samples.covered[sample] = False
        for start in range(0, len(sample), PROBE_BATCH_SIZE):
            batch = sample[start : start + PROBE_BATCH_SIZE]
            neighbors = self._find_neighbors(batch, 0.0, np.inf)
            self._mark_covered(batch, neighbors)
        self._record_open_sides(sample)

    # --- seeds ------------------------------------------------------------------------------------

    def add_seeds(
        self, particles: SurfaceParticles, parent: np.ndarray | None = None
    ) -> np.ndarray:
        """Start strokes at the seeds that are far enough from other strokes.

        Parameters
        ----------
        particles : SurfaceParticles
            n seeds.
        parent : (n,) ndarray of int, optional
            The side of a stroke that a seed is beside: 2 * stroke, plus 1 for the right side; -1 if
            there is none.

        Returns
        -------
        (n,) bool ndarray
            Which seeds were accepted.
        """
        count = len(particles)
        parent = np.full(count, -1) if parent is None else parent
        if not count:
            return np.zeros(0, dtype=bool)
        self.time += 1
        spacing = self._spacing_at(particles)
        stroke = self.strokes.add(
            heads=np.full(count, 2),
            parent=parent,
            alive=np.ones(count, dtype=bool),
            spacing=spacing,
        )
        if 2 * self.strokes.count > len(self.active_children):
            self.active_children = np.concatenate(
                [self.active_children, np.zeros(2 * self.strokes.count, dtype=np.int32)]
            )
        sample = self._add_samples(particles, stroke, np.zeros(count))
        self.strokes.seed[stroke] = sample
        self.strokes.ends[stroke] = sample[:, None]
        neighbors = self._find_neighbors(sample, self.rules.min_separation, self.rules.max_gap)
        self._remove_samples(sample[neighbors.rejected])
        self.strokes.alive[stroke[neighbors.rejected]] = False
        self._mark_covered(sample, neighbors)
        accepted = ~neighbors.rejected
        self._record_open_sides(sample[accepted])
        np.add.at(self.active_children, parent[accepted & (parent >= 0)], 1)
        accepted_indices = np.flatnonzero(accepted)
        for sign in (1.0, -1.0):
            tip_particles = particles.take(accepted_indices)
            tip_particles.sign = np.full(len(accepted_indices), sign)
            tip_stroke = stroke[accepted_indices].astype(np.int32)
            self._append_tips(
                _Tips(
                    tip_particles,
                    tip_stroke,
                    np.zeros(len(accepted_indices)),
                    np.ones(len(accepted_indices)),
                )
            )
        return accepted

    def _append_tips(self, new_tips: _Tips) -> None:
        tips = self.tips
        self.tips = _Tips(
            SurfaceParticles.concatenate(tips.particles, new_tips.particles),
            np.concatenate([tips.stroke, new_tips.stroke]),
            np.concatenate([tips.arc, new_tips.arc]),
            np.concatenate([tips.step_scale, new_tips.step_scale]),
        )

    def seed_neighbors(self) -> int:
        """Start strokes beside existing ones, and return how many.

        Each side of a stroke has at most one growing child at a time.
        """
        samples, strokes = self.samples, self.strokes
        sample, side = self.open_sides >> 1, self.open_sides & 1
        keep = samples.alive[sample] & ~samples.covered[sample, side]
        self.open_sides, sample, side = self.open_sides[keep], sample[keep], side[keep]
        stroke = samples.stroke[sample]
        ready = self.active_children[2 * stroke + side] == 0
        arc, lead = samples.arc[sample], PARENT_LEAD * samples.spacing[sample]
        ready &= (arc <= strokes.high[stroke] - lead) | strokes.high_done[stroke]
        ready &= (arc >= strokes.low[stroke] + lead) | strokes.low_done[stroke]
        sample, side = sample[ready], side[ready]
        if not len(sample):
            return 0
        sample, side, nearby, nearby_side = self._longest_open_runs(sample, side)
        samples.covered[nearby, nearby_side] = True
        self.recheck.append(nearby)
        particles, has_room = self._lateral_seeds(sample, side)
        parent = 2 * samples.stroke[sample].astype(np.int64) + side
        return int(self.add_seeds(particles.take(np.flatnonzero(has_room)), parent[has_room]).sum())

    def _longest_open_runs(self, sample: np.ndarray, side: np.ndarray) -> tuple[np.ndarray, ...]:
        """Find the middle of the longest open run on each side of each stroke.

        Returns
        -------
        sample, side : (k,) ndarray of int
            The middle of each run.
        nearby, nearby_side : (m,) ndarray of int
            All open sides within `RETRY_ARC` of a middle. If a seed does not fit there, one beside
            it rarely does.
        """
        samples = self.samples
        arc, key = samples.arc[sample], 2 * samples.stroke[sample].astype(np.int64) + side
        order = np.lexsort((arc, key))
        sample, side, arc, key = sample[order], side[order], arc[order], key[order]
        starts_run = np.ones(len(key), dtype=bool)
        starts_run[1:] = (key[1:] != key[:-1]) | (
            np.diff(arc) > 1.6 * SAMPLE_STEP * samples.spacing[sample[1:]]
        )
        first = np.flatnonzero(starts_run)
        length = np.diff(np.append(first, len(key)))
        by_length = np.lexsort((-length, key[first]))
        longest = np.unique(key[first][by_length], return_index=True)[1]
        run = by_length[longest]
        middle = first[run] + length[run] // 2
        run_middle = middle[np.searchsorted(key[middle], key)]
        is_nearby = np.abs(arc - arc[run_middle]) <= RETRY_ARC * samples.spacing[sample]
        return sample[middle], side[middle], sample[is_nearby], side[is_nearby]

    def _lateral_seeds(
        self, sample: np.ndarray, side: np.ndarray
    ) -> tuple[SurfaceParticles, np.ndarray]:
        """Return seeds beside samples, and (n,) bool: whether surface and field reach that far."""
        distance = np.ones(len(sample))
        particles, has_room = self._lateral_points(sample, side, distance)
        free_gap = self._free_gap(sample, particles, has_room)
        # If there is a stroke on the other side of the gap, divide the gap for one or two strokes.
        bounded = np.flatnonzero(np.isfinite(free_gap))
        full_gap = 1 + free_gap[bounded]
        shared_distance = full_gap / np.where(full_gap > 2.5, 3, 2)
        moved_particles, has_room[bounded] = self._lateral_points(
            sample[bounded], side[bounded], shared_distance
        )
        particles.assign(bounded, moved_particles)
        return particles, has_room

    def _lateral_points(
        self, sample: np.ndarray, side: np.ndarray, distance: np.ndarray
    ) -> tuple[SurfaceParticles, np.ndarray]:
        """Return the points at (n,) distances beside samples, in spacings.

        Returns
        -------
        particles : SurfaceParticles
        has_room : (n,) bool ndarray
            False if the surface ends before the point, or the field is zero there.
        """
        samples = self.samples
        particles = SurfaceParticles(
            samples.triangle[sample],
            samples.weights[sample],
            samples.own_member[sample],
            np.ones(len(sample)),
        )
        direction = samples.own_way[sample] * np.where(side == 0, 1j, -1j)
        length = distance * samples.spacing[sample]
        arrived, walked = trace_geodesics(self.mesh, particles, direction, length)
        return arrived, (walked >= 0.999 * length) & (arrived.member != 0)

    def _free_gap(
        self, sample: np.ndarray, particles: SurfaceParticles, has_room: np.ndarray
    ) -> np.ndarray:
        """Return (n,) gaps from seeds to the next stroke on the side away from the sample.

        They are in spacings, and infinite if there is no stroke or no room for the seed.
        """
        samples = self.samples
        free_gap = np.full(len(sample), np.inf)
        indices = np.flatnonzero(has_room)
        sample_count = samples.count
        probes = self._probe_samples(particles.take(indices))
        to_sample = samples.position[sample[indices]] - samples.position[probes]
        is_left = dot(to_sample, np.cross(samples.normal[probes], samples.direction[probes])) > 0
        gap = self._find_neighbors(probes, 0.0, np.inf).gap
        free_gap[indices] = gap[np.arange(len(indices)), is_left.astype(np.intp)]
        samples.count = sample_count
        return free_gap

    def is_uncovered(self, particles: SurfaceParticles) -> np.ndarray:
        """Return (n,) bool: whether no stroke of the same family is near each particle."""
        result = np.zeros(len(particles), dtype=bool)
        for start in range(0, len(particles), PROBE_BATCH_SIZE):
            batch = np.arange(start, min(start + PROBE_BATCH_SIZE, len(particles)))
            sample_count = self.samples.count
            probes = self._probe_samples(particles.take(batch))
            neighbors = self._find_neighbors(probes, MAX_COVERED_GAP, np.inf)
            result[batch] = ~neighbors.rejected
            self.samples.count = sample_count
        return result

    def _probe_samples(self, particles: SurfaceParticles) -> np.ndarray:
        """Append samples that are not in the grid. The caller has to reset `samples.count`."""
        grid, self.grid = self.grid, _NullGrid()
        try:
            return self._add_samples(
                particles, np.full(len(particles), -1, np.int32), np.zeros(len(particles))
            )
        finally:
            self.grid = grid


def _left_component(tangential: np.ndarray, frame: np.ndarray) -> np.ndarray:
    """Return the (n,) components of vectors to the left of the direction of frames."""
    return dot(tangential, np.cross(frame[:, 1], frame[:, 2]))


class _NullGrid:
    """A grid that discards points."""

    def add(self, points: np.ndarray) -> None:
        return None
