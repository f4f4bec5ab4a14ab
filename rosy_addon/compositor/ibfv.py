"""Image based flow visualization on the covering surface: noise that is carried along and blended.

Van Wijk (Image based flow visualization, SIGGRAPH 2002) carries the picture a step along a vector field,
blends it with a little noise, and repeats this frame by frame. The picture is then an average of the noise
upstream, whose weights q^m fall exponentially with the number m of steps. On the covering (see `covering`)
an N-RoSy is a vector field as well: each state takes what arrives at it along its own sheet.

After many frames, the picture is the sum over m of q^m A^m n, where n is the noise, and A carries a picture
one step. Repeating the blend would interpolate between pixels at every step, which blurs streaks. So the
sum is doubled instead:

    F_2D = F_D + q^D A^D F_D,    A^2D = A^D A^D.

A^D is known by where the streamline of each state comes from, D steps upstream. These points vary slowly
and are composed by interpolation, as in hierarchical line integration (Hlawatsch, Sadlo and Weiskopf, IEEE
TVCG 2011). Some doublings replace more than a hundred blends, and values are interpolated once in each.

Noise that varies in time makes the streaks drift. It is interpolated between the three channels of the
flow, by a constant and a cosine and sine of the phase: n_c at the phase -c / 3. The squares of the weights
(1 + 2 cos) / 3 have the sum 1, so the contrast is constant. There is one frequency, and A does not depend on
the time. So the picture of any frame is a blend of three images, which serve all frames: averages of the
constant, the cosine and the sine part of the noise. Frames need no earlier ones, and loops close.

Streaks of a field of odd degree are one-sided, along its directions. A line without direction is a pair of
opposite sheets. Its streaks are those of both.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ..core.progress import progress, report
from ..projection.pixel_blocks import pixel_blocks
from .contrast import normalize_variance
from .covering import SINK_CELL, Covering, build_covering, member_lines, unpack_neighbor_mask
from .filter_kernel import full_sample_count, kernel_weights
from .flow import FLOW_CHANNELS
from .image_noise import NOISE_MEAN
from .lic_images import LicImages, lic_images, magnitude_step_limits
from .look import has_flow
from .look_units import PixelLook
from .pixel_field import NEIGHBOR_OFFSETS, PixelField
from .reported_blocks import reported_blocks

#: The doublings end when the weights of further steps are below this. Averages are divided by the weights
#: that they have.
MIN_WEIGHT = 0.01

#: How much the noise of a pixel is raised above that of each of its four neighbors, for each doubling. This
#: restores what interpolation blurs, on average: streaks along the rows of pixels are not blurred, others are.
SHARPENING = 0.02

#: Factor of the contrast, which gives streaks the standard deviation of those of other methods: of streaks
#: on one side of a pixel, which are carried further, and of those on both sides.
ONE_SIDED_MATCH, TWO_SIDED_MATCH = np.float32(1.06), np.float32(1.02)

#: Largest distance in pixels, along each axis, of the points that neighbors come from. Streamlines that are
#: further apart have parted.
MAX_PARTING = np.float32(2.5)

#: Weight of the noise at the pixel itself, relative to that of the first step. It is part of both sheets of
#: a line.
OWN_WEIGHT = 0.5

#: Label of all steps.
STEP_LABEL = "tracing streamlines"


@dataclass(frozen=True, eq=False)
class StreakWaves:
    """The average noise of each line, for all phases of the flow.

    Attributes
    ----------
    constant : (M, P, K) float32 ndarray
        Averages around 0, scaled to the variance of full streamlines.
    wave : (M, P) complex64 ndarray or None
        The real part of its product with exp(2 pi i phase) is added. None without flow.
    effective_samples : (P,) float32 ndarray
        As in `LicImages`.
    """

    constant: np.ndarray
    wave: np.ndarray | None
    effective_samples: np.ndarray

    def images(self, phase: float) -> LicImages:
        """Return the LIC images at a phase of the flow."""
        members = np.empty_like(self.constant)
        turn = np.exp(2j * np.pi * phase)
        real, imaginary = np.float32(turn.real), np.float32(turn.imag)
        count = members.shape[1]
        for line, member in enumerate(members):
            for block in reported_blocks(count, "blending lines", 0.0, 0.5):
                np.add(self.constant[line, block], np.float32(NOISE_MEAN), out=member[block])
                if self.wave is not None:
                    wave = self.wave[line, block]
                    member[block, 0] += wave.real * real - wave.imag * imaginary
        with progress(0.5, 1.0):
            return lic_images(members, self.effective_samples)


def wave_images(waves: Sequence[StreakWaves], looks: Sequence[PixelLook]) -> list[LicImages]:
    """Return the LIC images of looks at their phases."""
    return [wave.images(look.flow_phase) for wave, look in zip(waves, looks, strict=True)]


def streak_waves(
    field: PixelField, looks: Sequence[PixelLook], noise: np.ndarray
) -> list[StreakWaves]:
    """Average the noise upstream of every state, for looks that differ in the length of streamlines.

    Parameters
    ----------
    field : PixelField
    looks : sequence of PixelLook
        In pixels of the frame. The first is the longest.
    noise : (P, K) float32 ndarray
        The three channels of `flow`, if the looks have flow.

    Returns
    -------
    list of StreakWaves
        Of each look.
    """
    look = looks[0]
    # Of the noise, the covering only needs the number of channels.
    with progress(0.0, 0.05):
        covering = build_covering(field, look, np.zeros((len(field.pixel), 1), np.float32))
    with progress(0.05, 0.1):
        sheets = _Sheets(covering, is_upstream=look.kernel != "ramp")
    with progress(0.1):
        decays = [_decay(field, each) for each in looks]
        doublings = max(_doubling_count(float(np.max(decay))) for decay in decays)
        full_decays = [float(_full_decay(field, each)) for each in looks]
        sharpening = np.float32(SHARPENING * _doubling_count(max(full_decays)))
        sources = sheets.sources(noise, look, sharpening)
        sums = [_Sums(sheets, sources, decay, _step_turn(look)) for decay in decays]
    with progress(0.1, 0.2):
        origins = sheets.one_step()
    for doubling in range(doublings):
        start, stop = (0.2 + 0.7 * place / doublings for place in (doubling, doubling + 1))
        with progress(start, stop):
            origins = sheets.doubled(sums, 1 << doubling, origins, doubling == doublings - 1)
    with progress(0.9, 1.0):
        return [
            _line_waves(field, covering, each, total)
            for each, total in zip(looks, sums, strict=True)
        ]


def _noise_sources(noise: np.ndarray, look: PixelLook) -> list[np.ndarray]:
    """What is summed along streamlines, as complex numbers.

    Parameters
    ----------
    noise : (P, K) float32 ndarray
        Around 0.

    Returns
    -------
    list of (P,) complex64 ndarray
        The first has the noise, and 1 as its imaginary part, whose sum is that of the weights. The second
        has the other two channels of colored noise, or the wave of `StreakWaves`.
    """
    if has_flow(look):
        third = np.exp(2j * np.pi * np.arange(FLOW_CHANNELS) / FLOW_CHANNELS)
        weights = np.stack([np.full(FLOW_CHANNELS, 0.5), third.real, third.imag]) * (2 / 3)
        constant, real, imaginary = (
            sum(weight * channel for weight, channel in zip(row, noise.T, strict=True))
            for row in weights.astype(np.float32)
        )
        return [constant + np.complex64(1j), real + np.complex64(1j) * imaginary]
    sources = [noise[:, 0] + np.complex64(1j)]
    if noise.shape[1] == 3:
        sources.append(noise[:, 1] + np.complex64(1j) * noise[:, 2])
    return sources


def _step_turn(look: PixelLook) -> float:
    """The angle by which the phase of the noise differs from that of the noise a step nearer."""
    if not has_flow(look):
        return 0.0
    angle = 2 * np.pi / look.flow_distance
    # What comes from upstream left there earlier. What is downstream will be there later.
    return angle if look.kernel == "ramp" else -angle


def _is_two_sided(field: PixelField, look: PixelLook) -> bool:
    """Whether streaks are averages over both directions of a line, with equal weights."""
    return field.symmetry.has_opposites and not has_flow(look)


def _doubling_count(decay: float) -> int:
    """How many doublings a sum needs whose weights have the ratio `decay`."""
    steps = math.log(MIN_WEIGHT) / math.log(decay) if decay > 0 else 0
    return math.ceil(math.log2(max(steps, 1)))


def _full_decay(field: PixelField, look: PixelLook) -> np.float32:
    """The ratio q of the weights of successive steps of full streamlines."""
    samples = np.float64(full_sample_count(look.length, look.kernel))
    return np.float32(decay_of_samples(samples, _is_two_sided(field, look)))


def _decay(field: PixelField, look: PixelLook) -> np.ndarray:
    """(P,) or () float32 ratios q of the weights of successive steps."""
    limits = magnitude_step_limits(field, look)
    if limits is None:
        return _full_decay(field, look)
    length = np.arange(look.length + 1, dtype=np.float64)
    samples = kernel_weights(length, length, length, look.kernel).effective_samples
    return decay_of_samples(samples, _is_two_sided(field, look)).astype(np.float32)[limits]


def decay_of_samples(effective_samples: np.ndarray, two_sided: bool) -> np.ndarray:
    """Return the decay of the kernel with given effective samples, by bisection.

    Parameters
    ----------
    effective_samples : float64 ndarray
        At least 1.
    two_sided : bool
        Whether the kernel is that of both directions of a line.

    Returns
    -------
    float64 ndarray
        q, the ratio of the weights of successive steps.
    """
    low, high = np.zeros_like(effective_samples), np.ones_like(effective_samples)
    for _ in range(40):
        middle = (low + high) / 2
        total = OWN_WEIGHT + middle / (1 - middle)
        squares = _square_sum(0.0, middle)
        if two_sided:
            squares = (squares + OWN_WEIGHT**2) / 2
        is_low = total**2 < effective_samples * squares
        low, high = np.where(is_low, middle, low), np.where(is_low, high, middle)
    return low


def _square_sum(rest: np.ndarray | float, decay: np.ndarray) -> np.ndarray:
    """The sum of the squares of the weights of a sheet up to the step whose weight is `rest`."""
    return OWN_WEIGHT**2 + decay**2 * (1 - np.square(rest)) / (1 - decay**2)


class _Origins(NamedTuple):
    """The points that (n,) states are reached from: cells, sheets, and offsets from the centers of cells.

    The cell is `SINK_CELL` where the streamline has ended.
    """

    cell: np.ndarray
    sheet: np.ndarray
    offset: np.ndarray

    @classmethod
    def ended(cls, count: int) -> _Origins:
        """Return origins of states whose streamlines have ended."""
        return cls(
            np.full(count, SINK_CELL, dtype=np.int32),
            np.zeros(count, dtype=np.int8),
            np.zeros(count, dtype=np.complex64),
        )

    def at(self, state: np.ndarray) -> _Origins:
        """Return those of some states."""
        return _Origins(*(values.take(state) for values in self))

    def put(self, state: np.ndarray, origins: _Origins) -> None:
        """Replace those of some states."""
        for values, new in zip(self, origins, strict=True):
            values[state] = new


class _Surroundings(NamedTuple):
    """The four pixels around (n,) points: that of the point, the next ones in x and y, and that in both.

    Attributes
    ----------
    states : list of (n,) intp ndarray
        Of these pixels, each with its own sheet. Where streamlines cannot step to a pixel, it is that of
        the point.
    unlinked : list of (m,) intp ndarray
        The points whose streamlines cannot.
    column, row : (n,) intp ndarray
        The steps to the next pixels, 1 or -1.
    weights : list of (n,) float32 ndarray
        Of bilinear interpolation.
    """

    states: list[np.ndarray]
    unlinked: list[np.ndarray]
    column: np.ndarray
    row: np.ndarray
    weights: list[np.ndarray]

    def interpolate(self, values: np.ndarray) -> np.ndarray:
        """Return (n,) values at the points, given those of all states."""
        total = values.take(self.states[0])
        total *= self.weights[0]
        for state, weight in zip(self.states[1:], self.weights[1:], strict=True):
            total += values.take(state) * weight
        return total


class _Sheets:
    """The sheets that streamlines come from, and the steps between their states.

    Of fields without opposites, only the directions or their opposites are needed. They are numbered from
    0, and state (c, k) has the index k C + c.

    Parameters
    ----------
    covering : Covering
    is_upstream : bool
        Whether streamlines come from where lines point away from.
    """

    def __init__(self, covering: Covering, is_upstream: bool) -> None:
        self._covering = covering
        self.cells, self._width = covering.cell_of_pixel, covering.width
        self.cell_count = covering.cell_count
        lines, turn = covering.line_count, covering.sheets_per_turn
        self.count = lines if covering.has_directions else 2 * lines
        # Every other sheet of a RoSy of odd degree is a direction.
        self._spacing = turn // self.count
        sheet = np.arange(self.count) * self._spacing
        if is_upstream and covering.has_directions:
            sheet = (sheet + lines) % (2 * lines)
        self._covering_sheet = sheet
        self._shift = self._sheet_shifts()
        # The first state of each sheet, which are counted on after the last.
        self._first_states = np.tile(np.arange(self.count) * self.cell_count, 2)

    def number(self, covering_sheet: int) -> int:
        """Return the number of the sheet along, or against, a sheet of the covering."""
        (numbers,) = np.nonzero(self._covering_sheet == covering_sheet)
        return int(numbers[0])

    def _sheet_shifts(self) -> np.ndarray:
        """Tabulate what steps to neighbors add to the number of the sheet, from 0.

        Returns
        -------
        (9 C,) int8 ndarray
            -1 where streamlines cannot step.
        """
        phase = self._covering.packed_phase
        table = np.full((9, self.cell_count), -1, dtype=np.int8)
        for _, block, state in self.blocks(1):
            cell, own = self.cells[block], phase.take(state)
            mask = unpack_neighbor_mask(own)
            for bit, (column, row) in enumerate(NEIGHBOR_OFFSETS):
                turned = own - phase.take(state + (row * self._width + column))
                shift = np.rint(turned / self._spacing).astype(np.int32) % self.count
                table[bit, cell] = np.where(mask >> np.uint32(bit) & 1, shift, -1)
        return table.reshape(-1)

    def sources(
        self, noise: np.ndarray, look: PixelLook, sharpening: np.float32
    ) -> list[np.ndarray]:
        """Return the (C,) `_noise_sources` of cells, 0 outside, from (P, K) noise; see `SHARPENING`."""
        plain: list[np.ndarray] = []
        for _, block, cell in self.blocks(1):
            parts = _noise_sources(noise[block] - np.float32(NOISE_MEAN), look)
            plain = plain or [np.zeros(self.cell_count, dtype=np.complex64) for _ in parts]
            for source, part in zip(plain, parts, strict=True):
                source[cell] = part
        sharp = [source.copy() for source in plain]
        for _, _, cell in self.blocks(1):
            for bit, (column, row) in enumerate(NEIGHBOR_OFFSETS):
                if abs(column) + abs(row) == 1:
                    linked = cell[self._shift.take(bit * self.cell_count + cell) >= 0]
                    neighbor = linked + (row * self._width + column)
                    for source, result in zip(plain, sharp, strict=True):
                        difference = source.take(linked) - source.take(neighbor)
                        result[linked] += sharpening * difference
        return sharp

    def blocks(self, sheets: int = 0) -> Iterator[tuple[int, slice, np.ndarray]]:
        """Yield blocks of pixels on each sheet, or on the first ones, and report the progress.

        Yields
        ------
        sheet : int
        block : slice
        state : (n,) intp ndarray
        """
        sheets, count = sheets or self.count, len(self.cells)
        for sheet in range(sheets):
            for block in pixel_blocks(count):
                report((sheet + block.start / count) / sheets, STEP_LABEL)
                yield sheet, block, sheet * self.cell_count + self.cells[block].astype(np.intp)

    def one_step(self) -> _Origins:
        """Find where each state is reached from in a step, by the midpoint method."""
        scale = np.float32(self._covering.state_scales[0])
        table = self._covering.state_table.reshape(
            -1, self.cell_count, self._covering.state_table.shape[1]
        )
        step = np.zeros((self.count, self.cell_count), dtype=np.complex64)
        for rows, sheet in zip(step, self._covering_sheet, strict=True):
            report(0.0, STEP_LABEL)
            rows.real, rows.imag = table[sheet, :, 0], table[sheet, :, 1]
            rows *= scale
        step = step.reshape(-1)
        result = _Origins.ended(len(step))
        for sheet, block, state in self.blocks():
            cell = self.cells[block]
            sheets = np.full(len(cell), sheet, dtype=np.int8)
            own = step.take(state)
            around = self.surroundings(_Origins(cell, sheets, np.float32(0.5) * own))
            result.put(state, self._moved(_Origins(cell, sheets, around.interpolate(step))))
        return result

    def doubled(
        self, sums: Sequence[_Sums], steps: int, origins: _Origins, is_last: bool
    ) -> _Origins:
        """Add to sums over a number of steps those over as many further steps, from the origins.

        Returns
        -------
        _Origins
            Of twice as many steps. Not if it is the last time.
        """
        doubled = [[values.copy() for values in total.values] for total in sums]
        result = _Origins.ended(0 if is_last else len(origins.cell))
        for _, block, state in self.blocks():
            around = self.surroundings(origins.at(state))
            for total, results in zip(sums, doubled, strict=True):
                for place, (values, target) in enumerate(zip(total.values, results, strict=True)):
                    arriving = around.interpolate(values)
                    target[state] += total.weighted(place, arriving, steps, block)
            if not is_last:
                result.put(state, self._interpolated(origins, around))
        for total, results in zip(sums, doubled, strict=True):
            total.values = results
            total.weight = total.weight * total.weight
        return result

    def _interpolated(self, origins: _Origins, around: _Surroundings) -> _Origins:
        """Interpolate the origins of states to points."""
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
            # Of points that are reached from elsewhere, the distance to the pixel is taken.
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
        return self._moved(_Origins(target.cell, target.sheet, change))

    def surroundings(self, origins: _Origins) -> _Surroundings:
        """Return the four pixels around points."""
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

    def _moved(self, origins: _Origins) -> _Origins:
        """Assign points to the pixels that they are in, if streamlines can step there."""
        moved, bit = self._stepped(origins)
        blocked = np.flatnonzero(moved.cell == SINK_CELL)
        seams = self._covering.seams
        if seams is None or not len(blocked):
            return moved
        is_crossing, seam = seams.find(origins.cell[blocked], bit[blocked])
        crossing = blocked[is_crossing]
        cell, sheet, offset = origins.at(crossing)
        column, row = np.divmod(bit[crossing], 3)[::-1]
        offset = offset - (column - 1) - 1j * (row - 1)
        offset = seams.steps.displaced(seam, offset) + seams.steps.offset.take(seam)
        offset.real, offset.imag = (np.clip(part, -1.5, 1.5) for part in (offset.real, offset.imag))
        phase, target = self._covering.packed_phase, seams.target_cell.take(seam)
        turned = phase.take(cell) - phase.take(target) + seams.sheet_shift.take(seam)
        matched = (sheet + np.rint(turned / self._spacing).astype(np.int32)) % self.count
        reached = _Origins(target, matched.astype(np.int8), offset.astype(np.complex64))
        beside, _ = self._stepped(reached)
        # Points beyond another border are moved to it.
        stays = beside.cell == SINK_CELL
        for values, before in zip(beside, reached, strict=True):
            values[stays] = before[stays]
        for part in (beside.offset.real, beside.offset.imag):
            np.clip(part, -0.5, 0.5, out=part)
        moved.put(crossing, beside)
        return moved

    def _stepped(self, origins: _Origins) -> tuple[_Origins, np.ndarray]:
        """Step to neighboring pixels, and end where that is not possible.

        Returns
        -------
        origins : _Origins
        bit : (n,) intp ndarray
            The steps, as indices into `NEIGHBOR_OFFSETS`.
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
        return _Origins(target, matched.astype(np.int8), rest), bit


class _Sums:
    """Weighted sums of noise along the streamlines of all states.

    Parameters
    ----------
    sheets : _Sheets
    sources : list of (C,) complex64 ndarray
        What is summed.
    decay : (P,) or () float32 ndarray
        q.
    turn : float
        Angle by which the second source is turned at each step.
    """

    def __init__(
        self, sheets: _Sheets, sources: list[np.ndarray], decay: np.ndarray, turn: float
    ) -> None:
        self._sheets = sheets
        self.sources = sources
        self.decay = decay
        # That of the steps by which the sums are doubled next.
        self.weight = decay
        self._turns = [0.0, turn][: len(sources)]
        size = sheets.count * sheets.cell_count
        self.values = [np.zeros(size, dtype=np.complex64) for _ in sources]
        for _, block, state in sheets.blocks():
            for total, source in zip(self.values, sources, strict=True):
                total[state] = source.take(sheets.cells[block])

    def weighted(self, place: int, values: np.ndarray, steps: int, block: slice) -> np.ndarray:
        """Multiply sums that arrive from a number of steps by their weight, and turn them.

        The arithmetic uses real numbers. Products of complex numbers are not rounded alike on all
        processors.

        Parameters
        ----------
        place : int
            Of the source.
        values : (n,) complex64 ndarray
            At the pixels of a block.
        steps : int
            The number of steps whose weight is `weight`.
        block : slice
        """
        values = values * (self.weight[block] if np.ndim(self.weight) else self.weight)
        if not self._turns[place]:
            return values
        angle = self._turns[place] * steps
        cosine, sine = np.float32(math.cos(angle)), np.float32(math.sin(angle))
        turned = np.empty_like(values)
        turned.real = values.real * cosine - values.imag * sine
        turned.imag = values.real * sine + values.imag * cosine
        return turned

    def at(
        self, covering_sheet: int, block: slice
    ) -> tuple[list[np.ndarray], np.ndarray, np.ndarray]:
        """Return the sums of a sheet at some pixels, their weights, and the sums of squared weights.

        The own noise has the weight `OWN_WEIGHT` in them.
        """
        sheets = self._sheets
        cell = sheets.cells[block].astype(np.intp)
        state = sheets.number(covering_sheet) * sheets.cell_count + cell
        values = [
            total.take(state) - np.float32(1 - OWN_WEIGHT) * source.take(cell)
            for total, source in zip(self.values, self.sources, strict=True)
        ]
        weight = values[0].imag
        decay = self.decay[block] if np.ndim(self.decay) else self.decay
        rest = 1 - (weight - np.float32(OWN_WEIGHT)) * (1 - decay) / np.maximum(
            decay, np.float32(1e-6)
        )
        return values, weight, _square_sum(np.clip(rest, 0, 1), decay).astype(np.float32)


def _line_waves(field: PixelField, covering: Covering, look: PixelLook, sums: _Sums) -> StreakWaves:
    """Blend the two sheets of each line, and equalize the contrast."""
    lines, count = field.line_count, len(field.pixel)
    flows = has_flow(look)
    match = TWO_SIDED_MATCH if _is_two_sided(field, look) else ONE_SIDED_MATCH
    channels = 2 * len(sums.sources) - 1
    constant = np.empty((lines, count, 1 if flows else channels), dtype=np.float32)
    wave = np.empty((lines, count), dtype=np.complex64) if flows else None
    effective_samples = np.zeros(count, dtype=np.float32)
    for line, first_sheet in enumerate(member_lines(field).tolist()):
        for block in reported_blocks(count, "blending lines", line / lines, (line + 1) / lines):
            state = first_sheet * covering.cell_count + covering.cell_of_pixel[block].astype(
                np.intp
            )
            if covering.has_directions:
                is_along = bool(covering.is_along_member(state[:1])[0])
                opposite = first_sheet + (lines if is_along == (look.kernel != "ramp") else 0)
                values, weight, squares = sums.at(opposite, block)
            else:
                forward = covering.forward_share(state) if flows else np.float32(0.5)
                backward = 1 - forward
                # What drifts forward comes along the opposite sheet.
                one, one_weight, one_squares = sums.at(first_sheet + lines, block)
                other, other_weight, other_squares = sums.at(first_sheet, block)
                values = [forward * a + backward * b for a, b in zip(one, other, strict=True)]
                weight = forward * one_weight + backward * other_weight
                squares = forward**2 * one_squares + backward**2 * other_squares
                squares += 2 * forward * backward * np.float32(OWN_WEIGHT**2)
            samples = weight**2 / squares
            parts = [values[0].real, *(part for v in values[1:] for part in (v.real, v.imag))]
            mean = np.stack(parts, axis=1)
            mean *= (match / weight)[:, None]
            mean += np.float32(NOISE_MEAN)
            scaled = normalize_variance(mean, samples, look) - np.float32(NOISE_MEAN)
            constant[line, block] = scaled[:, : constant.shape[2]]
            if wave is not None:
                wave[line, block] = scaled[:, 1] + np.complex64(1j) * scaled[:, 2]
            effective_samples[block] += samples
    effective_samples /= lines
    return StreakWaves(constant, wave, effective_samples)
