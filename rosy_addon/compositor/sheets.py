"""Our way: the streamlines of the covering surface, each of them walked once.

All pixels along a streamline average nearly the same noise. So streamlines are not begun at every
pixel: some are walked far, with a running sum of their noise, and every state they pass takes its
average from the difference of two sums. Those that none has passed start the next ones. That is
the fast LIC of Stalling and Hege (SIGGRAPH 1995), on the covering (`covering`), with many
streamlines side by side in arrays (`walker`); a state costs a few steps, whatever the length.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace

import numpy as np

from ..progress import Progress, Work, part
from .contrast import even_out
from .covering import (
    BLOCK,
    END,
    OPEN,
    Covering,
    line_of_member,
    put,
    unfold,
    whole_rows,
)
from .flow import Flow
from .images import Images, limits
from .kernel import whole_samples
from .look import Look
from .noise import MEAN
from .walker import Walker

#: Streamlines walked together, in both directions at once.
TOGETHER = 5120

#: Steps of all of these, each way: fewer streamlines walk together if they are very long.
ROOM = 1 << 21

#: Steps for which a streamline serves the states it passes, each way; half the length if that is
#: more, so that long ones do not mostly gather for the few states near their seeds.
SERVED = 96

#: The first streamlines begin on rows and columns of pixels, this share of those steps apart.
EVERY = 1.1

#: Those of later rounds begin anywhere, so many for each pixel across that none has passed.
COVER = 1.75

#: Rounds go on while a greater share of the lines than this has been passed by no streamline; the
#: others take the average of a neighbour on their own.
LEFT = 0.15
MOST_ROUNDS = 8

#: From which neighbours those take it: so many pixels along their line, so many to its left.
BESIDE = ((1, 0), (-1, 0), (1, 0), (-1, 0), (0, 1), (0, -1), (1, 0), (-1, 0), (0, 1), (0, -1))

#: Directions are not interpolated on the way, which would blur streaks a little: without this they
#: would vary by as much more than those of brute force.
CONTRAST = 0.99

#: States of a strip of the picture, which bounds the memory.
STRIP = 1 << 23


def sheets_images(flow: Flow, look: Look, noise: np.ndarray) -> Work[Images]:
    """One image for each of the M members.

    Parameters
    ----------
    flow : Flow
    look : Look
    noise : (P, K) float32 ndarray
    """
    count, channels = noise.shape
    noise = noise - np.float32(MEAN)
    line = line_of_member(flow)
    members = np.empty((len(line), count, channels), dtype=np.float32)
    samples = np.empty(count, dtype=np.float32)
    limit = limits(flow, look)
    carried = None
    for wide, core, after in _strips(flow, look):
        near = _cut(flow, wide)
        covering = unfold(near, look, noise[wide])
        cells = covering.place[core.start - wide.start :]
        inside, beyond = np.split(cells[: after - core.start], [core.stop - core.start])
        averages = _Averages(covering, cells[: after - core.start])
        still = near.representation == 0
        averages.start_still(covering.place[still], noise[wide][still])
        walking = _pass_all(covering, averages, look, _on_cells(limit, wide, covering))
        yield from part(walking, core.start / count, core.stop / count)
        known = averages.take(inside, line)
        _fade(known, carried, near.pixel[core.start - wide.start :] // flow.width)
        _average(known, look, members[:, core])
        samples[core] = known[:, :, -1].mean(axis=0)
        carried = averages.take(beyond, line)
    return Images(members, members.mean(axis=0), samples, np.ones(count, dtype=np.float32))


def _on_cells(limit: np.ndarray | None, wide: slice, covering: Covering) -> np.ndarray | None:
    """(C,) intp of the (P,) limits of the pixels."""
    if limit is None:
        return None
    cells = np.zeros(covering.cells, dtype=np.intp)
    cells[covering.place] = limit[wide]
    return cells


def _fade(known: np.ndarray, carried: np.ndarray | None, row: np.ndarray) -> None:
    """Let a strip begin with what the one before has found there.

    Parameters
    ----------
    known : (M, n, K + 1) float32 ndarray
        Sums and samples of the strip, changed in place.
    carried : (M, m, K + 1) float32 ndarray or None
        Of the other, for the first pixels of this one.
    row : (n,) int ndarray
        Of each pixel.
    """
    if carried is None or not carried.size:
        return
    count = min(carried.shape[1], known.shape[1])
    carried, row = carried[:, :count], row[:count]
    share = (row[-1] - row + 0.5) / (row[-1] - row[0] + 1)
    known[:, :count] += share[:, None].astype(np.float32) * (carried - known[:, :count])


def _average(known: np.ndarray, look: Look, members: np.ndarray) -> None:
    """Write (M, n, K) averages, of even spread, of (M, n, K + 1) sums and samples."""
    whole = np.float32(whole_samples(look) - 0.5)
    for line, member in zip(known, members, strict=True):
        for start in range(0, len(line), BLOCK):
            sums, samples = line[start : start + BLOCK, :-1], line[start : start + BLOCK, -1].copy()
            mean = member[start : start + BLOCK]
            np.divide(sums, samples[:, None], out=mean)
            mean *= np.float32(CONTRAST)
            mean += np.float32(MEAN)
            if samples.min() < whole:
                mean[...] = even_out(mean, samples, look)


def _strips(flow: Flow, look: Look) -> Iterator[tuple[slice, slice, int]]:
    """Strips of rows of the picture, as parts of the list of pixels.

    Yields
    ------
    wide, core : slice
        The pixels that streamlines may pass, and those among them that get their averages.
    after : int
        The end of those after the core that get one as well: streaks fade from strip to strip, or
        they would all change at once.
    """
    count = len(flow.pixel)
    if count * 2 * flow.lines <= STRIP:
        yield slice(0, count), slice(0, count), count
        return
    margin = int(look.length * look.step) + 2
    # So many rows that no strip does more for its surroundings than for itself.
    rows = max(STRIP // (2 * flow.lines) // flow.width, 3 * margin)
    for start in range(0, flow.height, rows):
        stop = start + rows
        border = np.array([start - margin, start, stop, stop + margin, stop + 2 * margin])
        low, first, last, after, high = np.searchsorted(flow.pixel, border * flow.width).tolist()
        if first < last:
            yield slice(low, high), slice(first, last), after


def _cut(flow: Flow, wide: slice) -> Flow:
    """The pixels of some rows, as if there were no others."""
    if wide.stop - wide.start == len(flow.pixel):
        return flow
    row = flow.pixel[wide] // np.int32(flow.width)
    joined = flow.joined[wide].copy()
    joined[row == row[0]] &= OPEN << 3 & OPEN
    joined[row == row[-1]] &= OPEN >> 3
    return replace(
        flow,
        pixel=flow.pixel[wide],
        representation=flow.representation[wide],
        axes=None if flow.axes is None else flow.axes[wide],
        joined=joined,
        traits={trait: values[wide] for trait, values in flow.traits.items()},
    )


class _Averages:
    """What is known of each line of each cell: the mean of the noise along it, and its samples.

    The mean is kept times the samples.

    The samples of a line that no streamline has passed are 0, or -1 if it is not wanted.

    Parameters
    ----------
    covering : Covering
    wanted : (n,) int32 ndarray
        Cells.
    """

    def __init__(self, covering: Covering, wanted: np.ndarray) -> None:
        shape = (covering.lines, covering.cells, covering.channels + 1)
        state = np.full(covering.cells, -1, dtype=np.float32)
        state[wanted] = 0
        self._values = np.empty(shape, dtype=np.float32)
        self._values[:, :, -1] = state
        self._flat = self._values.reshape(-1, shape[-1])

    def start_still(self, cell: np.ndarray, noise: np.ndarray) -> None:
        """Pixels without a direction have their own noise and no streamline."""
        self._values[:, cell, :-1] = noise
        self._values[:, cell, -1] = 1

    def put(self, steps: Iterable[tuple[np.ndarray, np.ndarray, np.ndarray]]) -> None:
        """Write what streamlines have gathered, as `Walker.walk` yields it.

        Of several that pass one line, those that are near to it there stay.
        """
        near_line, near_values = [], []
        for line, values, near in steps:
            put(self._flat, line, values)
            near_line.append(line.take(near))
            near_values.append(values.take(near, axis=0))
        put(self._flat, np.concatenate(near_line), np.concatenate(near_values))
        # Streamlines that have ended pass this one.
        self._values[:, END, -1] = -1

    def copy(self, line: np.ndarray, other: np.ndarray) -> np.ndarray:
        """Take over what is known of other lines; return those of which nothing is."""
        values = self._flat.take(other, axis=0)
        known = values[:, -1] > 0
        put(self._flat, line[known], values[known])
        return line[~known]

    def missing(self) -> np.ndarray:
        """Entries of wanted lines that are not known yet."""
        return np.flatnonzero(self._values[:, :, -1] == 0)

    def unknown(self, line: np.ndarray) -> np.ndarray:
        """Those among some lines that are wanted and not known yet."""
        return line[self._flat[:, -1].take(line) == 0]

    def take(self, cell: np.ndarray, line: np.ndarray) -> np.ndarray:
        """(M, n, K + 1) sums and samples of the lines of some cells."""
        found = np.empty((len(line), len(cell), self._values.shape[2]), dtype=np.float32)
        for number, out in zip(line, found, strict=True):
            whole_rows(self._values[number]).take(cell, out=whole_rows(out), mode="clip")
        return found


def _pass_all(
    covering: Covering, averages: _Averages, look: Look, limit: np.ndarray | None
) -> Work[None]:
    """Walk streamlines until every wanted line has an average."""
    served = max(SERVED, look.length // 2)
    missing = averages.missing()
    total = len(missing)
    seeds = _on_lattice(covering, averages, max(int(EVERY * served * look.step), 1))
    most = _together(served + look.length)
    walker = Walker(covering, look, limit, served, most)
    for _ in range(MOST_ROUNDS):
        steps = 0
        for some in _batches(seeds, most):
            averages.put(walker.walk(some))
            steps += walker.taken
            yield Progress(1 - len(missing) / total, "Following streamlines")
        missing = averages.missing()
        if len(missing) <= LEFT * total:
            break
        # Streamlines that end early pass less, and the next round has more of them.
        passed = steps / max(len(seeds), 1) + 1
        seeds = missing[_spread(len(missing), int(COVER * len(missing) / passed) + 1)]
    for along, left in BESIDE:
        missing = averages.copy(missing, covering.beside(missing, along, left))
    # What has no neighbour walks alone, no farther than it must.
    most = min(_together(look.length), len(missing))
    walker = Walker(covering, look, limit, 0, most)
    for some in _batches(missing, most):
        averages.put(walker.walk(some))
        yield Progress(0.95, "Following streamlines")


def _together(reach: int) -> int:
    """How many streamlines of so many steps each way walk side by side."""
    return max(min(TOGETHER, ROOM // reach), 1)


def _batches(seeds: np.ndarray, most: int) -> list[np.ndarray]:
    """Equal parts of at most so many."""
    return np.array_split(seeds, -(-len(seeds) // most)) if len(seeds) else []


def _on_lattice(covering: Covering, averages: _Averages, every: int) -> np.ndarray:
    """Lines on rows and columns of the window, those of each that cross it.

    Streamlines from there run side by side, so that they leave few lines out, pass few twice, and
    find each other's records in the cache.

    Parameters
    ----------
    covering : Covering
    averages : _Averages
    every : int
        Pixels from one row, and column, to the next, about.

    Returns
    -------
    (n,) intp ndarray
        Entries of lines.
    """
    width, height = covering.width, covering.cells // covering.width
    rows, columns = (_evenly(size, every)[:, None] for size in (height, width))
    lattice = rows * width + np.arange(width), columns + np.arange(height) * width
    seeds = []
    for line in range(covering.lines):
        for axis, cells in enumerate(lattice):
            entry = averages.unknown(line * covering.cells + cells.ravel())
            step = np.abs(covering.records.take(entry, axis=0)[:, :2])
            along, across = step[:, axis], step[:, 1 - axis]
            seeds.append(entry[along < across if axis else along <= across])
    return np.concatenate(seeds)


def _evenly(size: int, every: int) -> np.ndarray:
    """Places in a length, the same distance apart and half of it from the ends."""
    count = max(round(size / every), 1)
    return ((np.arange(count) + 0.5) * (size / count)).astype(np.intp)


def _spread(length: int, count: int) -> np.ndarray:
    """(min(count, length),) intp: places in a list, one at a different part of each stretch."""
    count = min(count, length)
    number = np.arange(count)
    place = (number + number * 0.6180339887498949 % 1) * (length / max(count, 1))
    return np.minimum(place.astype(np.intp), length - 1)
