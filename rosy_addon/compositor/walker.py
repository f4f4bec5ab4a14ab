"""Many streamlines of a covering, walked side by side, both ways from their seeds."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from .covering import END, OPEN, Covering, joined
from .kernel import weights_of
from .look import Look

#: Steps after which those that have ended are left out, if they are many.
COMPACTED = 8

#: The share of the slope across a streamline that counts. Differences over two pixels tell the
#: change over half of one only in part; this much gives streaks the width that brute force gives.
LATERAL = 0.7

#: How far, in pixels, the streamlines may be from the centre of a pixel that serve it best.
NEAR = 0.25


class Walker:
    """Streamlines of one length, and the room for some of them at once.

    Parameters
    ----------
    covering : Covering
    look : Look
        Its `length`, `taper` and `step` count.
    limit : (C,) intp ndarray or None
        Steps each way that count for a cell; None for `look.length`.
    served : int
        Steps each way for which streamlines serve the states that they pass; beyond them they
        only gather noise for these.
    most : int
        Streamlines at once, at most.
    """

    def __init__(
        self, covering: Covering, look: Look, limit: np.ndarray | None, served: int, most: int
    ) -> None:
        self._covering = covering
        self._served, self._reach = served, served + look.length
        self._length, self._tapered = look.length, look.taper
        step, tone, slope = covering.units
        self._step, self._tone = np.float32(1.5 * step), np.float32(tone)
        self._lateral = np.float32(LATERAL * slope / look.step * step)
        self._near = np.float32(NEAR * look.step / step)
        self._limit = None if limit is None else np.tile(limit, covering.lines)
        lanes, channels = 2 * most, covering.channels
        self._sums = np.empty((self._reach + 1, lanes, channels), dtype=np.complex64)
        self._totals = np.empty((lanes, channels), dtype=np.complex64)
        self._state = np.empty((served + 1, lanes), dtype=np.int32)
        self._aside = np.empty((served + 1, lanes), dtype=np.float32)
        #: Steps that the streamlines of the last walk took before their end, of those that serve.
        self.taken = 0

    def walk(self, seeds: np.ndarray) -> Iterator[tuple[np.ndarray, np.ndarray, np.ndarray]]:
        """Lines that some streamlines pass, step by step, and what they have gathered there.

        Parameters
        ----------
        seeds : (n,) intp ndarray
            Entries of lines.

        Yields
        ------
        line : (2 n,) int32 ndarray
            Of the cell `END` where streamlines have ended.
        values : (2 n, K + 1) float32 ndarray
            The mean of the noise of each channel around there, times its samples, and these.
            Overwritten by the next step.
        near : (m,) intp ndarray
            Which of the streamlines pass close to the centre of the pixel.
        """
        alive, steps = self._follow(seeds)
        self.taken = int(np.minimum(alive, self._served).sum())
        lanes, channels = 2 * len(seeds), self._covering.channels
        alive = alive.astype(np.float32)
        other = np.roll(alive, lanes // 2)
        values = np.empty((lanes, channels + 1), dtype=np.float32)
        for number in range(min(steps, self._served) + 1):
            line = self._covering.line_of(self._state[number, :lanes])
            length = self._length if self._limit is None else self._limit.take(line)
            ahead = np.clip(alive - np.float32(number), 0, length)
            behind = np.minimum(other + np.float32(number), length)
            weights = weights_of(ahead, behind, length, self._tapered)
            if self._tapered:
                between = self._weighed(number, length, lanes)
                between *= (weights.samples / weights.total)[:, None]
            else:
                last = np.minimum(number + length, steps)
                first = np.maximum(number - length, -steps)
                between = self._sums_to(last, lanes) - self._sums_before(first, lanes)
            # A streamline passes beside the centre of a pixel, not through it, by up to half a
            # pixel: each sum is moved to the centre by its slope across the streamline.
            aside = self._aside[number, :lanes]
            np.multiply(between.real, self._tone, out=values[:, :-1])
            values[:, :-1] -= (aside * self._lateral)[:, None] * between.imag
            values[:, -1] = weights.samples
            yield line, values, np.flatnonzero(np.abs(aside) < self._near)

    def _follow(self, seeds: np.ndarray) -> tuple[np.ndarray, int]:
        """Fill the room: row i is step i, of n streamlines forward and then of them backward.

        `_state` is where they are, `_aside` how far to the left of the pixel's centre, and `_sums`
        the noise from the seed on, itself included, with its slope to the left as imaginary part.
        For tapered weights `_sums` are the sums of these sums, in all rows there are.

        Returns
        -------
        alive : (2 n,) intp ndarray
            Steps before the streamlines ended.
        steps : int
            Rows filled after the first.
        """
        covering, lanes = self._covering, 2 * len(seeds)
        kind = np.float64 if covering.channels == 1 else np.complex128
        records = covering.records.view(kind)[:, 0]
        # No streamline winds more often than once in four steps.
        turns = self._reach // 4 + 2
        first_state, back = covering.first_states(turns)
        sheet, cell = np.divmod(seeds, covering.cells)
        cell = np.concatenate([cell, cell])
        sheet = np.concatenate([sheet, sheet + back]) + turns * covering.around
        turn = covering.turn.take(cell)
        angle = turn + sheet.astype(np.float32)
        start = _scattered(len(seeds))
        position = np.concatenate([start, start])
        before = None
        total = np.zeros((lanes, covering.channels), dtype=np.complex64)
        # Those that have not ended, once many have; the others' rows stay as they are.
        live, lives = None, np.full(lanes, self._reach)
        alive = lives
        for number in range(self._reach + 1):
            state = first_state.take(sheet, mode="clip")
            state += cell
            record = records.take(state, mode="clip").view(np.int16).astype(np.float32)
            record = record.view(np.complex64).reshape(len(cell), -1)
            ahead = record[:, 0].copy()
            total += record[:, 1:]
            self._store(number, live, lanes, state, position, ahead, total)
            if number == self._reach:
                break
            # The method of Adams and Bashforth, 3/2 d - 1/2 d_before.
            way = ahead.copy() if before is None else before
            flat_way, offset = way.view(np.float32), position.view(np.float32)
            flat_way *= np.float32(-1 / 3)
            way += ahead
            flat_way *= self._step
            position += way
            before = ahead
            np.rint(offset, out=flat_way)
            np.maximum(flat_way, np.float32(-1), out=flat_way)
            np.minimum(flat_way, np.float32(1), out=flat_way)
            position -= way
            alive[self._move(cell, joined(turn), flat_way[::2], flat_way[1::2])] = number
            turn = covering.turn.take(cell, mode="clip")
            angle -= turn
            np.rint(angle, out=angle)
            sheet = angle.astype(np.intp)
            angle += turn
            if number % COMPACTED == COMPACTED - 1:
                left = np.flatnonzero(cell)
                if len(left) < 0.9 * len(cell):
                    live = np.arange(lanes) if live is None else live
                    lives[live] = alive
                    if not len(left):
                        self._go_on_from(number, lanes)
                        return lives, number
                    live, alive, cell, sheet = live[left], alive[left], cell[left], sheet[left]
                    turn, angle, position = turn[left], angle[left], position[left]
                    before, total = before[left], total[left]
        if live is not None:
            lives[live] = alive
        return lives, self._reach

    def _move(
        self, cell: np.ndarray, goes_on: np.ndarray, column: np.ndarray, row: np.ndarray
    ) -> np.ndarray:
        """Change cells by a step of -1 to 1 columns and rows; return which streamlines it ends."""
        shut = np.flatnonzero(goes_on != OPEN)
        if len(shut):
            bit = (column[shut] + 3 * row[shut] + 4).astype(np.uint32)
            shut = shut[goes_on[shut] >> bit & 1 == 0]
        ended = shut[cell[shut] != END]
        away = row * np.float32(self._covering.width)
        away += column
        cell += away.astype(np.intp)
        cell[shut] = END
        return ended

    def _store(
        self,
        number: int,
        live: np.ndarray | None,
        lanes: int,
        state: np.ndarray,
        position: np.ndarray,
        ahead: np.ndarray,
        total: np.ndarray,
    ) -> None:
        """Write row `number` of the room, for all streamlines or the live ones alone."""
        self._totals[slice(lanes) if live is None else live] = total
        self._sums[number, :lanes] = self._totals[:lanes]
        if self._tapered and number:
            self._sums[number, :lanes] += self._sums[number - 1, :lanes]
        if number > self._served:
            return
        aside = position.imag * ahead.real
        aside -= position.real * ahead.imag
        if live is None:
            self._state[number, :lanes] = state
            self._aside[number, :lanes] = aside
        else:
            self._state[number, :lanes] = END
            self._state[number, live] = state
            self._aside[number, :lanes] = 0
            self._aside[number, live] = aside

    def _go_on_from(self, number: int, lanes: int) -> None:
        """Fill the rows after the last streamline's end, where sums of sums still grow."""
        if self._tapered:
            for row in range(number, self._reach):
                np.add(
                    self._sums[row, :lanes], self._totals[:lanes], out=self._sums[row + 1, :lanes]
                )

    def _weighed(self, number: int, reach: int | np.ndarray, lanes: int) -> np.ndarray:
        """(2 n, K) complex64: tapered sums of the noise around a step, `reach` steps each way.

        With E the sums of sums, (E(i + r) - 2 E(i - 1) + E(i - r - 2)) / (r + 1): a triangle is a
        mean of r + 1 windows of r + 1 steps, one step apart.
        """
        found = self._sums_of_sums(number + reach, lanes)
        found = found - 2 * self._sums_of_sums(number - 1, lanes)
        found += self._sums_of_sums(number - reach - 2, lanes)
        found *= 1 / np.asarray(reach + 1, dtype=np.float32)[..., None]
        return found

    def _sums_of_sums(self, step: int | np.ndarray, lanes: int) -> np.ndarray:
        """(2 n, K) complex64: E up to some step, from the seed on; that of step -1 is 0."""
        half, seed = lanes // 2, self._sums[0, :lanes]
        if np.ndim(step) == 0:
            if step >= 0:
                return self._sums[step, :lanes]
            if step == -1:
                return np.zeros_like(seed)
            other = self._sums[-step - 2, :lanes]
            return (step + 1) * seed + np.concatenate([other[half:], other[:half]]).conj()
        flat, most = self._sums.reshape(-1, self._sums.shape[2]), self._sums.shape[1]
        lane, same = np.arange(lanes), (step >= 0)[:, None]
        row = np.where(step >= 0, step, np.maximum(-step - 2, 0)) * most
        found = flat.take(row + np.where(same[:, 0], lane, (lane + half) % lanes), axis=0)
        there = (step + 1)[:, None] * seed + found.conj()
        return np.where(same, found, np.where((step == -1)[:, None], np.complex64(0), there))

    def _sums_to(self, step: int | np.ndarray, lanes: int) -> np.ndarray:
        """(2 n, K) complex64: sums up to some step, included."""
        if np.ndim(step) == 0:
            return self._sums[step, :lanes]
        flat, most = self._sums.reshape(-1, self._sums.shape[2]), self._sums.shape[1]
        return flat.take(step * most + np.arange(lanes), axis=0)

    def _sums_before(self, step: int | np.ndarray, lanes: int) -> np.ndarray:
        """(2 n, K) complex64: sums up to some step, without it; steps to the other side negative.

        That side has the sums away from the seed, and sees slopes with the other sign.
        """
        half, seed = lanes // 2, self._sums[0, :lanes]
        if np.ndim(step) == 0:
            if step > 0:
                return self._sums[step - 1, :lanes]
            other = self._sums[-step, :lanes]
            return seed - np.concatenate([other[half:], other[:half]]).conj()
        flat, most = self._sums.reshape(-1, self._sums.shape[2]), self._sums.shape[1]
        lane = np.arange(lanes)
        same = step > 0
        row = np.where(same, step - 1, -step) * most
        found = flat.take(row + np.where(same, lane, (lane + half) % lanes), axis=0)
        return np.where(same[:, None], found, seed - found.conj())


def _scattered(count: int) -> np.ndarray:
    """(count,) complex64 places that fill a pixel evenly, relative to its centre: Roberts' R2.

    Streamlines that began at the centres would all pass on to the next row of pixels at once, and
    be seen to.
    """
    number, base = np.arange(count) + 0.5, 1.3247179572447460
    place = number / base % 1 + 1j * (number / base**2 % 1)
    return (place - (0.5 + 0.5j)).astype(np.complex64)
