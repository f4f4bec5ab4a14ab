"""Origins: for every state of the covering surface, the point a number of steps upstream on its streamline.

A state is a pixel with one direction (sheet) of the field; see `covering`. Origins of one step are found by
the midpoint method. Origins of twice as many steps are composed of them: the origin of the origin is
interpolated between the origins of neighboring states, as in hierarchical line integration (Hlawatsch,
Sadlo and Weiskopf, IEEE TVCG 2011).
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from ..core.progress import report
from ..projection.pixel_blocks import pixel_blocks
from .covering import SINK_CELL, Covering, unpack_neighbor_mask
from .pixel_field import NEIGHBOR_OFFSETS

#: Largest distance in pixels, along each axis, between the origins of neighboring pixels. If they are further
#: apart, their streamlines have parted, and origins are not interpolated.
MAX_PARTING = np.float32(2.5)

#: Label of all steps.
STEP_LABEL = "tracing streamlines"


class Origins(NamedTuple):
    """The points that (n,) states are reached from: cells, sheets, and offsets from the centers of cells.

    Cells are int32 indices, sheets are int8 numbers (of `Sheets`). Offsets are complex64, in pixels. The cell
    is `SINK_CELL` where the streamline has ended.
    """

    cell: np.ndarray
    sheet: np.ndarray
    offset: np.ndarray

    @classmethod
    def ended(cls, count: int) -> Origins:
        """Return `count` origins of states whose streamlines have ended."""
        cell = np.full(count, SINK_CELL, dtype=np.int32)
        return cls(cell, np.zeros(count, dtype=np.int8), np.zeros(count, dtype=np.complex64))

    def at(self, state: np.ndarray) -> Origins:
        """Return the origins of the states (pixels with a direction) that have the given indices."""
        return Origins(*(values.take(state) for values in self))

    def put(self, state: np.ndarray, origins: Origins) -> None:
        """Set the origins of the states (pixels with a direction) that have the given indices.

        The origin of the state ``state[i]`` becomes element i of `origins`.
        """
        for values, new in zip(self, origins, strict=True):
            values[state] = new


class _Surroundings(NamedTuple):
    """The four pixels around (n,) points, for bilinear interpolation.

    They are the pixel that contains the point, the nearest other pixel in its row, the nearest other pixel in
    its column, and the fourth pixel of that square.

    Attributes
    ----------
    states : list of (n,) intp ndarray
        For each of the four pixels: its states, on the sheets (directions of the field) that match the sheet
        of the point. Where streamlines cannot step to a pixel, the state of the first pixel is used.
    unlinked : list of (m,) intp ndarray
        For each of the other three pixels: the indices of points whose streamlines cannot step there.
    column, row : (n,) intp ndarray
        Steps from the first pixel to the other column and row, 1 or -1.
    weights : list of (n,) float32 ndarray
        Weights of the four pixels for bilinear interpolation.
    """

    states: list[np.ndarray]
    unlinked: list[np.ndarray]
    column: np.ndarray
    row: np.ndarray
    weights: list[np.ndarray]

    def interpolate(self, values: np.ndarray) -> np.ndarray:
        """Return the (n,) interpolated values at the points, given a value for each state of `Sheets`."""
        total = values.take(self.states[0])
        total *= self.weights[0]
        for state, weight in zip(self.states[1:], self.weights[1:], strict=True):
            total += values.take(state) * weight
        return total


class Sheets:
    """The sheets (directions of the field) along which origins are found, and the steps between their states.

    If a field has no opposites, only its directions or only their opposites are needed. The needed sheets are
    numbered from 0. The state of cell c and sheet k has the index k C + c.

    Parameters
    ----------
    covering : Covering
        The covering surface. It has no seams.
    is_upstream : bool
        Whether noise is carried along the directions of a field without opposites, so origins are upstream;
        otherwise they are downstream. Without effect for other fields.

    Attributes
    ----------
    cells : (P,) int32 ndarray
        The cell of each pixel: its number in the bounding rectangle of the pixels, row by row.
    cell_count, count : int
        C, the number of cells, and the number of sheets that are needed.
    covering_sheet : list of int
        For each of these sheets, its number in `covering`.
    """

    def __init__(self, covering: Covering, is_upstream: bool) -> None:
        self._covering = covering
        self.cells, self._width = covering.cell_of_pixel, covering.width
        self.cell_count = covering.cell_count
        lines, turn = covering.line_count, covering.sheets_per_turn
        self.count = lines if covering.has_directions else 2 * lines
        # In a RoSy of odd degree, every other sheet is a direction of the field, and the rest are opposites.
        spacing = turn // self.count
        sheet = np.arange(self.count) * spacing
        if is_upstream and covering.has_directions:
            sheet = (sheet + lines) % (2 * lines)
        self.covering_sheet = sheet.tolist()
        self._shift = self._sheet_shifts(spacing)
        # Index of the first state of each sheet, twice, for sheet numbers beyond the last.
        self._first_states = np.tile(np.arange(self.count) * self.cell_count, 2)

    def blocks(self, sheets: int = 0) -> Iterator[tuple[int, slice, np.ndarray]]:
        """Yield blocks of pixels on each sheet, and report the progress.

        If `sheets` is not 0, only the first `sheets` sheets are yielded.

        Yields
        ------
        sheet : int
            Number of the sheet, from 0.
        block : slice
            Pixels of the block.
        state : (n,) intp ndarray
            Indices of the states of these pixels on the sheet.
        """
        sheets, count = sheets or self.count, len(self.cells)
        for sheet in range(sheets):
            for block in pixel_blocks(count):
                report((sheet + block.start / count) / sheets, STEP_LABEL)
                yield sheet, block, sheet * self.cell_count + self.cells[block].astype(np.intp)

    def one_step(self) -> Origins:
        """Find the origin of each state one step upstream, by the midpoint method."""
        scale = np.float32(self._covering.state_scales[0])
        x, y = self._covering.state_table[:, :2].reshape(-1, self.cell_count, 2).transpose(2, 0, 1)
        step = np.zeros((self.count, self.cell_count), dtype=np.complex64)
        for rows, sheet in zip(step, self.covering_sheet, strict=True):
            rows.real, rows.imag = x[sheet], y[sheet]
            rows *= scale
        step = step.reshape(-1)
        result = Origins.ended(len(step))
        for sheet, block, state in self.blocks():
            cell = self.cells[block]
            sheets = np.full(len(cell), sheet, dtype=np.int8)
            own = step.take(state)
            around = self.surroundings(Origins(cell, sheets, np.float32(0.5) * own))
            result.put(state, self._moved(Origins(cell, sheets, around.interpolate(step))))
        return result

    def interpolated(self, origins: Origins, around: _Surroundings) -> Origins:
        """Return the origins of (n,) points, interpolated between the origins of the four states around each.

        `origins` has the origins of all states, `around` the four pixels around each of the points.
        """
        target = origins.at(around.states[0])
        change = np.zeros_like(target.offset)
        width, inverse_width = np.float32(self._width), np.float32(1 / self._width)
        directions = (around.column, 0), (0, around.row), (around.column, around.row)
        for corner, unlinked, weight, (column, row) in zip(
            around.states[1:], around.unlinked, around.weights[1:], directions, strict=True
        ):
            cells = origins.cell.take(corner)
            distance = origins.offset.take(corner)
            distance -= target.offset
            between = (cells - target.cell).astype(np.float32)
            rows = np.rint(between * inverse_width)
            between -= rows * width
            distance.real += between
            distance.imag += rows
            # Where streamlines have parted, the offset between the two pixels replaces the offset between
            # their origins.
            apart = np.abs(distance.view(np.float32))
            parted = np.maximum(apart[::2], apart[1::2]) > MAX_PARTING
            parted |= cells == SINK_CELL
            parted[unlinked] = True
            parted = np.flatnonzero(parted)
            for part, step in ((distance.real, column), (distance.imag, row)):
                part[parted] = step if np.ndim(step) == 0 else step[parted]
            distance *= weight
            change += distance
        change += target.offset
        return self._moved(Origins(target.cell, target.sheet, change))

    def surroundings(self, origins: Origins) -> _Surroundings:
        """Return the four pixels around the points `origins`, for interpolation."""
        cell, sheet = origins.cell.astype(np.intp), origins.sheet.astype(np.intp)
        x, y = origins.offset.real.copy(), origins.offset.imag.copy()
        column, row = np.where(x < 0, -1, 1), np.where(y < 0, -1, 1)
        own = self._first_states.take(sheet)
        own += cell
        states, unlinked = [own], []
        for columns, rows in ((column, 0), (0, row), (column, row)):
            neighbor = columns + 3 * rows + 4
            neighbor *= self.cell_count
            neighbor += cell
            shift = self._shift.take(neighbor)
            points = np.flatnonzero(shift < 0)
            state = self._first_states.take(sheet + shift, mode="clip")
            state += cell
            state += columns + rows * self._width
            state[points] = own[points]
            states.append(state)
            unlinked.append(points)
        np.abs(x, out=x)
        np.abs(y, out=y)
        both = x * y
        weights = [1 - x - y + both, x - both, y - both, both]
        return _Surroundings(states, unlinked, column, row, weights)

    def linked_neighbors(self, cell: np.ndarray) -> list[tuple[np.ndarray, np.ndarray]]:
        """Return the steps that streamlines can make from (n,) cells to each of the four nearest neighbors.

        The result is a pair of arrays for each neighbor: the cells where such steps start, and, row by row,
        the cells where they arrive.
        """
        steps = []
        for bit, (column, row) in enumerate(NEIGHBOR_OFFSETS):
            if abs(column) + abs(row) == 1:
                linked = cell[self._shift.take(bit * self.cell_count + cell) >= 0]
                steps.append((linked, linked + (row * self._width + column)))
        return steps

    def _sheet_shifts(self, spacing: int) -> np.ndarray:
        """Tabulate by how much the number of the sheet increases in a step to each neighbor.

        Parameters
        ----------
        spacing : int
            Difference between the numbers that two successive needed sheets have in the covering: 2 if every
            other sheet is not needed (the opposites of an odd degree), otherwise 1.

        Returns
        -------
        (9 C,) int8 ndarray
            Increase modulo `count`, from 0 to `count` - 1; -1 where streamlines cannot step. Element b C + c
            is for the step from cell c to its neighbor at `NEIGHBOR_OFFSETS[b]`.
        """
        phase = self._covering.packed_phase
        table = np.full((9, self.cell_count), -1, dtype=np.int8)
        for _, block, state in self.blocks(1):
            cell, own = self.cells[block], phase.take(state)
            mask = unpack_neighbor_mask(own)
            for bit, (column, row) in enumerate(NEIGHBOR_OFFSETS):
                turned = own - phase.take(state + (row * self._width + column))
                shift = np.rint(turned / spacing).astype(np.int32) % self.count
                table[bit, cell] = np.where(mask >> np.uint32(bit) & 1, shift, -1)
        return table.reshape(-1)

    def _moved(self, origins: Origins) -> Origins:
        """Return the same points, each relative to the pixel that it has moved into.

        If the field has no step into that pixel, the point becomes `SINK_CELL`, which ends its streamline.
        """
        cell, sheet, offset = origins
        column = np.clip(np.rint(offset.real), -1, 1)
        row = np.clip(np.rint(offset.imag), -1, 1)
        bit = (column + 3 * row + 4).astype(np.intp)
        shift = self._shift.take(bit * self.cell_count + cell)
        target = cell + (row * self._width + column).astype(np.int32)
        matched = sheet.astype(np.int16) + shift
        matched -= np.int16(self.count) * (matched >= self.count)
        rest = offset - (column + np.complex64(1j) * row)
        blocked = np.flatnonzero(shift < 0)
        target[blocked], matched[blocked], rest[blocked] = SINK_CELL, 0, 0
        return Origins(target, matched.astype(np.int8), rest)
