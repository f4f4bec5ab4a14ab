"""Tracing of streamlines on a covering surface, many at once, in both directions from their seeds.

A *lane* is one half of a streamline, forward or backward. A *state* is a pixel with one direction of the
field there, and *sheet* is the number of that direction (see `covering`).
"""

import numpy as np

from .covering import ALL_NEIGHBORS, SINK_CELL, Covering, unpack_neighbor_mask

#: Steps between compactions, which remove streamlines that have ended.
COMPACT_INTERVAL = 8

#: Minimum number of steps after which a streamline ends where it returns to an earlier state.
MIN_LOOP_STEPS = 256

#: Streamlines that are at the same state within so many steps may not have left it, so this is no loop.
MIN_RETURN_STEPS = 4

#: The plastic number, on which the R2 sequence (Roberts) is based: the analog of the golden ratio in 2D.
PLASTIC_NUMBER = 1.3247179572447460

#: Number of columns by which the pattern of offsets of seeds is shifted from one sheet to the next.
SHEET_SHIFT = 17

#: Largest offset from the center of a cell after a step across a seam, in pixels along each axis.
MAX_SEAM_OFFSET = np.float32(1.5)


class TracedLanes:
    """Halves of streamlines that are traced together, a step at a time.

    There are n forward halves (lanes), then n backward halves. A lane that ends moves to the cell `SINK_CELL`
    and stays there, until `compact` removes it from the arrays. The arrays hold the remaining m lanes.

    Parameters
    ----------
    covering : Covering
    seeds : (n,) intp ndarray
        The states at which the lines start: sheet times `Covering.cell_count`, plus cell.
    max_steps : int
        Steps in each direction.

    Attributes
    ----------
    count : int
        2 n, the number of all lanes.
    index : slice or (m,) intp ndarray
        Indices of the lanes that the arrays hold, out of all lanes.
    position : (m,) complex64 ndarray
        Offset from the center of the cell, in pixels.
    total : (m, K) complex64 ndarray
        Sum of the noise so far in K channels, to which the caller adds.
    """

    #: Names of the arrays with an element for each lane.
    _LANE_ARRAYS = (
        *("position", "total", "_counts", "_cell", "_sheet", "_packed_phase", "_target_phase"),
        "_previous_direction",
    )

    def __init__(self, covering: Covering, seeds: np.ndarray, max_steps: int) -> None:
        self._covering, self.count = covering, 2 * len(seeds)
        scalar_type = np.float64 if covering.noise_channels == 1 else np.complex128
        self._state_table = covering.state_table.view(scalar_type)[:, 0]
        # A streamline makes at most one full turn in four steps.
        max_winding = max_steps // 4 + 2
        self._sheet_offset, backward_offset = covering.sheet_offsets(max_winding)
        sheet, cell = np.divmod(seeds, covering.cell_count)
        first_sheet = max_winding * covering.sheets_per_turn
        self._cell = np.concatenate([cell, cell])
        self._sheet = np.concatenate([sheet, sheet + backward_offset]) + first_sheet
        self._packed_phase = covering.packed_phase.take(self._cell)
        #: Phase (angle) of the direction of each lane. In the next cell, lanes take the sheet nearest to it.
        self._target_phase = self._packed_phase + self._sheet.astype(np.float32)
        offset = _r2_offsets(covering, seeds)
        self.position = np.concatenate([offset, offset])
        self._previous_direction: np.ndarray | None = None
        self.total = np.zeros((self.count, covering.noise_channels), dtype=np.complex64)
        self.index: slice | np.ndarray = slice(self.count)
        self._counts = np.full(self.count, max_steps)
        self._all_counts = self._counts.copy()
        self._loops = _LoopFinder()

    @property
    def have_ended(self) -> bool:
        """Whether all lanes had ended at the last compaction."""
        return not len(self._cell)

    def step_counts(self) -> np.ndarray:
        """Return the (2 n,) number of steps that each lane made before it ended."""
        self._all_counts[self.index] = self._counts
        return self._all_counts

    def look_up(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return the (m,) states of the lanes, their (m,) directions, and the (m, K) noise there.

        States are indices. Directions and noise are complex64, in the integers of `Covering.state_table`. The
        imaginary part of the noise is its derivative to the left.
        """
        state = self._sheet_offset.take(self._sheet, mode="clip")
        state += self._cell
        record = self._state_table.take(state, mode="clip").view(np.int16).astype(np.float32)
        record = record.view(np.complex64).reshape(len(self._cell), -1)
        return state, record[:, 0].copy(), record[:, 1:]

    def advance(
        self, step: int, state: np.ndarray, direction: np.ndarray, step_scale: np.float32
    ) -> None:
        """Step along the directions to the next cells. Lanes end at the border, and where they close a loop.

        Parameters
        ----------
        step : int
            Number of this step.
        state, direction : (m,) ndarray
            Results of `look_up`. `direction` is overwritten.
        step_scale : float32
            Factor from the unit of `direction` (integers of `Covering.state_table`) to pixels, times 3/2: the
            first coefficient of the Adams-Bashforth method.
        """
        displacement = self._move(direction, step_scale)
        column, row = displacement.view(np.float32).reshape(-1, 2).T
        mask = unpack_neighbor_mask(self._packed_phase)
        ended, crossing, seam = self._step_cells(mask, column, row)
        self._counts[ended] = step
        looping = self._loops.find(step, state, self._cell)
        self._counts[looping] = step
        self._cell[looping] = SINK_CELL
        if len(crossing):
            self._cross_seams(crossing, seam)
        self._choose_sheets()

    def _move(self, direction: np.ndarray, step_scale: np.float32) -> np.ndarray:
        """Move positions by a step. Return the (m,) complex64 whole pixels from the old to the new cell.

        `direction` is from `look_up`; `step_scale` is the factor from its unit to pixels, times 3/2. The
        method is two-step Adams-Bashforth, 3/2 d - 1/2 d_previous.
        """
        previous = self._previous_direction
        displacement = direction.copy() if previous is None else previous
        axes = displacement.view(np.float32)
        axes *= np.float32(-1 / 3)
        displacement += direction
        axes *= step_scale
        self.position += displacement
        self._previous_direction = direction
        # Lanes step at most to a neighbor, even where the direction turns sharply.
        np.rint(self.position.view(np.float32), out=axes)
        np.maximum(axes, np.float32(-1), out=axes)
        np.minimum(axes, np.float32(1), out=axes)
        self.position -= displacement
        return displacement

    def _step_cells(
        self, mask: np.ndarray, column: np.ndarray, row: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Move each lane to a neighbor cell, or to `SINK_CELL` where it may not step to the neighbor.

        Parameters
        ----------
        mask : (m,) uint32 ndarray
            Which neighbors of its cell each lane may step to, as bits.
        column, row : (m,) ndarray
            The step: -1, 0 or 1 columns and rows.

        Returns
        -------
        ended : (e,) intp ndarray
            Indices of the lanes that end.
        crossing, seam : (s,) intp ndarray
            Indices of the lanes that cross a seam, and the indices of their steps in `SeamSteps`.
        """
        covering, cell = self._covering, self._cell
        crossing = seam = np.empty(0, dtype=np.intp)
        blocked = np.flatnonzero(mask != ALL_NEIGHBORS)
        bit = (column[blocked] + 3 * row[blocked] + 4).astype(np.uint32)
        is_blocked = mask[blocked] >> bit & 1 == 0
        blocked, bit = blocked[is_blocked], bit[is_blocked]
        is_tracing = cell[blocked] != SINK_CELL
        ended, seams = blocked[is_tracing], covering.seams
        if seams is not None and len(ended):
            is_crossing, seam = seams.find(cell[ended], bit[is_tracing])
            crossing, ended = ended[is_crossing], ended[~is_crossing]
        cell_offset = row * np.float32(covering.width)
        cell_offset += column
        cell += cell_offset.astype(np.intp)
        cell[blocked] = SINK_CELL
        if len(crossing):
            cell[crossing] = seams.target_cell.take(seam)
        return ended, crossing, seam

    def _cross_seams(self, crossing: np.ndarray, seam: np.ndarray) -> None:
        """Continue the lanes `crossing` beyond the seam: adapt their position and direction.

        `crossing` are (s,) indices of lanes. `seam[i]` is the index in `SeamSteps` of the step of
        `crossing[i]`.
        """
        seams, steps = self._covering.seams, self._covering.seams.steps
        reached = steps.displaced(seam, self.position[crossing]) + steps.offset.take(seam)
        axes = reached.view(np.float32)
        np.clip(axes, -MAX_SEAM_OFFSET, MAX_SEAM_OFFSET, out=axes)
        self.position[crossing] = reached
        direction = self._previous_direction
        direction[crossing] = steps.displaced(seam, direction[crossing])
        self._target_phase[crossing] += seams.sheet_shift.take(seam)

    def _choose_sheets(self) -> None:
        """Choose in each new cell the sheet (direction of the field) nearest to the previous direction."""
        self._packed_phase = self._covering.packed_phase.take(self._cell, mode="clip")
        self._target_phase -= self._packed_phase
        np.rint(self._target_phase, out=self._target_phase)
        self._sheet = self._target_phase.astype(np.intp)
        self._target_phase += self._packed_phase

    def compact(self) -> None:
        """Remove the lanes that have ended from the arrays, if more than a tenth of the lanes have ended."""
        remaining = np.flatnonzero(self._cell)
        if len(remaining) >= 0.9 * len(self._cell):
            return
        self._all_counts[self.index] = self._counts
        self.index = remaining if isinstance(self.index, slice) else self.index[remaining]
        for name in self._LANE_ARRAYS:
            setattr(self, name, getattr(self, name)[remaining])
        self._loops.keep(remaining)


class _LoopFinder:
    """A detector of streamlines that run in a loop: they return to an earlier state.

    A loop is found about one turn after the streamline has closed it. Each new state is compared with one
    earlier state of the streamline. The earlier state is replaced by the current one whenever the number of
    steps has doubled (Brent, An improved Monte Carlo factorization algorithm, 1980).
    """

    def __init__(self) -> None:
        self._past_step, self._past_state = MIN_LOOP_STEPS, np.empty(0, dtype=np.intp)

    def find(self, step: int, state: np.ndarray, next_cell: np.ndarray) -> np.ndarray:
        """Return the indices of the streamlines that have returned to an earlier state.

        `step` is the number of the step, `state` and `next_cell` are the (m,) indices of the state of each
        streamline and of its next cell. Streamlines whose `next_cell` is `SINK_CELL` have ended already, and
        are left out.
        """
        if step in (MIN_LOOP_STEPS, 2 * self._past_step):
            self._past_step, self._past_state = step, state
        elif step >= self._past_step + MIN_RETURN_STEPS:
            return np.flatnonzero((state == self._past_state) & (next_cell != SINK_CELL))
        return np.empty(0, dtype=np.intp)

    def keep(self, remaining: np.ndarray) -> None:
        """Keep only the streamlines with the indices `remaining`. The others have ended."""
        if len(self._past_state):
            self._past_state = self._past_state[remaining]


def lateral_offset(position: np.ndarray, direction: np.ndarray) -> np.ndarray:
    """Return how far positions are to the left of the centers of cells, as seen along `direction`.

    `position` is the offset from the center of the cell, in pixels. The result is (n,) float32, in pixels
    times the length of `direction`.
    """
    lateral = position.imag * direction.real
    lateral -= position.real * direction.imag
    return lateral


def axial_steps(position: np.ndarray, direction: np.ndarray, step_scale: np.float32) -> np.ndarray:
    """Return the (n,) float32 steps from positions to the centers of cells, measured along streamlines.

    `position` is relative to the center of the cell, in pixels. `direction` is in the unit of
    `TracedLanes.look_up`, and `step_scale` is the factor from that unit to pixels.
    """
    square = direction.real * direction.real + direction.imag * direction.imag
    along = position.real * direction.real + position.imag * direction.imag
    return along / np.minimum(-step_scale * square, np.float32(-1))


def _r2_offsets(covering: Covering, seeds: np.ndarray) -> np.ndarray:
    """Return (n,) complex64 offsets from the centers of pixels, spread evenly (R2 sequence, Roberts).

    `seeds` are (n,) indices of lines. Offsets are in pixels, -0.5 to 0.5. If all streamlines started at the
    centers, they would step to the next row of pixels at the same time, which is visible. Along rows and
    columns, the offsets are a sequence of low discrepancy. An offset depends on the cell and the sheet of its
    seed alone, so streamlines stay where they are if the field changes a little.
    """
    sheet, cell = np.divmod(seeds, covering.cell_count)
    row, column = np.divmod(cell, covering.width)
    row, column = row + 0.5, column + 0.5 + SHEET_SHIFT * sheet
    near, far = 1 / PLASTIC_NUMBER, 1 / PLASTIC_NUMBER**2
    position = (near * column + far * row) % 1 + 1j * ((far * column + near * row) % 1)
    return (position - (0.5 + 0.5j)).astype(np.complex64)
