"""`GrowingStrokes`: a table of strokes while they grow; `Tips`: their growing ends.

An end of a stroke is 0 for the backward half and 1 for the forward half. A side of a stroke is
numbered 2 * stroke + side, where side is 0 for left and 1 for right.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .column_table import ColumnTable
from .surface_particles import SurfaceParticles


@dataclass(eq=False)
class Tips(SurfaceParticles):
    """The growing ends of strokes, n of them.

    The sign is that of the half of the stroke.

    Attributes
    ----------
    stroke : (n,) int32 ndarray
    arc : (n,) float64 ndarray
        Signed arc length from the seed, in world space.
    step_scale : (n,) float64 ndarray
        Fraction of a full step to try next.
    """

    stroke: np.ndarray
    arc: np.ndarray
    step_scale: np.ndarray

    @staticmethod
    def at(particles: SurfaceParticles, stroke: np.ndarray, arc: np.ndarray) -> Tips:
        """Return tips at particles that try full steps."""
        return Tips(*particles.columns, stroke.astype(np.int32), arc, np.ones(len(stroke)))

    @property
    def particles(self) -> SurfaceParticles:
        """Their positions: the same arrays."""
        return SurfaceParticles(self.triangle, self.weights, self.member, self.sign)

    @property
    def end(self) -> np.ndarray:
        """(n,) int64: the end of its stroke that each tip is, 0 or 1."""
        return np.where(self.sign > 0, 1, 0)


#: No tips.
NO_TIPS = Tips.at(SurfaceParticles.empty(), np.empty(0), np.empty(0))


class GrowingStrokes(ColumnTable):
    """Strokes while they grow: how far they reach, and what their ends are.

    Notes
    -----
    The columns, with a row for each stroke:

    alive : bool
        False for strokes that were rejected or dropped.
    spacing : float64
        Spacing at the seed, in world space.
    parent_side : int64
        The side of a stroke beside which the stroke was seeded, or -1.
    active_children : (2,) int32
        Number of growing strokes that were seeded beside the left and the right side.
    seed_sample : int32
        The sample at the seed. Other samples of the stroke have higher numbers.
    tip_count : int32
        Number of growing tips, 0 to 2.
    min_arc, max_arc : float64
        Range of the signed arc length.
    end_sample : (2,) int32
        The samples at both ends.
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
        """Add n strokes with two tips each, and return their numbers."""
        count = len(parent_side)
        return self.append(
            alive=np.ones(count, dtype=bool),
            spacing=spacing,
            parent_side=parent_side,
            tip_count=np.full(count, 2),
        )

    def set_seeds(self, stroke: np.ndarray, sample: np.ndarray) -> None:
        """Set the samples at the seeds of new strokes. They are also the samples at both ends."""
        self.seed_sample[stroke] = sample
        self.end_sample[stroke] = sample[:, None]

    def add_active_children(self, parent_side: np.ndarray, change: int) -> None:
        """Add `change` to the number of active children of each given side; -1 is no side."""
        parent_side = parent_side[parent_side >= 0]
        np.add.at(self.active_children, (parent_side >> 1, parent_side & 1), change)

    def extend(
        self, stroke: np.ndarray, end: np.ndarray, arc: np.ndarray, sample: np.ndarray
    ) -> None:
        """Extend n ends to new samples at the given signed arc lengths.

        The samples of one end are in order, so that the last one is the new end.
        """
        self.end_sample[stroke, end] = sample
        np.maximum.at(self.max_arc, stroke, arc)
        np.minimum.at(self.min_arc, stroke, arc)

    def length(self, stroke: np.ndarray) -> np.ndarray:
        """Return (n,) float64: the lengths of strokes, in world space."""
        return self.max_arc[stroke] - self.min_arc[stroke]

    def is_clear_of_tips(
        self, stroke: np.ndarray, arc: np.ndarray, distance: np.ndarray
    ) -> np.ndarray:
        """Return (n,) bool: whether no growing tip of the stroke is within a distance along it.

        All parameters are (n,): strokes, signed arc lengths and distances, in world space.
        """
        is_clear = (arc <= self.max_arc[stroke] - distance) | self.end_done[stroke, 1]
        is_clear &= (arc >= self.min_arc[stroke] + distance) | self.end_done[stroke, 0]
        return is_clear

    def finish_ends(self, stroke: np.ndarray, end: np.ndarray) -> np.ndarray:
        """End n tips, and return the numbers of strokes that have no tips left."""
        self.end_done[stroke, end] = True
        np.subtract.at(self.tip_count, stroke, 1)
        finished = np.unique(stroke)
        finished = finished[self.tip_count[finished] == 0]
        self.add_active_children(self.parent_side[finished], -1)
        return finished

    def resume_yielded_ends(self) -> tuple[np.ndarray, np.ndarray]:
        """Let ends that have yielded grow again.

        Strokes that had no tips left are no longer counted as children of their parents.

        Returns
        -------
        stroke, end : (k,) int64 ndarray
            The ends that need a tip.
        """
        rows = slice(self.count)
        stroke, end = np.nonzero(
            self.end_yielded[rows] & self.alive[rows, None] & self.end_done[rows]
        )
        self.parent_side[stroke[self.tip_count[stroke] == 0]] = -1
        np.add.at(self.tip_count, stroke, 1)
        return stroke, end
