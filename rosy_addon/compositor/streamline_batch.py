"""Batches of streamlines on a covering surface, traced together in both directions from their seeds.

A *state* is a pixel with one direction of the field there, a *line* is a pair of opposite states (see
`covering`). The noise has K channels. The covering surface has C cells and M lines in each cell.
"""

from collections.abc import Iterator, Sequence

import numpy as np

from .covering import SINK_CELL, Covering
from .drifting_averages import DriftingAverages, MovingKernel
from .filter_kernel import kernel_weights
from .look import has_flow
from .look_units import PixelLook
from .streamline_tracing import COMPACT_INTERVAL, TracedLanes, axial_steps, lateral_offset

#: Factor of the derivative of noise across a streamline. A central difference over two pixels
#: predicts the change over half a pixel only in part. With this factor, streaks are as wide as with the
#: method "brute".
LATERAL_GAIN = 0.7

#: Factor of that derivative if noise is interpolated across streamlines, which does not widen streaks.
INTERPOLATED_GAIN = 1.0

#: Distance in pixels from the center of a pixel. A streamline within it is preferred to others that pass the
#: same pixel.
MAX_LATERAL_OFFSET = 0.25


class StreamlineBatch:
    """A batch of streamlines, traced together, with preallocated buffers.

    A *lane* of the buffers is one half of a streamline: n seeds have n forward lanes, followed by n
    backward lanes. An integer parameter `lanes` is their number, 2 n.

    Lanes end at the border and where the field ends. Long lanes also end where they return to a state that
    they have passed: further turns around the loop would cost time and add no other noise.

    Parameters
    ----------
    covering : Covering
    looks : sequence of PixelLook
        Looks that differ in `length` alone. There is an average over the length of each.
    step_limits : sequence of (M C,) intp ndarray or None
        For each look: steps in each direction that the average of each line covers. If None, they are
        the `length` of the look.
    half_window : int
        States within so many steps of the seed, in each direction, take their average from the streamline.
        Further steps only contribute noise to these averages.
    max_streamlines : int
        Maximum number of streamlines in the batch.
    interpolates : bool
        Whether noise is interpolated across streamlines at every step. Otherwise it is the noise of the
        nearest pixel.
    """

    def __init__(
        self,
        covering: Covering,
        looks: Sequence[PixelLook],
        step_limits: Sequence[np.ndarray | None],
        half_window: int,
        max_streamlines: int,
        interpolates: bool = False,
    ) -> None:
        self._covering, self._half_window, look = covering, half_window, looks[0]
        self._lengths, self._kernel = [look.length for look in looks], look.kernel
        self._max_steps = half_window + max(look.streamline_reach() for look in looks)
        self._moving_kernels = [MovingKernel(each) for each in looks] if has_flow(look) else []
        step_scale, noise_scale, slope_scale = covering.state_scales
        self._step_scale, self._noise_scale = np.float32(1.5 * step_scale), np.float32(noise_scale)
        lateral_gain = (INTERPOLATED_GAIN if interpolates else LATERAL_GAIN) * slope_scale
        self._lateral_gain = np.float32(lateral_gain * step_scale)
        # `_lateral_gain` in the unit of the noise of states.
        self._noise_gain = self._lateral_gain / self._noise_scale if interpolates else None
        self._max_lateral = np.float32(MAX_LATERAL_OFFSET / step_scale)
        self._step_limits = step_limits
        lanes, channels = 2 * max_streamlines, covering.noise_channels
        self._has_second_sums = self._kernel != "box" or bool(self._moving_kernels)
        self._sums = np.empty((self._max_steps + 1, lanes, channels), dtype=np.complex64)
        self._totals = np.empty((lanes, channels), dtype=np.complex64)
        self._states = np.empty((half_window + 1, lanes), dtype=np.int32)
        self._lateral_offset = np.empty((half_window + 1, lanes), dtype=np.float32)
        self._axial_offset = np.empty_like(self._lateral_offset) if self._moving_kernels else None
        #: Total number of steps, within the half window, of the streamlines that were traced last.
        self.covered_steps = 0

    def trace(self, seeds: np.ndarray) -> Iterator[tuple[np.ndarray, list[np.ndarray], np.ndarray]]:
        """Trace streamlines, and yield for each step the averages of the lines that they pass there.

        Parameters
        ----------
        seeds : (n,) intp ndarray
            Indices of lines.

        Yields
        ------
        line : (2 n,) int32 ndarray
            Indices of the lines that are passed. If a streamline has ended, its line is in `SINK_CELL`.
        values : list of (2 n, K + 1) float32 ndarray
            For each look, the average of each noise channel times the effective samples, then the
            effective samples. The arrays are overwritten by the next step.
        centered : (m,) intp ndarray
            Indices into `line`, of the lanes that pass close to the center of the pixel.
        """
        if self._moving_kernels:
            seeds = self._along_members(seeds)
        step_counts, last_step = self._trace_steps(seeds)
        self.covered_steps = int(np.minimum(step_counts, self._half_window).sum())
        if self._moving_kernels:
            yield from self._drifting_averages(len(seeds), step_counts, last_step)
            return
        lanes, channels = 2 * len(seeds), self._covering.noise_channels
        step_counts = step_counts.astype(np.float32)
        opposite_counts = np.roll(step_counts, lanes // 2)
        values = [np.empty((lanes, channels + 1), dtype=np.float32) for _ in self._lengths]
        for step in range(min(last_step, self._half_window) + 1):
            state, is_along = self._states[step, :lanes], None
            if self._kernel == "ramp":
                is_along = self._covering.is_along_member(state)
            line = self._covering.fold_to_line(state)
            # A streamline passes up to half a pixel beside the center of a pixel. The sum is corrected
            # to the center with its derivative across the streamline.
            lateral = self._lateral_offset[step, :lanes]
            correction = (lateral * self._lateral_gain)[:, None]
            forward, backward = step_counts - np.float32(step), opposite_counts + np.float32(step)
            for full_length, limit, out in zip(
                self._lengths, self._step_limits, values, strict=True
            ):
                length = full_length if limit is None else limit.take(line)
                ahead, behind = np.clip(forward, 0, length), np.minimum(backward, length)
                if is_along is not None:
                    ahead, behind = (
                        np.where(is_along, *pair) for pair in ((ahead, behind), (behind, ahead))
                    )
                weights = kernel_weights(ahead, behind, length, self._kernel)
                if self._kernel == "box":
                    last = np.minimum(step + length, last_step)
                    first = np.maximum(step - length, -last_step)
                    noise_sum = self._rows(last, lanes)
                    noise_sum = noise_sum - self._prefix_sums_before(first, lanes)
                else:
                    if is_along is None:
                        noise_sum = self._tapered_sums(step, length, lanes)
                    else:
                        noise_sum = self._ramp_sums(step, length, lanes, is_along)
                    noise_sum *= (weights.effective_samples / weights.total)[:, None]
                np.multiply(noise_sum.real, self._noise_scale, out=out[:, :-1])
                out[:, :-1] -= correction * noise_sum.imag
                out[:, -1] = weights.effective_samples
            yield line, values, np.flatnonzero(np.abs(lateral) < self._max_lateral)

    def _along_members(self, seeds: np.ndarray) -> np.ndarray:
        """Return for each line the one of its two opposite states that is a direction of the field.

        In a field with opposites, both are, and the result is `seeds`, the (n,) indices of lines.
        """
        covering = self._covering
        if not covering.has_directions:
            return seeds
        opposite = seeds + covering.line_count * covering.cell_count
        return np.where(covering.is_along_member(seeds), seeds, opposite)

    def _drifting_averages(
        self, count: int, step_counts: np.ndarray, last_step: int
    ) -> Iterator[tuple[np.ndarray, list[np.ndarray], np.ndarray]]:
        """Yield the same as `trace`, for looks with flow, whose kernels move. Averages have one channel.

        `count` is n, the number of streamlines. `step_counts`, (2 n,), and `last_step` are from
        `_trace_steps`: the steps of each lane, and the last row of the buffers.
        """
        lanes, covering = 2 * count, self._covering
        second_sums = self._whole_second_sums(count)
        averages = [DriftingAverages(kernel, second_sums) for kernel in self._moving_kernels]
        ends = step_counts[:count].astype(np.intp), step_counts[count:].astype(np.intp)
        values = [np.empty((lanes, 2), dtype=np.float32) for _ in averages]
        for step in range(min(last_step, self._half_window) + 1):
            state = self._states[step, :lanes]
            share = covering.forward_share(state)
            line = covering.fold_to_line(state)
            lateral = self._lateral_offset[step, :lanes]
            correction = lateral * self._lateral_gain
            axial = self._axial_offset[step, :lanes]
            # The quantities of the backward half are turned to the direction of the forward half.
            for sign, lane in ((1, slice(0, count)), (-1, slice(count, lanes))):
                forward = share[lane] if sign > 0 else 1 - share[lane]
                ahead, behind = ends[0] - sign * step, ends[1] + sign * step
                place = sign * step, sign * axial[lane]
                for average, limit, out in zip(averages, self._step_limits, values, strict=True):
                    length = None if limit is None else limit.take(line[lane])
                    sums, samples = average.at(*place, length, forward, behind, ahead)
                    lane_out = out[lane]
                    np.multiply(sums.real, self._noise_scale, out=lane_out[:, 0])
                    lane_out[:, 0] -= correction[lane] * (np.float32(sign) * sums.imag)
                    lane_out[:, 1] = samples
            yield line, values, np.flatnonzero(np.abs(lateral) < self._max_lateral)

    def _whole_second_sums(self, count: int) -> np.ndarray:
        """Return the prefix sums of prefix sums of whole streamlines, joined from both halves.

        They run in the direction of the forward half. `count` is n, the number of streamlines.

        Returns
        -------
        (K, 2 R + 3, n) complex64 ndarray
            Row i + R + 2 is the sum of the prefix sums up to step i. R is the number of steps of a half.
        """
        steps, channels = self._max_steps, self._covering.noise_channels
        result = np.empty((channels, 2 * steps + 3, count), dtype=np.complex64)
        for channel, rows in enumerate(result):
            rows[steps + 2 :] = self._sums[:, :count, channel]
            rows[steps + 1] = 0
            # The same sums as `_second_prefix_sums` returns.
            np.conjugate(self._sums[::-1, count : 2 * count, channel], out=rows[: steps + 1])
            factor = np.arange(-steps - 1, 0, dtype=np.float32)
            rows[: steps + 1] += factor[:, None] * self._sums[0, :count, channel]
        return result

    def _trace_steps(self, seeds: np.ndarray) -> tuple[np.ndarray, int]:
        """Trace the streamlines and fill the buffers. Row i of a buffer is step i.

        `seeds` are (n,) indices of lines. A row holds n forward halves of streamlines, then n backward
        halves. The buffers are `_states`; `_lateral_offset`, the distances to the left of the centers of
        pixels; for moving kernels, `_axial_offset`, the distances along the streamline; and `_sums`. The real
        part of `_sums` has prefix sums of the noise, which include the seed. The imaginary part has prefix
        sums of the derivative of the noise to the left. For kernels other than the box, `_sums` are the
        prefix sums of these prefix sums, and all rows are filled. Lanes that have ended are in `SINK_CELL`.

        Returns
        -------
        step_counts : (2 n,) intp ndarray
            Number of steps that each lane made before it ended.
        last_step : int
            Index of the last row that is filled.
        """
        lanes = TracedLanes(self._covering, seeds, self._max_steps)
        for step in range(self._max_steps + 1):
            state, direction, noise = lanes.look_up()
            lateral = None
            if self._noise_gain is not None or step <= self._half_window:
                lateral = lateral_offset(lanes.position, direction)
            if self._noise_gain is not None:
                noise.real += (lateral * self._noise_gain)[:, None] * noise.imag
            lanes.total += noise
            self._store_sums(step, lanes)
            if step <= self._half_window:
                passages = [(self._states, state), (self._lateral_offset, lateral)]
                if self._axial_offset is not None:
                    scale = self._step_scale / np.float32(1.5)
                    axial = axial_steps(lanes.position, direction, scale)
                    passages.append((self._axial_offset, axial))
                for buffer, values in passages:
                    buffer[step, : lanes.count] = SINK_CELL  # it is 0, which also means no offset
                    buffer[step, lanes.index] = values
            if step == self._max_steps:
                break
            lanes.advance(step, state, direction, self._step_scale)
            if step % COMPACT_INTERVAL == COMPACT_INTERVAL - 1:
                lanes.compact()
                if lanes.have_ended:
                    self._extend_sums(step, lanes.count)
                    return lanes.step_counts(), step
        return lanes.step_counts(), self._max_steps

    def _store_sums(self, step: int, lanes: TracedLanes) -> None:
        """Fill the row `step` of `_sums`. Lanes that have ended keep their totals."""
        self._totals[lanes.index] = lanes.total
        self._sums[step, : lanes.count] = self._totals[: lanes.count]
        if self._has_second_sums and step:
            self._sums[step, : lanes.count] += self._sums[step - 1, : lanes.count]

    def _extend_sums(self, last_step: int, lanes: int) -> None:
        """Fill the rows of `_sums` after the last streamline has ended.

        Sums of prefix sums still grow there, because the prefix sums stay the same.
        """
        if self._has_second_sums:
            for step in range(last_step, self._max_steps):
                row, next_row = self._sums[step : step + 2, :lanes]
                np.add(row, self._totals[:lanes], out=next_row)

    def _tapered_sums(self, step: int, half_width: int | np.ndarray, lanes: int) -> np.ndarray:
        """Return (2 n, K) complex64 sums of the noise around the step i = `step`, with tapered weights.

        The kernel reaches r = `half_width` steps in each direction: one number, or (2 n,) numbers. With the
        sums of prefix sums E, the sum is (E(i + r) - 2 E(i - 1) + E(i - r - 2)) / (r + 1), because a
        triangular kernel is the mean of r + 1 box kernels of r + 1 steps, each one step further.
        """
        total = self._second_prefix_sums(step + half_width, lanes)
        total = total - 2 * self._second_prefix_sums(step - 1, lanes)
        total += self._second_prefix_sums(step - half_width - 2, lanes)
        total *= 1 / np.asarray(half_width + 1, dtype=np.float32)[..., None]
        return total

    def _ramp_sums(
        self, step: int, half_width: int | np.ndarray, lanes: int, is_along: np.ndarray
    ) -> np.ndarray:
        """Return (2 n, K) complex64 sums of the noise around a step, with weights that fall along the field.

        Let i be the step, r the `half_width` (one number, or (2 n,) numbers), P(i) the prefix sums of the
        noise along a lane, and E(i) the sums of these prefix sums. In a lane that runs along the field, the
        weights fall from 2 r + 1 to 1, and the sum is E(i + r) - E(i - r - 1) - (2 r + 1) P(i - r - 1). In a
        lane that runs against the field (`is_along` is False), the weights rise from 1 to 2 r + 1. Both
        weights of a sample add up to 2 r + 2, so the sum is 2 r + 2 times the unweighted sum, minus the sum
        with falling weights. All sums are divided by r + 1.
        """
        last, before = step + half_width, step - half_width - 1
        sums_through, sums_before = (self._second_prefix_sums(i, lanes) for i in (last, before))
        prefix = sums_before - self._second_prefix_sums(before - 1, lanes)
        width = np.asarray(half_width + 1, dtype=np.float32)[..., None]
        falling = sums_through - sums_before - (2 * width - 1) * prefix
        against = np.flatnonzero(~is_along)
        box = sums_through - self._second_prefix_sums(last - 1, lanes) - prefix
        falling[against] = (2 * np.broadcast_to(width, falling.shape) * box - falling)[against]
        falling *= 1 / width
        return falling

    def _second_prefix_sums(self, step: int | np.ndarray, lanes: int) -> np.ndarray:
        """Return the (2 n, K) complex64 sums E of the prefix sums up to and including a step. E(-1) is 0."""
        seed = self._sums[0, :lanes]
        if np.ndim(step) == 0:
            if step >= 0:
                return self._rows(step, lanes)
            if step == -1:
                return np.zeros_like(seed)
            return (step + 1) * seed + self._rows(-step - 2, lanes, True).conj()
        same_side = step >= 0
        rows = np.where(same_side, step, np.maximum(-step - 2, 0))
        gathered = self._rows(rows, lanes, ~same_side)
        mirrored = (step + 1)[:, None] * seed + gathered.conj()
        mirrored[step == -1] = 0
        return np.where(same_side[:, None], gathered, mirrored)

    def _prefix_sums_before(self, step: int | np.ndarray, lanes: int) -> np.ndarray:
        """Return the (2 n, K) complex64 prefix sums up to the step before `step`.

        Negative steps are on the opposite half of the streamline. The sums of that half run away from the
        seed, and its derivatives to the left have the opposite sign.
        """
        seed, same_side = self._sums[0, :lanes], step > 0
        if np.ndim(step) == 0:
            if same_side:
                return self._rows(step - 1, lanes)
            return seed - self._rows(-step, lanes, True).conj()
        gathered = self._rows(np.where(same_side, step - 1, -step), lanes, ~same_side)
        return np.where(same_side[:, None], gathered, seed - gathered.conj())

    def _rows(
        self, row: int | np.ndarray, lanes: int, is_opposite: bool | np.ndarray = False
    ) -> np.ndarray:
        """Return the (2 n, K) complex64 elements of `_sums` in a row, which may differ by lane.

        Where `is_opposite`, they are taken from the lane of the opposite half of the streamline.
        """
        half = lanes // 2
        if np.ndim(row) == 0:
            rows = self._sums[row, :lanes]
            return np.concatenate([rows[half:], rows[:half]]) if is_opposite else rows
        flat, stride = self._sums.reshape(-1, self._sums.shape[2]), self._sums.shape[1]
        lane = np.arange(lanes)
        lane = np.where(is_opposite, (lane + half) % lanes, lane)
        return flat.take(row * stride + lane, axis=0)
