"""Place evenly spaced streamlines on a tangent mesh: they grow from seeds until it is covered.

After Jobard and Lefer, "Creating Evenly-Spaced Streamlines of Arbitrary Density" (1997). A stroke
starts beside an existing one, at the required spacing, and ends where it comes too near to another.
The differences are:

- Distances are measured on the surface.
- All strokes grow at the same time, each with two tips. New strokes are seeded beside a stroke that
  still grows, so fronts spread from few points and meet along few seams.
- A stroke also ends where the gap beside it is wider than the spacing but too narrow for another
  stroke, as in diverging fields. It yields to strokes that are seeded farther on, which are spaced
  better.

Only strokes of the same family keep a distance. Near each other, two strokes are of the same family
if their members match there. Their members elsewhere do not matter.
"""

from __future__ import annotations

import numpy as np

from ..field.frames import dot
from ..progress import Progress, Task
from .directional_spacing import CornerSpacing
from .growing_strokes import GrowingStrokes, StrokeSegments, Tips
from .lateral_neighbors import find_lateral_neighbors
from .samples import SAMPLE_STEP, StrokeSamples
from .seeding import lateral_seeds, longest_open_runs
from .separation_rules import SeparationRules
from .surface_particles import SurfaceParticles, TracedPath, advance
from .tangent_mesh import TangentMesh

#: If a step is rejected, a tip tries half of it, as long as this fraction of a full step is left.
MIN_STEP_SCALE = 0.2

#: A tip has moved if its path and the chord of its path are longer than this fraction of the step.
MIN_MOVED_RATIO = 0.02

#: Distance in spacings by which the tips of a parent have to be ahead of a seed beside it.
PARENT_LEAD = 2.5

#: Samples whose coverage is checked at once. Bounds memory.
RESCAN_BATCH_SIZE = 1 << 13


class StreamlinePlacer:
    """Strokes that grow on a tangent mesh, and the steps that let them grow.

    Parameters
    ----------
    mesh : TangentMesh
    spacing : CornerSpacing
    rules : SeparationRules

    Attributes
    ----------
    rules : SeparationRules
        The rules of the next steps. They may be changed between steps.
    samples : StrokeSamples
    strokes : GrowingStrokes
    tips : Tips
        The growing ends.
    segments : list of StrokeSegments
        The segments of all strokes, one entry for each step.

    Raises
    ------
    RosyError
        If the expected number of samples is too large.

    See Also
    --------
    rosy_addon.line_drawing.trace.place_streamlines_task : Runs the steps in their order.
    """

    def __init__(self, mesh: TangentMesh, spacing: CornerSpacing, rules: SeparationRules) -> None:
        self.mesh, self.spacing, self.rules = mesh, spacing, rules
        self.samples = StrokeSamples(mesh, spacing)
        self.strokes = GrowingStrokes()
        self.tips = Tips.empty()
        self.segments: list[StrokeSegments] = []

    # --- growing ----------------------------------------------------------------------------------

    def step(self) -> None:
        """Advance all tips by one sample. Tips that cannot advance end."""
        samples, strokes, tips = self.samples, self.strokes, self.tips
        samples.begin_step()
        particles, arc, has_moved, ended, path = self._advance_tips()
        moving = np.flatnonzero(has_moved)
        sample = samples.add(particles.take(moving), tips.stroke[moving], arc[moving])
        neighbors = find_lateral_neighbors(
            samples, sample, self.rules.min_separation, self.rules.max_gap
        )
        samples.remove(sample[neighbors.rejected])
        samples.mark_covered(neighbors.covering)
        accepted_sample = sample[~neighbors.rejected]
        samples.add_open_sides(accepted_sample)

        accepted, rejected = np.zeros((2, len(tips)), dtype=bool)
        accepted[moving[~neighbors.rejected]] = True
        rejected[moving[neighbors.rejected]] = True
        self.segments.append(StrokeSegments.of_tips(tips, path, accepted))
        strokes.extend(tips.stroke[accepted], tips.end[accepted], arc[accepted], accepted_sample)
        strokes.end_yielded[tips.stroke[moving], tips.end[moving]] = neighbors.yielded

        tips.step_scale[rejected] /= 2
        ended = np.where(rejected, tips.step_scale < MIN_STEP_SCALE, ended)
        max_length = self.rules.max_length * strokes.spacing[tips.stroke]
        ended |= strokes.length(tips.stroke) > max_length
        self._finish_tips(tips.take(np.flatnonzero(ended)))
        # Rejected tips try again from where they were.
        rejected_tips = np.flatnonzero(rejected)
        particles.assign(rejected_tips, tips.particles.take(rejected_tips))
        arc = np.where(rejected, tips.arc, arc)
        self.tips = Tips(particles, tips.stroke, arc, tips.step_scale).take(np.flatnonzero(~ended))

    def _advance_tips(
        self,
    ) -> tuple[SurfaceParticles, np.ndarray, np.ndarray, np.ndarray, TracedPath]:
        """Trace the next step of all tips, without comparing them with strokes.

        Returns
        -------
        particles : SurfaceParticles
            Positions after the step.
        arc : (n,) float64 ndarray
            Signed arc lengths after the step.
        has_moved, ended : (n,) bool ndarray
            Whether the tip has moved, and whether it cannot continue.
        path : TracedPath
        """
        mesh, tips = self.mesh, self.tips
        length = SAMPLE_STEP * self.samples.spacing_at(tips.particles) * tips.step_scale
        particles, walked, ended, path = advance(mesh, tips.particles, length)
        has_moved = walked > MIN_MOVED_RATIO * length
        chord = mesh.points_at(particles.triangle, particles.weights) - mesh.points_at(
            tips.particles.triangle, tips.particles.weights
        )
        # In sliver triangles, a particle may walk without a change of position.
        has_moved &= dot(chord, chord) > (MIN_MOVED_RATIO * length) ** 2
        arc = tips.arc + tips.particles.sign * walked
        return particles, arc, has_moved, ended | ~has_moved, path

    def _finish_tips(self, tips: Tips) -> None:
        """End tips. Strokes without tips that are too short are dropped."""
        strokes = self.strokes
        finished = strokes.finish_ends(tips.stroke, tips.end)
        min_length = self.rules.min_length * strokes.spacing[finished]
        self._drop_strokes(finished[strokes.length(finished) < min_length])

    def _drop_strokes(self, dropped: np.ndarray) -> None:
        """Remove strokes.

        The sides that they covered stay covered until `rescan_task`. Otherwise the same strokes would be
        seeded again.
        """
        if not len(dropped):
            return
        self.strokes.alive[dropped] = False
        self.samples.remove_strokes(
            self.strokes.alive, first=int(self.strokes.seed_sample[dropped].min())
        )

    def resume_yielded(self, rules: SeparationRules) -> None:
        """Change the rules, and let strokes that have yielded grow again."""
        self.rules = rules
        samples = self.samples
        stroke, end = self.strokes.resume_yielded_ends()
        sample = self.strokes.end_sample[stroke, end]
        particles = SurfaceParticles(
            samples.triangle[sample],
            samples.weights[sample],
            samples.local_member[sample],
            np.where(end > 0, 1.0, -1.0),
        )
        new_tips = Tips(
            particles, stroke.astype(np.int32), samples.arc[sample], np.ones(len(stroke))
        )
        self.tips = Tips.concatenate(self.tips, new_tips)

    def suspend(self) -> None:
        """End all tips as if they had yielded. No stroke is seeded beside them before `rescan_task`."""
        tips, self.tips = self.tips, Tips.empty()
        self.strokes.end_yielded[tips.stroke, tips.end] = True
        self._finish_tips(tips)
        self.samples.close_open_sides()

    def rescan_task(self, rules: SeparationRules) -> Task[None]:
        """Change the rules, and open sides again where strokes were dropped or seeds did not fit."""
        self.rules = rules
        samples = self.samples
        sample = samples.reset_coverage()
        for start in range(0, len(sample), RESCAN_BATCH_SIZE):
            yield Progress(samples.coverage, "looking for gaps")
            batch = sample[start : start + RESCAN_BATCH_SIZE]
            samples.mark_covered(find_lateral_neighbors(samples, batch, 0.0, np.inf).covering)
        samples.add_open_sides(sample)

    # --- seeds ------------------------------------------------------------------------------------

    def add_seeds(
        self, particles: SurfaceParticles, parent_side: np.ndarray | None = None
    ) -> np.ndarray:
        """Start strokes at the seeds that are far enough from other strokes.

        Parameters
        ----------
        particles : SurfaceParticles
            n seeds.
        parent_side : (n,) ndarray of int, optional
            The side of a stroke that a seed is beside: 2 * stroke, plus 1 for the right side; -1 if
            there is none.

        Returns
        -------
        (n,) bool ndarray
            Which seeds were accepted.
        """
        count = len(particles)
        if not count:
            return np.zeros(0, dtype=bool)
        parent_side = np.full(count, -1) if parent_side is None else parent_side
        samples, strokes = self.samples, self.strokes
        samples.begin_step()
        stroke = strokes.add(parent_side, samples.spacing_at(particles))
        sample = samples.add(particles, stroke, np.zeros(count))
        strokes.set_seeds(stroke, sample)
        neighbors = find_lateral_neighbors(
            samples, sample, self.rules.min_separation, self.rules.max_gap
        )
        samples.remove(sample[neighbors.rejected])
        strokes.alive[stroke[neighbors.rejected]] = False
        samples.mark_covered(neighbors.covering)
        accepted = np.flatnonzero(~neighbors.rejected)
        samples.add_open_sides(sample[accepted])
        strokes.add_active_children(parent_side[accepted], 1)
        for sign in (1.0, -1.0):
            tip_particles = particles.take(accepted)
            tip_particles.sign = np.full(len(accepted), sign)
            new_tips = Tips(
                tip_particles,
                stroke[accepted].astype(np.int32),
                np.zeros(len(accepted)),
                np.ones(len(accepted)),
            )
            self.tips = Tips.concatenate(self.tips, new_tips)
        return ~neighbors.rejected

    def seed_neighbors(self) -> int:
        """Start strokes beside existing ones, and return how many.

        Each side of a stroke has at most one growing child at a time. Only strokes that have reached
        the minimum length have children. They are never dropped under the same rules, and every call
        closes at least one of their open sides. Strokes of this length keep their separation, so a
        surface has room for finitely many, and seeding ends. Strokes that are dropped later could
        take turns with their own children for ever.
        """
        samples, strokes = self.samples, self.strokes
        sample, side = samples.open_sides()
        stroke = samples.stroke[sample]
        ready = strokes.active_children[stroke, side] == 0
        ready &= strokes.length(stroke) >= self.rules.min_length * strokes.spacing[stroke]
        ready &= strokes.is_clear_of_tips(
            stroke, samples.arc[sample], PARENT_LEAD * samples.spacing[sample]
        )
        sample, side = sample[ready], side[ready]
        if not len(sample):
            return 0
        sample, side, nearby, nearby_side = longest_open_runs(samples, sample, side)
        samples.close_sides(nearby, nearby_side)
        particles, has_room = lateral_seeds(samples, sample, side)
        parent_side = 2 * samples.stroke[sample].astype(np.int64) + side
        accepted = self.add_seeds(particles.take(np.flatnonzero(has_room)), parent_side[has_room])
        return int(accepted.sum())
