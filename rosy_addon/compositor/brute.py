"""The plain way: at each step follow the best of the N members. The paper's yardstick."""

from __future__ import annotations

import numpy as np

from ..progress import Work
from .flow import Flow, all_members
from .images import Images, Walker, member_images
from .look import Look
from .streamlines import Direction, direction_table, interpolate


def brute_images(flow: Flow, look: Look, noise: np.ndarray) -> Work[Images]:
    """One image for each of the M members, streamlines matching members as they go.

    There are no breaking points and no second set; the price is a look at all N members at every
    step of every streamline.

    Parameters
    ----------
    flow : Flow
    look : Look
    noise : (P, K) float32 ndarray
    """
    fan = np.zeros((len(flow.pixel) + 1, flow.degree), dtype=np.complex64)
    screen = np.zeros((len(flow.pixel) + 1, flow.degree, 4), dtype=np.float32)
    for number, member in enumerate(all_members(flow, look.guiding_angle)):
        fan[:-1, number] = member
        directions = flow.on_screen(flow.direction(member), look.foreshorten)
        screen[:, number] = direction_table(flow, directions, member)
    walkers = [_best_of(fan, screen, member) for member in range(flow.lines)]
    return (yield from member_images(flow, look, noise, walkers))


def _best_of(fan: np.ndarray, screen: np.ndarray, member: int) -> Walker:
    """The walker that starts along one member and keeps to the best match.

    Parameters
    ----------
    fan : (P + 1, N) complex64 ndarray
        All members in the view plane, where they are matched.
    screen : (P + 1, N, 4) float32 ndarray
        The same on screen, where they lead: a `direction_table` of each.
    member : int
    """

    def walk(block: slice) -> tuple[Direction, Direction]:
        start = fan[block, member]
        return _matching(fan, screen, start, 1), _matching(fan, screen, start, -1)

    return walk


def _matching(fan: np.ndarray, screen: np.ndarray, start: np.ndarray, sign: int) -> Direction:
    """Directions of streamlines that remember the member they are on."""
    degree = fan.shape[1]
    members, tables = fan.reshape(-1), screen.reshape(-1, 4)
    heading = start

    def follow(entry: np.ndarray, offset: np.ndarray) -> np.ndarray:
        nonlocal heading
        there = fan.take(entry, axis=0)
        # Member by member: numpy is slow at the maximum of a few numbers in each of many rows.
        x, y = heading.real.copy(), heading.imag.copy()
        closest = np.full(len(entry), -np.inf, dtype=np.float32)
        chosen = np.zeros(len(entry), dtype=np.int32)
        for number in range(degree):
            match = there[:, number].real * x
            match += there[:, number].imag * y
            closer = match > closest
            np.maximum(match, closest, out=closest)
            np.copyto(chosen, np.int32(number), where=closer)
        best = entry * degree + chosen
        heading = members.take(best)
        return np.float32(sign) * interpolate(tables.take(best, axis=0), offset)

    return follow
