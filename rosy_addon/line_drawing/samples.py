"""A table of samples of growing strokes, with a spatial grid to find them, and the state of their sides.

Strokes are sampled every half spacing. The left or right side of a sample is covered if there is another
stroke beside the sample on this side. Otherwise, the side is open. New strokes are seeded at open sides.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import NamedTuple

import numpy as np

from ..core.errors import RosyError
from ..field.frames import transport
from .point_grid import PointGrid, grow_to
from .spacing import CornerSpacing
from .surface_particles import SurfaceParticles
from .tangent_mesh import TangentMesh

#: Distance between consecutive samples of a stroke, in spacings.
SAMPLE_STEP = 0.5

#: Radius around a sample in which neighbors are searched, in spacings.
SEARCH_RADIUS = 1.6

#: Largest expected number of samples. It bounds memory and time.
MAX_EXPECTED_SAMPLES = 5e7

#: Number of rows for which a new table has memory. It is doubled when more rows are needed.
INITIAL_CAPACITY = 1024


class ColumnTable:
    """A table to which rows are appended. Each column is an array and an attribute.

    A subclass declares each column as a class attribute: an array of the shape and dtype of the column, with
    no rows.

    Arrays are longer than `count`. The rows after it are reserved for later. When a column grows, it is
    replaced by a new array, so do not keep references to columns across `append`.

    Attributes
    ----------
    count : int
        Number of rows.
    """

    def __init__(self) -> None:
        self.count = 0
        columns = vars(type(self)).items()
        self._column_names = [name for name, column in columns if isinstance(column, np.ndarray)]
        for name in self._column_names:
            column = getattr(self, name)
            setattr(self, name, np.zeros((INITIAL_CAPACITY, *column.shape[1:]), column.dtype))

    def append(self, row_count: int, **values: np.ndarray | float) -> np.ndarray:
        """Append rows with the given columns, and return their indices.

        Each value is an array with a value for each row, or one value for all. Other columns are 0 there.
        """
        first, self.count = self.count, self.count + row_count
        for name in self._column_names:
            column = grow_to(getattr(self, name), self.count, 0)
            setattr(self, name, column)
            if name in values:
                column[first : self.count] = values[name]
        return np.arange(first, self.count)


class CoveringPairs(NamedTuple):
    """m pairs of samples that are beside each other, so that each covers a side of the other.

    Attributes
    ----------
    sample, neighbor : (m,) ndarray of int
        Indices of the two samples.
    sample_side : (m,) intp ndarray
        The side of the sample on which the neighbor is: 0 for left and 1 for right.
    neighbor_side : (m,) intp ndarray
        The side of the neighbor on which the sample is.
    """

    sample: np.ndarray
    neighbor: np.ndarray
    sample_side: np.ndarray
    neighbor_side: np.ndarray


class StrokeSamples(ColumnTable):
    """The samples of growing strokes on a tangent mesh, which can be found by index or by position.

    Parameters
    ----------
    mesh : TangentMesh
    spacing : CornerSpacing
        Required spacing of strokes.

    Attributes
    ----------
    expected_count : float
        Estimate of the final number of samples.
    current_step : int
        Number of steps of growth so far. In each step, a growing end of a stroke gets at most one sample.

    Raises
    ------
    RosyError
        If the expected number of samples is too large.

    Notes
    -----
    The columns, with a row for each sample:

    frame : (4, 3) float64
        Position, unit normal, unit direction of the stroke and unit member of the field, in world space. They
        are in one column because they are used together.
    spacing : float64
        Required spacing, in world space.
    stroke : int32
        Index of the stroke.
    arc : float64
        Signed arc length from the seed of the stroke, in world space.
    step : int32
        Step of growth in which the sample was added.
    alive : bool
        False for removed samples.
    covered : (2,) bool
        Whether the left and the right side are covered.
    side_neighbor : (2,) int32
        Index of the sample that covers the left and the right side, or -1. If there are several, it is the
        one found last. When the sample of this row is removed, the sides of these neighbors are tested again,
        because they may have become open.
    triangle, weights : int32, (3,) float64
        Position as a triangle and barycentric coordinates in it.
    local_member, local_direction : complex128
        Unit member and direction of the stroke, in the frame of the triangle.
    """

    frame = np.empty((0, 4, 3))
    spacing = np.empty(0)
    stroke = np.empty(0, np.int32)
    arc = np.empty(0)
    step = np.empty(0, np.int32)
    alive = np.empty(0, bool)
    covered = np.empty((0, 2), bool)
    side_neighbor = np.empty((0, 2), np.int32)
    triangle = np.empty(0, np.int32)
    weights = np.empty((0, 3))
    local_member = np.empty(0, complex)
    local_direction = np.empty(0, complex)

    def __init__(self, mesh: TangentMesh, spacing: CornerSpacing) -> None:
        super().__init__()
        self.mesh, self.required_spacing = mesh, spacing
        mean_spacing = np.einsum("tk->t", spacing.values) / 3
        squares = float((mesh.area / mean_spacing**2).sum())
        self.expected_count = squares * mesh.family_count / SAMPLE_STEP
        if not self.expected_count < MAX_EXPECTED_SAMPLES:
            raise RosyError("there would be too many strokes: increase the spacing")
        cell = 1.01 * SEARCH_RADIUS * float(np.median(mean_spacing))
        self.grid = PointGrid(cell, int(self.expected_count))
        self.current_step = 0
        # Open sides, as 2 * sample + side. Some of them may have been covered later. The next call of
        # `open_sides` removes these.
        self._open_sides = np.empty(0, dtype=np.int64)
        # Arrays of samples whose sides `reset_coverage` resets.
        self._recheck: list[np.ndarray] = []

    @property
    def position(self) -> np.ndarray:
        """Positions of the samples, in world space."""
        return self.frame[:, 0]

    @property
    def normal(self) -> np.ndarray:
        """Unit shading normals at the samples, in world space."""
        return self.frame[:, 1]

    @property
    def direction(self) -> np.ndarray:
        """Unit directions of strokes at the samples, in world space."""
        return self.frame[:, 2]

    def spacing_at(self, particles: SurfaceParticles) -> np.ndarray:
        """Return (n,) float64: the required spacing at particles, in world space."""
        return self.required_spacing.at(particles.triangle, particles.weights, particles.member)

    def particles(self, sample: np.ndarray, sign: np.ndarray) -> SurfaceParticles:
        """Return particles at the samples with the given indices. `sign`, (n,), is 1 or -1 for each."""
        columns = self.triangle, self.weights, self.local_member
        return SurfaceParticles(*(column[sample] for column in columns), sign)

    # --- adding and removing ----------------------------------------------------------------------

    def next_steps(self, step: np.ndarray) -> np.ndarray:
        """Begin new steps of growth, and return their numbers among all steps so far.

        `step`, (n,) int, numbers the new steps from 0. The result, (n,) int, continues the numbers of earlier
        steps. `current_step` becomes the number of the last new step.
        """
        first = self.current_step + 1
        self.current_step = first + int(step.max(initial=0))
        return first + step

    def add(
        self, particles: SurfaceParticles, stroke: np.ndarray, arc: np.ndarray, step: np.ndarray
    ) -> np.ndarray:
        """Add samples at n particles.

        Parameters
        ----------
        particles : SurfaceParticles
        stroke : (n,) ndarray of int
            Indices of their strokes.
        arc : (n,) ndarray
            Signed arc lengths from the seeds, in world space.
        step : (n,) ndarray of int
            Numbers of the steps of growth in which the samples are added, from `next_steps`.

        Returns
        -------
        (n,) ndarray of int
            Indices of the new samples.
        """
        sample = self._append_at(particles, stroke=stroke, arc=arc, step=step)
        self.grid.add(self.position[sample], SEARCH_RADIUS * self.spacing[sample])
        return sample

    @contextmanager
    def probes(self, particles: SurfaceParticles) -> Iterator[np.ndarray]:
        """Context manager: add temporary samples at n particles, and yield their indices.

        They can be compared with the other samples, but comparisons of other samples do not find them. Do not add
        samples in the block.
        """
        count = self.count
        try:
            yield self._append_at(particles, stroke=-1, arc=0.0, step=self.current_step)
        finally:
            self.count = count

    def _append_at(self, particles: SurfaceParticles, **columns: np.ndarray | float) -> np.ndarray:
        """Append samples at particles to the table, but not to the grid, and return their indices.

        `columns` are the columns `stroke`, `arc` and `step`.
        """
        mesh, triangle, weights = self.mesh, particles.triangle, particles.weights
        member = mesh.members_at(triangle, weights, particles.member)
        member = np.where(member == 0, particles.member, member)
        direction = mesh.directions_at(triangle, weights, member)
        position = mesh.points_at(triangle, weights)
        normal = mesh.limited_normals_at(triangle, weights)
        flat = mesh.normal[triangle]
        world_member = world_direction = transport(mesh.to_world(triangle, direction), flat, normal)
        if direction is not member:
            world_member = transport(mesh.to_world(triangle, member), flat, normal)
        return self.append(
            len(triangle),
            frame=np.stack([position, normal, world_direction, world_member], axis=1),
            spacing=self.spacing_at(particles),
            alive=True,
            side_neighbor=-1,
            triangle=triangle,
            weights=weights,
            local_member=member,
            local_direction=direction,
            **columns,
        )

    def remove(self, sample: np.ndarray) -> None:
        """Remove the samples with the given indices.

        The sides of other samples that they cover stay covered until `reset_coverage`.
        """
        self.alive[sample] = False
        self.grid.remove(sample)

    def remove_strokes(self, stroke_alive: np.ndarray, first: int) -> None:
        """Remove all samples of strokes that are not alive.

        The next call of `reset_coverage` then resets the sides of their neighbors.

        Parameters
        ----------
        stroke_alive : (S,) bool ndarray
            Whether each of all strokes is alive.
        first : int
            Index of the first sample that may have to be removed.
        """
        removed = ~stroke_alive[self.stroke[first : self.count]]
        removed &= self.alive[first : self.count]
        sample = first + np.flatnonzero(removed)
        neighbor = self.side_neighbor[sample].ravel()
        self._recheck.append(neighbor[neighbor >= 0])
        self.remove(sample)

    # --- coverage of sides ------------------------------------------------------------------------

    def mark_covered(self, pairs: CoveringPairs) -> None:
        """Mark the sides on which the two samples of each pair face each other as covered."""
        self.covered[pairs.sample, pairs.sample_side] = True
        self.covered[pairs.neighbor, pairs.neighbor_side] = True
        self.side_neighbor[pairs.sample, pairs.sample_side] = pairs.neighbor

    def add_open_sides(self, sample: np.ndarray) -> None:
        """Add the uncovered sides of the given samples to the list of open sides."""
        covered = self.covered[sample]
        added = 2 * sample[~covered[:, 0]], 2 * sample[~covered[:, 1]] + 1
        self._open_sides = np.concatenate([self._open_sides, *added])

    @property
    def coverage(self) -> float:
        """Number of samples over the expected number, at most 0.99."""
        return min(self.count / max(self.expected_count, 1), 0.99)

    @property
    def has_open_sides(self) -> bool:
        """Whether any sides were open at the last call of `open_sides`, or have been added since then."""
        return len(self._open_sides) > 0

    def open_sides(self) -> tuple[np.ndarray, np.ndarray]:
        """Return all open sides: (k,) indices of samples, and (k,) sides. 0 is the left side, 1 the right."""
        sample, side = self._open_sides >> 1, self._open_sides & 1
        keep = self.alive[sample] & ~self.covered[sample, side]
        self._open_sides = self._open_sides[keep]
        return sample[keep], side[keep]

    def close_sides(self, sample: np.ndarray, side: np.ndarray) -> None:
        """Treat the given sides of samples as covered until `reset_coverage`. 0 is left, 1 is right."""
        self.covered[sample, side] = True
        self._recheck.append(sample)

    def close_open_sides(self) -> None:
        """Treat all open sides as covered until `reset_coverage`."""
        self._recheck.append(np.unique(self._open_sides >> 1))
        self._open_sides = np.empty(0, dtype=np.int64)

    def reset_coverage(self) -> np.ndarray:
        """Mark both sides of samples as not covered if the samples have to be checked again.

        These are the samples whose neighbors were removed or whose sides were closed since the last call.

        Returns
        -------
        (k,) ndarray of int
            Indices of these samples. The caller has to mark their covered sides, and then to call
            `add_open_sides`.
        """
        sample = np.unique(np.concatenate([np.empty(0, dtype=np.int64), *self._recheck]))
        sample = sample[self.alive[sample]]
        self._recheck = []
        self.covered[sample] = False
        return sample
