"""The covering surface of a field: its states, and what a streamline has to know of each.

A state is a pixel and a *sheet* k, one of S half-directions: the angle t + 2 pi k / S, where t is
that of the representation, and S is N for even N, 2 N for odd. The states are the points of an
S-fold covering of the surface, on which the field is one vector field without breaking points: a
step from (p, k) to the pixel q leads to the sheet

    k' = k + round((t(p) - t(q)) S / 2 pi)  mod S,

a closed form for the best of all members. Sheets k and k + S / 2 are the two directions of one
streamline, so that M = S / 2 *lines* pass through a pixel, one a member image.

Directions that are no RoSy go from member to member as the RoSy does from which they deviate. If
they come without their opposites, forward and backward are two coverings of N sheets each, and
a streamline stays on its own: N sheets are *around* a pixel then, not S.

A streamline waits for memory, not for arithmetic. So a state's record is as short as can be, and
pixels are *cells* of a window of the frame, with a border: the next one is a sum away, and no
table of neighbours is read.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..field.directions import evaluate
from ..trigonometry import angle_of, cosine_sine
from .flow import OFFSETS, Flow, phase
from .look import Look

#: Pixels unfolded at once, so that they stay in a core's cache.
BLOCK = 1 << 14

#: The largest number of a record.
TOP = 32767

#: Bits of `Flow.joined` of a pixel that goes on to all neighbours.
OPEN = 0b111_111_111

#: The cell where streamlines end: a corner of the border.
END = 0


@dataclass(frozen=True, eq=False)
class Covering:
    """The states of a flow.

    State (c, k) is entry k C + c of `records`; line l of the cell c, of the sheets l and l + S / 2,
    is entry l C + c elsewhere.

    Attributes
    ----------
    sheets : int
        S.
    around : int
        How many of them make a full turn: S, or N.
    width : int
        Cells of a row of the window: one above another is so far away.
    place : (P,) int32 ndarray
        The cell of each pixel.
    turn : (C,) float32 ndarray
        t in parts of a full turn, `around` of them, plus 2. The last nine bits, too fine to matter, hold what can be
        got with `joined`: streamlines look both up at every step, so they lie together.
    records : (S C, 2 + 2 K) int16 ndarray
        A step on screen, and for each channel the noise and its slope to the left.
    units : (3,) tuple of float
        Of these three, in pixels and in tones.
    """

    sheets: int
    around: int
    width: int
    place: np.ndarray
    turn: np.ndarray
    records: np.ndarray
    units: tuple[float, float, float]

    @property
    def lines(self) -> int:
        """M."""
        return self.sheets // 2

    @property
    def cells(self) -> int:
        """C."""
        return len(self.turn)

    @property
    def channels(self) -> int:
        """K."""
        return self.records.shape[1] // 2 - 1

    def first_states(self, turns: int) -> tuple[np.ndarray, int]:
        """The first states of sheets, for streamlines that wind no more often than `turns`.

        Returns
        -------
        first : (n,) intp ndarray
            That of sheet k at k + turns around.
        back : int
            How far from there the sheet of the opposite direction is.
        """
        once = np.arange(self.around) * self.cells
        forward = np.tile(once, 2 * turns)
        if self.around == self.sheets:
            return forward, self.lines
        return np.concatenate([forward, forward + self.lines * self.cells]), len(forward)

    def line_of(self, state: np.ndarray) -> np.ndarray:
        """Entries of the lines of states, in their place."""
        half = self.lines * self.cells
        return np.subtract(state, half, out=state, where=state >= half)

    def beside(self, line: np.ndarray, along: int, left: int) -> np.ndarray:
        """Where some lines go on in a neighbour.

        Parameters
        ----------
        line : (n,) intp ndarray
            Entries of lines.
        along, left : int
            To which neighbour: that many pixels along the line, and to its left.

        Returns
        -------
        (n,) intp ndarray
            Entries of lines; of `END` where streamlines end.
        """
        sheet, cell = np.divmod(line, self.cells)
        step = self.records.take(line, axis=0)[:, :2].astype(np.float32)
        x, y = step[:, 0], step[:, 1]
        size = np.sqrt(x * x + y * y)
        size[size == 0] = 1
        column = np.rint((along * x - left * y) / size).astype(np.intp)
        row = np.rint((along * y + left * x) / size).astype(np.intp)
        turn = self.turn.take(cell)
        goes_on = joined(turn) >> (column + 3 * row + 4).astype(np.uint32) & 1
        there = np.where(goes_on, cell + row * self.width + column, END)
        slip = np.rint(turn - self.turn.take(there)).astype(np.intp)
        return (sheet + slip) % self.lines * self.cells + there


def sheets_around(flow: Flow) -> int:
    """How many sheets make a full turn: S, or N of directions without their opposites."""
    return flow.lines if flow.harmonics and not flow.is_paired else 2 * flow.lines


def line_of_member(flow: Flow) -> np.ndarray:
    """(M,) intp: which line is that of each member image.

    Of a RoSy of odd degree, sheet 2 i is member i, and sheet 2 i - N the other half of its line.
    """
    return np.arange(flow.lines) * (sheets_around(flow) // flow.degree) % flow.lines


def unfold(flow: Flow, look: Look, noise: np.ndarray) -> Covering:
    """The covering of a flow; its sheets are counted from the member nearest to the guide.

    Parameters
    ----------
    flow : Flow
        At least one pixel.
    look : Look
        Its `step`, `guiding_angle` and `foreshorten` count.
    noise : (P, K) float32 ndarray
    """
    degree, (count, channels) = flow.degree, noise.shape
    half, around = flow.lines, sheets_around(flow)
    place, width, cells = _window(flow)
    # Streamlines that have ended stay in `END`.
    turn = _with_bits(np.full(cells, 2, dtype=np.float32), 1 << 4)
    spread = np.zeros((cells, channels), dtype=np.float32)
    spread[place] = noise
    # A direction that is kept foreshortened may be longer than 1 under a wide lens.
    longest = 2.0 if look.foreshorten else 1.0
    brightest = max(float(np.abs(noise).max()), 1e-30)
    steepest = 2 * brightest * longest
    in_units = [np.float32(TOP / longest), np.float32(TOP / brightest), np.float32(TOP / steepest)]
    records = np.zeros((2 * half, cells, 2 + 2 * channels), dtype=np.int16)
    for start in range(0, count, BLOCK):
        part = slice(start, min(start + BLOCK, count))
        here = place[part]
        right, up = _slopes(spread, here, width, flow.joined[part])
        right, up = right * in_units[2], up * in_units[2]
        base, x, y = _nearest(flow.representation[part], degree, look.guiding_angle)
        base *= np.float32(around / (2 * np.pi))
        base += np.float32(2)
        turn[here] = _with_bits(base, flow.joined[part])
        rows = np.empty((len(here), 2 + 2 * channels), dtype=np.int16)
        rows[:, 2::2] = np.rint(noise[part] * in_units[1])
        for sheet in range(half):
            angle = look.guiding_angle + 2 * np.pi * sheet / around
            way = _deviating(flow, part, *_rotated(x, y, angle))
            way_x, way_y = _on_screen(flow, part, *way, look.foreshorten)
            if look.foreshorten:
                way_x, way_y = np.clip(way_x, -longest, longest), np.clip(way_y, -longest, longest)
            rows[:, 3::2] = np.rint(up * way_x[:, None] - right * way_y[:, None])
            way_x, way_y = way_x * in_units[0], way_y * in_units[0]
            rows[:, 0], rows[:, 1] = np.rint(way_x, out=way_x), np.rint(way_y, out=way_y)
            put(records[sheet], here, rows)
            # Of the opposite direction all but the noise is the opposite.
            for column in (0, 1, *range(3, rows.shape[1], 2)):
                np.negative(rows[:, column], out=rows[:, column])
            put(records[sheet + half], here, rows)
    return Covering(
        sheets=2 * half,
        around=around,
        width=width,
        place=place,
        turn=turn,
        records=records.reshape(-1, records.shape[2]),
        units=(look.step * longest / TOP, brightest / TOP, steepest / TOP),
    )


def joined(turn: np.ndarray) -> np.ndarray:
    """(n,) uint32: `Flow.joined` of the cells that have these turns."""
    return turn.view(np.uint32) & np.uint32(OPEN)


def _with_bits(turn: np.ndarray, bits: np.ndarray | int) -> np.ndarray:
    """Turns that hold what `joined` is to give."""
    return (turn.view(np.uint32) & ~np.uint32(OPEN) | bits).view(np.float32)


def put(table: np.ndarray, row: np.ndarray, rows: np.ndarray) -> None:
    """Write some rows of a table, each as one number."""
    whole_rows(table)[row] = whole_rows(rows)


def whole_rows(table: np.ndarray) -> np.ndarray:
    """(n, k) numbers seen as (n,), each row of 8 or 16 bytes as one number."""
    kind = np.complex64 if table.shape[1] * table.itemsize == 8 else np.complex128
    return table.view(kind)[:, 0]


def _window(flow: Flow) -> tuple[np.ndarray, int, int]:
    """The cell of each pixel, the width of the window, and its number of cells."""
    row, column = np.divmod(flow.pixel, np.int32(flow.width))
    low, left = row[0], column.min()
    width = int(column.max() - left) + 3
    place = (row - (low - 1)) * np.int32(width) + (column - (left - 1))
    return place, width, (int(row[-1] - low) + 3) * width


def _slopes(
    noise: np.ndarray, here: np.ndarray, width: int, joined: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Change of the (C, K) noise of cells to the right and up: (n, K), (n, K)."""
    slopes = []
    for away, offset in ((1, (1, 0)), (width, (0, 1))):
        slope = noise.take(here + away, axis=0) - noise.take(here - away, axis=0)
        slope *= np.float32(0.5)
        after = OFFSETS.index(offset)
        both = np.uint16(1 << after | 1 << (8 - after))
        slope[joined & both != both] = 0
        slopes.append(slope)
    return slopes[0], slopes[1]


def _nearest(z: np.ndarray, degree: int, guide: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The member nearest to a guiding angle, from there: its angle, cosine and sine; 0, 0 of 0."""
    x, y = _rotated(z.real, z.imag, -degree * guide)
    angle = angle_of(x, y)
    angle /= np.float32(degree)
    if degree == 1:
        size = np.sqrt(x * x + y * y)
        size[size == 0] = 1
        return angle, x / size, y / size
    cosine, sine = cosine_sine(angle)
    defined = z != 0
    return angle, cosine * defined, sine * defined


def _rotated(x: np.ndarray, y: np.ndarray, angle: float) -> tuple[np.ndarray, np.ndarray]:
    if angle == 0:
        return x, y
    cosine, sine = np.float32(np.cos(angle)), np.float32(np.sin(angle))
    return cosine * x - sine * y, sine * x + cosine * y


def _deviating(
    flow: Flow, part: slice, x: np.ndarray, y: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """As `Flow.direction`."""
    if not flow.harmonics:
        return x, y
    member = x + 1j * y
    way = phase(member * evaluate([(j, c[part]) for j, c in flow.harmonics], member))
    return way.real, way.imag


def _on_screen(
    flow: Flow, part: slice, x: np.ndarray, y: np.ndarray, foreshorten: bool
) -> tuple[np.ndarray, np.ndarray]:
    """As `Flow.on_screen`, in single precision."""
    if flow.axes is None:
        return x, y
    first, second = flow.axes[part, 0], flow.axes[part, 1]
    across = first.real * x + second.real * y
    up = first.imag * x + second.imag * y
    if not foreshorten:
        size = across * across
        size += up * up
        np.sqrt(size, out=size)
        size[size == 0] = 1
        np.divide(1, size, out=size)
        across *= size
        up *= size
    return across, up
