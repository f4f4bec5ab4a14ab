"""Place evenly spaced streamlines on a tangent mesh: they grow from seeds until it is covered.

The method is based on Jobard and Lefer, "Creating Evenly-Spaced Streamlines of Arbitrary Density" (1997). A
stroke starts beside an existing stroke, at the required spacing, and ends where it comes too near to another
stroke. The differences are:

- Distances are measured on the surface.
- All strokes grow at the same time, each at two ends, its tips. New strokes are seeded beside strokes that
  still grow. So the covered area grows from few points, and its fronts meet along few seams.
- A stroke also ends where the gap beside it is wider than the spacing but too narrow for another
  stroke, as in diverging fields. It yields: it leaves this area to strokes that are seeded later, which are
  spaced better.

Only strokes of the same family keep a distance. Two strokes near each other are of the same family
if their members of the field match there. Their members elsewhere do not matter.

The two ends of a stroke are numbered: 0 is the end of the half that was traced backward from the seed, 1 the
end of the forward half. A side of a stroke has the number 2 * stroke + side, where side is 0 for left and 1
for right.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ..core.progress import report
from ..field.blocks import row_blocks
from ..field.frames import dot
from .lateral_neighbors import LateralNeighbors, SeparationRules, find_lateral_neighbors
from .path_samples import PathSamples, SampledPath
from .samples import SAMPLE_STEP, ColumnTable, StrokeSamples
from .seeding import lateral_seeds, longest_open_runs
from .spacing import CornerSpacing
from .surface_particles import SurfaceParticles, advance
from .tangent_mesh import TangentMesh

#: If a step is rejected, a tip tries half of it, as long as the step is not below this fraction of a full
#: step.
MIN_STEP_SCALE = 0.2

#: Largest number of samples by which a tip grows at once after its step was shortened. Such a tip is about to
#: end, and tracing beyond its end is wasted time.
MAX_RETRIED_SAMPLES = 2

#: Largest number of samples along a segment. Widths and tones are only stored at the ends of segments.
SAMPLES_PER_SEGMENT = 2

#: Number of segments that a tip may trace at once: `SEGMENTS_PER_SAMPLE` for each sample, at least
#: `MIN_SEGMENTS`.
SEGMENTS_PER_SAMPLE, MIN_SEGMENTS = 2, 16

#: A tip counts as moved only if its path and the chord of its path are longer than this fraction of the step.
MIN_MOVED_RATIO = 0.02

#: Distance in spacings by which the tips of a stroke have to be ahead of a new seed beside it.
PARENT_LEAD = 2.5

#: Number of samples whose coverage is checked at once. It bounds memory.
RESCAN_BATCH_SIZE = 1 << 13


@dataclass(eq=False)
class Tips(SurfaceParticles):
    """The n growing ends of strokes, as particles with further attributes.

    The sign of a particle is 1 in the forward half of a stroke and -1 in the backward half.

    Attributes
    ----------
    stroke : (n,) int32 ndarray
        Index of the stroke.
    arc : (n,) float64 ndarray
        Signed arc length from the seed of the stroke, in world space.
    step_scale : (n,) float64 ndarray
        Fraction of a full step that the tip tries next.
    """

    stroke: np.ndarray
    arc: np.ndarray
    step_scale: np.ndarray

    @staticmethod
    def at(particles: SurfaceParticles, stroke: np.ndarray, arc: np.ndarray) -> Tips:
        """Return tips at particles. They try full steps next."""
        return Tips(*particles.columns, stroke.astype(np.int32), arc, np.ones(len(stroke)))

    @property
    def particles(self) -> SurfaceParticles:
        """The tips as particles, which share the arrays of the tips."""
        return SurfaceParticles(self.triangle, self.weights, self.member, self.sign)

    @property
    def end(self) -> np.ndarray:
        """(n,) int64: 1 if a tip is the forward end of its stroke, 0 if it is the backward end."""
        return np.where(self.sign > 0, 1, 0)


#: A set of 0 tips.
NO_TIPS = Tips.at(SurfaceParticles.empty(), np.empty(0), np.empty(0))


class GrowingStrokes(ColumnTable):
    """A table of strokes while they grow: their extents and the states of their ends.

    Notes
    -----
    The columns, with a row for each stroke:

    alive : bool
        False for strokes that were rejected at their seed or removed later.
    spacing : float64
        Spacing at the seed, in world space.
    parent_side : int64
        Where the stroke was seeded: 2 * s beside the left side of stroke s, 2 * s + 1 beside the right side,
        or -1 if it was not seeded beside a stroke.
    active_children : (2,) int32
        Number of growing strokes that were seeded beside the left and the right side of the stroke.
    seed_sample : int32
        Index of the sample at the seed. Other samples of the stroke have higher indices.
    tip_count : int32
        Number of growing ends, 0 to 2.
    min_arc, max_arc : float64
        Range of the signed arc length from the seed, in world space.
    end_sample : (2,) int32
        Indices of the samples at the backward and the forward end.
    end_yielded : (2,) bool
        Whether the ends have yielded; see `LateralNeighbors.yielded`.
    end_done : (2,) bool
        Whether the ends have stopped growing.
    """

    alive = np.empty(0, bool)
    spacing = np.empty(0)
    parent_side = np.empty(0, np.int64)
    active_children = np.empty((0, 2), np.int32)
    seed_sample = np.empty(0, np.int32)
    tip_count = np.empty(0, np.int32)
    min_arc = np.empty(0)
    max_arc = np.empty(0)
    end_sample = np.empty((0, 2), np.int32)
    end_yielded = np.empty((0, 2), bool)
    end_done = np.empty((0, 2), bool)

    def add(self, parent_side: np.ndarray, spacing: np.ndarray) -> np.ndarray:
        """Add n strokes with two growing ends each, and return their indices.

        `parent_side` and `spacing`, (n,), are the values of the columns of these names.
        """
        columns = {"spacing": spacing, "parent_side": parent_side}
        return self.append(len(spacing), alive=True, tip_count=2, **columns)

    def add_active_children(self, parent_side: np.ndarray, change: int) -> None:
        """Add `change` to the number of growing strokes seeded beside each given side of a stroke.

        `parent_side` holds 2 * stroke for left sides and 2 * stroke + 1 for right sides. Values of -1 are
        ignored.
        """
        parent_side = parent_side[parent_side >= 0]
        np.add.at(self.active_children, (parent_side >> 1, parent_side & 1), change)

    def extend(
        self, stroke: np.ndarray, end: np.ndarray, arc: np.ndarray, sample: np.ndarray
    ) -> None:
        """Extend ends of strokes by n new samples at the given signed arc lengths.

        The samples of the same end are in the order of growth, so that the last one is the new end.
        """
        self.end_sample[stroke, end] = sample
        np.maximum.at(self.max_arc, stroke, arc)
        np.minimum.at(self.min_arc, stroke, arc)

    def length(self, stroke: np.ndarray) -> np.ndarray:
        """Return (n,) float64: the lengths of strokes, in world space."""
        return self.max_arc[stroke] - self.min_arc[stroke]

    def finish_ends(self, stroke: np.ndarray, end: np.ndarray) -> np.ndarray:
        """Mark n ends as finished. Return the indices of strokes that have no growing end left.

        `stroke` and `end`, (n,), are the strokes and their ends: 0 is the backward end, 1 the forward end.
        """
        self.end_done[stroke, end] = True
        np.subtract.at(self.tip_count, stroke, 1)
        finished = np.unique(stroke)
        finished = finished[self.tip_count[finished] == 0]
        self.add_active_children(self.parent_side[finished], -1)
        return finished

    def resume_yielded_ends(self) -> tuple[np.ndarray, np.ndarray]:
        """Let the ends that have yielded grow again.

        A stroke that had no growing end left has already been subtracted from `active_children` of the stroke
        beside which it was seeded. Its `parent_side` becomes -1, so that it is not subtracted again.

        Returns
        -------
        stroke, end : (k,) int64 ndarray
            Strokes, and their ends (0 or 1) that have to grow again.
        """
        resumes = self.end_yielded & self.alive[:, None] & self.end_done
        stroke, end = np.nonzero(resumes[: self.count])
        self.parent_side[stroke[self.tip_count[stroke] == 0]] = -1
        np.add.at(self.tip_count, stroke, 1)
        return stroke, end


class StreamlinePlacer:
    """Growing strokes on a tangent mesh, with methods to seed them and to let them grow.

    Parameters
    ----------
    mesh : TangentMesh
    spacing : CornerSpacing
        Required spacing of strokes.

    Attributes
    ----------
    rules : SeparationRules
        The rules that the next calls of methods follow. They may be changed between calls.
    samples : StrokeSamples
        Samples of all strokes.
    strokes : GrowingStrokes
        Table of all strokes.
    tips : Tips
        The growing ends of strokes.
    segments : list of tuple of ndarray
        The segments of all strokes in the order in which they were traced. Each call of `grow` appends a
        tuple for its m segments: (m,) indices of strokes, (m,) signs of their halves, and `triangle`,
        `begin_weights`, `end_weights` and `direction` as in `TracedPath`.

    Raises
    ------
    RosyError
        If the expected number of samples is too large.

    See Also
    --------
    rosy_addon.line_drawing.trace.place_streamlines : Calls these methods until the mesh is covered.
    """

    def __init__(self, mesh: TangentMesh, spacing: CornerSpacing) -> None:
        self.mesh, self.spacing, self.rules = mesh, spacing, SeparationRules()
        self.samples = StrokeSamples(mesh, spacing)
        self.strokes = GrowingStrokes()
        self.tips = NO_TIPS
        self.segments: list[tuple[np.ndarray, ...]] = []

    # --- growing ----------------------------------------------------------------------------------

    def grow(self, sample_count: int) -> None:
        """Let all tips grow by up to `sample_count` samples. Tips that cannot grow end.

        Samples are accepted in the same order as if all tips grew by one sample at a time. Tips whose step
        has been shortened grow by at most `MAX_RETRIED_SAMPLES`.
        """
        samples, strokes, tips = self.samples, self.strokes, self.tips
        path, traced, ended = self._trace_samples(sample_count)
        tip, tip_count = traced.particle, len(tips)
        stroke, arc = tips.stroke[tip], tips.arc[tip] + traced.position.sign * traced.arc
        sample = samples.add(traced.position, stroke, arc, samples.next_steps(traced.rank))
        neighbors = self._compare(sample, traced.previous)
        accepted = np.flatnonzero(~neighbors.rejected)
        strokes.extend(stroke[accepted], tips.end[tip[accepted]], arc[accepted], sample[accepted])
        traced_count = np.bincount(tip, minlength=tip_count)
        strokes.end_yielded[tips.stroke, tips.end] &= traced_count == 0
        yielding = tip[neighbors.yielded]
        strokes.end_yielded[tips.stroke[yielding], tips.end[yielding]] = True

        # Tips continue from their last accepted sample. If the next sample was rejected, they try half of
        # the step.
        last = np.full(tip_count, -1)
        last[tip[accepted]] = accepted
        rejected = traced_count > np.bincount(tip[accepted], minlength=tip_count)
        moved = np.flatnonzero(last >= 0)
        walked = np.zeros(tip_count)
        walked[moved] = traced.arc[last[moved]]
        particle, *segments, _, _ = path.cut(walked)
        sign = tips.sign[particle].astype(np.int8)
        self.segments.append((tips.stroke[particle], sign, *segments))
        tips.particles.assign(moved, traced.position.take(last[moved]))
        tips.arc += tips.sign * walked
        tips.step_scale[rejected] /= 2
        ended = np.where(rejected, tips.step_scale < MIN_STEP_SCALE, ended)
        self._finish_tips(tips.take(np.flatnonzero(ended)))
        self.tips = tips.take(np.flatnonzero(~ended))

    def _compare(self, sample: np.ndarray, previous: np.ndarray | None = None) -> LateralNeighbors:
        """Compare new samples with others by the rules, and remove the rejected samples.

        `sample` holds the indices of the new samples, and `previous`, for each of them, the position in
        `sample` of the sample before it at the same end of its stroke, or -1.
        """
        min_separation, max_gap = self.rules.min_separation, self.rules.max_gap
        neighbors = find_lateral_neighbors(self.samples, sample, min_separation, max_gap, previous)
        self.samples.remove(sample[neighbors.rejected])
        self.samples.mark_covered(neighbors.covering)
        self.samples.add_open_sides(sample[~neighbors.rejected])
        return neighbors

    def _trace_samples(self, sample_count: int) -> tuple[SampledPath, PathSamples, np.ndarray]:
        """Trace the next samples of all n tips, without comparing them with other strokes.

        Returns
        -------
        path : SampledPath
            Paths of the tips.
        traced : PathSamples
            Samples along these paths. `PathSamples.particle` is the index of the tip.
        ended : (n,) bool ndarray
            Whether a tip cannot continue after its last sample.
        """
        mesh, tips = self.mesh, self.tips
        step = SAMPLE_STEP * tips.step_scale * self.samples.spacing_at(tips)
        count = np.where(tips.step_scale < 1, min(sample_count, MAX_RETRIED_SAMPLES), sample_count)
        limit = max(MIN_SEGMENTS, SEGMENTS_PER_SAMPLE * int(count.max()))
        longest = SAMPLES_PER_SEGMENT * step
        _, _, ended, path = advance(mesh, tips.particles, count * step, None, longest, limit)
        path = SampledPath(path, tips.sign)

        def next_step(position: SurfaceParticles, tip: np.ndarray) -> np.ndarray:
            return SAMPLE_STEP * tips.step_scale[tip] * self.samples.spacing_at(position)

        traced = path.samples(step, next_step, ended)
        # In sliver triangles, a particle may walk without a change of position.
        start = mesh.points_at(tips.triangle, tips.weights)
        points = mesh.points_at(traced.position.triangle, traced.position.weights)
        is_first = traced.previous < 0
        before = np.where(is_first[:, None], start[traced.particle], points[traced.previous])
        walked = traced.arc - np.where(is_first, 0, traced.arc[traced.previous])
        chord = points - before
        least = MIN_MOVED_RATIO * step[traced.particle]
        has_moved = (walked > least) & (dot(chord, chord) > least * least)
        ended |= np.bincount(traced.particle, minlength=len(tips)) == 0
        if not has_moved.all():
            ended[traced.particle[~has_moved]] = True
            table = np.ones((len(tips), int(traced.rank.max()) + 1), dtype=bool)
            table[traced.particle, traced.rank] = has_moved
            kept = np.logical_and.accumulate(table, axis=1)[traced.particle, traced.rank]
            traced = traced.take(np.flatnonzero(kept))
        return path, traced, ended

    def _finish_tips(self, tips: Tips) -> None:
        """End the given tips. Remove strokes that have no tips left and are too short."""
        strokes = self.strokes
        finished = strokes.finish_ends(tips.stroke, tips.end)
        min_length = self.rules.min_length * strokes.spacing[finished]
        dropped = finished[strokes.length(finished) < min_length]
        if len(dropped):
            # The sides of other strokes that they covered stay covered until `rescan`. Otherwise the same
            # strokes would be seeded again.
            strokes.alive[dropped] = False
            self.samples.remove_strokes(strokes.alive, int(strokes.seed_sample[dropped].min()))

    def resume_yielded(self, rules: SeparationRules) -> None:
        """Change the rules, and let strokes that have yielded grow again."""
        self.rules = rules
        samples = self.samples
        stroke, end = self.strokes.resume_yielded_ends()
        sample = self.strokes.end_sample[stroke, end]
        particles = samples.particles(sample, np.where(end > 0, 1.0, -1.0))
        self.tips = self.tips.join(Tips.at(particles, stroke, samples.arc[sample]))

    def suspend(self) -> None:
        """End all tips as if they had yielded.

        No stroke is seeded beside existing strokes before `rescan`.
        """
        tips, self.tips = self.tips, NO_TIPS
        self.strokes.end_yielded[tips.stroke, tips.end] = True
        self._finish_tips(tips)
        self.samples.close_open_sides()

    def rescan(self, rules: SeparationRules) -> None:
        """Change the rules, and allow seeds again where strokes were removed or earlier seeds did not fit.

        Sides of samples are tested again if they were covered by a stroke that has been removed, or were
        closed by `suspend` or after a seed did not fit. They become open if no stroke is beside them.
        """
        self.rules = rules
        samples = self.samples
        sample = samples.reset_coverage()
        for batch in row_blocks(len(sample), RESCAN_BATCH_SIZE):
            report(samples.coverage, "looking for gaps")
            neighbors = find_lateral_neighbors(samples, sample[batch], 0.0, np.inf)
            samples.mark_covered(neighbors.covering)
        samples.add_open_sides(sample)

    # --- seeds ------------------------------------------------------------------------------------

    def add_seeds(self, particles: SurfaceParticles, parent_side: np.ndarray | None = None) -> int:
        """Start strokes at the seeds that are far enough from other strokes, and return their number.

        Parameters
        ----------
        particles : SurfaceParticles
            The n seeds.
        parent_side : (n,) ndarray of int, optional
            For seeds beside strokes: 2 * stroke if the seed is beside its left side, 2 * stroke + 1 if beside
            its right side. -1 for other seeds.
        """
        count = len(particles)
        parent_side = np.full(count, -1) if parent_side is None else parent_side
        samples, strokes = self.samples, self.strokes
        stroke = strokes.add(parent_side, samples.spacing_at(particles))
        step = samples.next_steps(np.zeros(count, dtype=np.int32))
        sample = samples.add(particles, stroke, np.zeros(count), step)
        strokes.seed_sample[stroke], strokes.end_sample[stroke] = sample, sample[:, None]
        is_accepted = ~self._compare(sample).rejected
        strokes.alive[stroke] = is_accepted
        accepted = np.flatnonzero(is_accepted)
        strokes.add_active_children(parent_side[accepted], 1)
        particles, zeros = particles.take(accepted), np.zeros(len(accepted))
        for sign in (1.0, -1.0):
            half = replace(particles, sign=zeros + sign)
            self.tips = self.tips.join(Tips.at(half, stroke[accepted], zeros))
        return len(accepted)

    def seed_neighbors(self) -> int:
        """Start strokes beside open sides of existing strokes, and return the number of new strokes.

        A stroke that was seeded beside another one is its child. Each side of a stroke has at most one
        growing child at a time. Only strokes that have reached the minimum length get children. Such strokes
        are never removed under the same rules, and every call closes at least one of their open sides. A
        surface has room for finitely many such strokes, so seeding ends. If shorter strokes had children, a
        stroke and its child could be removed and seeded again in turn, without end.
        """
        samples, strokes = self.samples, self.strokes
        sample, side = samples.open_sides()
        stroke = samples.stroke[sample]
        ready = strokes.active_children[stroke, side] == 0
        ready &= strokes.length(stroke) >= self.rules.min_length * strokes.spacing[stroke]
        arc, lead = samples.arc[sample], PARENT_LEAD * samples.spacing[sample]
        ready &= (arc <= strokes.max_arc[stroke] - lead) | strokes.end_done[stroke, 1]
        ready &= (arc >= strokes.min_arc[stroke] + lead) | strokes.end_done[stroke, 0]
        sample, side = sample[ready], side[ready]
        if not len(sample):
            return 0
        sample, side, nearby, nearby_side = longest_open_runs(samples, sample, side)
        samples.close_sides(nearby, nearby_side)
        particles, has_room = lateral_seeds(samples, sample, side)
        parent_side = 2 * samples.stroke[sample].astype(np.int64) + side
        return self.add_seeds(particles.take(np.flatnonzero(has_room)), parent_side[has_room])
