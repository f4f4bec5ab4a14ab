"""Streamlines of all pixels at once, and the noise gathered along them."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np

from .flow import Flow

#: Streamlines walked together: their state, some 40 bytes each, stays in a core's cache.
BLOCK = 16384

#: (entries, offsets) -> directions; see `gather`.
Direction = Callable[[np.ndarray, np.ndarray], np.ndarray]


def blocks(count: int) -> Iterator[slice]:
    """Slices that cut `count` pixels into runs of about `BLOCK`."""
    for start in range(0, count, BLOCK):
        yield slice(start, min(start + BLOCK, count))


def direction_table(flow: Flow, directions: np.ndarray, member: np.ndarray) -> np.ndarray:
    """Directions on screen, and how they turn from pixel to pixel, for `interpolate`.

    Parameters
    ----------
    flow : Flow
    directions : (P,) complex64 ndarray
        On screen.
    member : (P,) complex64 ndarray
        The same in the view plane.

    Returns
    -------
    (P + 1, 4) float32 ndarray
        x and y of the direction, and of the gradient of its angle; 0 in row P.
    """
    table = np.zeros((len(directions) + 1, 4), dtype=np.float32)
    turning = flow.turning(directions, member)
    table[:-1, 0], table[:-1, 1] = directions.real, directions.imag
    table[:-1, 2], table[:-1, 3] = turning.real, turning.imag
    return table


def interpolate(rows: np.ndarray, offset: np.ndarray) -> np.ndarray:
    """Directions at some offset from the centres of pixels, to first order.

    Real numbers one by one, not complex ones: releases of numpy and processors round the product
    of complex numbers differently, and a streamline may then step into another pixel.

    Parameters
    ----------
    rows : (B, 4) float32 ndarray
        Of a `direction_table`.
    offset : (B, 2) float32 ndarray
        Pixels.

    Returns
    -------
    (B, 2) float32 ndarray
    """
    turn = rows[:, 2] * offset[:, 0] + rows[:, 3] * offset[:, 1]
    direction = np.empty((len(rows), 2), dtype=np.float32)
    np.subtract(rows[:, 0], rows[:, 1] * turn, out=direction[:, 0])
    np.add(rows[:, 1], rows[:, 0] * turn, out=direction[:, 1])
    return direction


def gather(
    flow: Flow,
    block: slice,
    follow: Direction,
    noise: np.ndarray,
    length: int,
    step: float,
    limit: np.ndarray | None,
    tapered: bool,
) -> tuple[np.ndarray, np.ndarray]:
    """Sum the noise along one half of each streamline that starts in a block.

    Positions are an entry of the flow and an offset from that pixel's centre. Each step is of
    Adams and Bashforth's second order, v = 3/2 d - 1/2 d_before: one look-up of the direction, as
    for Euler's, without its drift out of curves.

    Parameters
    ----------
    flow : Flow
    block : slice
        Of the flow's pixels.
    follow : function
        Takes the (B,) int32 entries that the streamlines are on, P for those that have ended, and
        their (B, 2) float32 offsets from the centres of those pixels, and returns their (B, 2)
        float32 directions on screen, 0 for P. It is called once a step, in order, and may keep
        what it needs of the streamlines between calls.
    noise : (P + 1, K) float32 ndarray
        0 in row P.
    length : int
        Steps.
    step : float
        Pixels, at most 1.
    limit : (B,) ndarray or None
        Steps after which each of them ends; None for `length`.
    tapered : bool
        Whether samples count the less the farther they are from the start (`kernel`).

    Returns
    -------
    total : (B, K) float32 ndarray
        Sum of the noise after each step, times its weight, without the start.
    samples : (B,) float32 ndarray
        How many of them, before the streamline ended.
    """
    end = len(flow.pixel)
    neighbours = flow.neighbours.reshape(-1)
    entry = np.arange(block.start, block.stop, dtype=np.int32)
    offset = np.zeros((len(entry), 2), dtype=np.float32)
    total = np.zeros((len(entry), noise.shape[1]), dtype=np.float32)
    samples = np.zeros(len(entry), dtype=np.float32)
    before = None
    fall = 1 / (1 + np.asarray(length if limit is None else limit, dtype=np.float32))
    for count in range(1, length + 1):
        ahead = follow(entry, offset)
        if before is None:
            offset += np.float32(step) * ahead
        else:
            offset += np.float32(1.5 * step) * ahead - np.float32(0.5 * step) * before
        before = ahead
        # No further than a neighbour, however sharply the direction turned.
        whole = np.clip(np.rint(offset), -1, 1)
        offset -= whole
        move = whole[:, 0] + 3 * whole[:, 1]
        entry = neighbours.take((move.astype(np.intp) + 4) * (end + 1) + entry)
        if limit is not None:
            entry[limit < count] = end
        alive = entry != end
        if not alive.any():
            break
        gathered = noise.take(entry, axis=0)
        if tapered:
            gathered *= (1 - count * fall)[..., None]
        total += gathered
        samples += alive
    return total, samples
