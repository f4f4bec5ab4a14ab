"""Walkers on the ground: many points at once that go along the field, or straight ahead.

A walker steps by straight pieces, none of which leaves its triangle; over an edge it goes on
unfolded, with the member that it follows. A piece has the direction that the field has in its
middle, and is short enough that the field turns little along it (the midpoint rule).
"""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np

from .ground import FAINT, Ground, nearest_member

#: Radians by which the field may turn along a straight piece.
TURN = np.radians(1.0)

#: Radians by which the direction of a piece may be off the field at its ends, and how often it is
#: made shorter for that.
MOST_OFF, HALVINGS = np.radians(0.9), 5

#: Pieces that a walker does at once.
MOST_PIECES = 32

#: A walker that advances by less than this share of its way in a piece turns on the spot.
STUCK = 0.004

#: Slopes of barycentric coordinates, in sizes of the triangle, below which a walker keeps to an edge.
ALONG = 1e-9


@dataclass(eq=False)
class Walkers:
    """Where n walkers are.

    Attributes
    ----------
    triangle : (n,) int32 ndarray
    weights : (n, 3) float64 ndarray
        Barycentric.
    member : (n,) complex128 ndarray
        Unit, in the triangle's frame.
    sign : (n,) float64 ndarray
        1 or -1: whether they go along or against it.
    """

    triangle: np.ndarray
    weights: np.ndarray
    member: np.ndarray
    sign: np.ndarray

    def __len__(self) -> int:
        return len(self.triangle)

    def take(self, chosen: np.ndarray) -> Walkers:
        """Some of them."""
        return Walkers(*(getattr(self, entry.name)[chosen] for entry in fields(self)))

    def put(self, chosen: np.ndarray, others: Walkers) -> None:
        """Overwrite some of them."""
        for entry in fields(self):
            getattr(self, entry.name)[chosen] = getattr(others, entry.name)

    @staticmethod
    def joined(some: Walkers, more: Walkers) -> Walkers:
        """Both, one after the other."""
        return Walkers(
            *(
                np.concatenate([getattr(some, entry.name), getattr(more, entry.name)])
                for entry in fields(Walkers)
            )
        )


@dataclass(frozen=True, eq=False)
class Path:
    """Where walkers came by: the ends of their pieces, in the order of time.

    Attributes
    ----------
    walker : (m,) intp ndarray
    triangle : (m,) int32 ndarray
        In which the piece lies.
    begin, weights : (m, 3) float64 ndarray
        Of its ends, in that triangle.
    way : (m,) complex128 ndarray
        Its direction, in that triangle.
    """

    walker: np.ndarray
    triangle: np.ndarray
    begin: np.ndarray
    weights: np.ndarray
    way: np.ndarray


def walk(
    ground: Ground, walkers: Walkers, length: np.ndarray, lean: np.ndarray | None = None
) -> tuple[Walkers, np.ndarray, np.ndarray, Path]:
    """Follow the field.

    Parameters
    ----------
    ground : Ground
    walkers : Walkers
    length : (n,) float64 ndarray
        How far, in world space.
    lean : (n,) float64 ndarray, optional
        Small angles by which they keep to the left of the field.

    Returns
    -------
    walkers : Walkers
        Where they are now.
    walked : (n,) float64 ndarray
        How far they came: less than asked if there is no way on, or after `MOST_PIECES`.
    ended : (n,) bool ndarray
        Whether there is no way on: a border, a crease, a zero of the field.
    path : Path
    """
    now = walkers.take(np.arange(len(walkers)))
    left = length.astype(np.float64).copy()
    ended = np.zeros(len(walkers), dtype=bool)
    active = np.arange(len(walkers))
    aside = np.exp(1j * (np.zeros(len(walkers)) if lean is None else lean))
    pieces: list[tuple[np.ndarray, ...]] = []
    for _ in range(MOST_PIECES):
        if not len(active):
            break
        some = now.take(active)
        piece, way, member, edge, step, lost = _piece(
            ground, some, left[active], length[active], aside[active]
        )
        pieces.append(
            tuple(column[~lost] for column in (active, some.triangle, some.weights, piece, way))
        )
        some.weights, some.member = piece, member
        left[active] -= step
        stopped = lost | _cross(ground, some, edge)
        now.put(active[~lost], some.take(~lost))
        ended[active[stopped]] = True
        active = active[~stopped & (left[active] > 1e-9 * length[active])]
    columns = [np.concatenate(column) for column in zip(*pieces, strict=True)]
    return now, length - left, ended, Path(*columns)


def go_straight(
    ground: Ground, walkers: Walkers, way: np.ndarray, length: np.ndarray
) -> tuple[Walkers, np.ndarray]:
    """Go straight ahead over the surface, with the members carried along.

    Parameters
    ----------
    ground : Ground
    walkers : Walkers
    way : (n,) complex128 ndarray
        Unit, in their triangles.
    length : (n,) float64 ndarray

    Returns
    -------
    walkers : Walkers
        Their members those of the field, nearest to what was carried; 0 where there are none.
    walked : (n,) float64 ndarray
        Less than asked where there is no way on.
    """
    now = walkers.take(np.arange(len(walkers)))
    way = way.copy()
    left = length.astype(np.float64).copy()
    active = np.arange(len(walkers))
    for _ in range(8 * MOST_PIECES):
        if not len(active):
            break
        some, ahead = now.take(active), way[active]
        slope = _slopes(ground, some.triangle, ahead)
        reach, edge = _reach(ground, some, slope)
        step = np.minimum(reach, left[active])
        edge = np.where(reach <= left[active], edge, -1)
        some.weights = _moved(some.weights, slope, step)
        left[active] -= step
        turn = np.ones(len(active), dtype=np.complex128)
        stopped = _cross(ground, some, edge, turn)
        now.put(active, some)
        way[active] = ahead * turn
        active = active[~stopped & (left[active] > 1e-9 * length[active])]
    now.member = ground.members(now.triangle, now.weights, now.member)
    return now, length - left


def _piece(
    ground: Ground, some: Walkers, left: np.ndarray, length: np.ndarray, aside: np.ndarray
) -> tuple[np.ndarray, ...]:
    """One piece of each: new weights, direction, member, edge reached or -1, step, and if lost."""
    corner_z = ground.z[some.triangle]
    z = np.einsum("nk,nk->n", some.weights, corner_z)
    scale = np.abs(corner_z).max(axis=1)
    lost = np.abs(z) <= FAINT * scale
    member = nearest_member(some.member, np.where(lost, 1, z), ground.degree)
    turn = some.sign * aside
    way = turn * ground.ways(some.triangle, some.weights, member)
    slope = _slopes(ground, some.triangle, way)
    reach, _ = _reach(ground, some, slope)
    turning = np.abs((np.einsum("nk,nk->n", slope, corner_z) * z.conj()).imag)
    size = z.real**2 + z.imag**2
    limit = np.where(
        turning > 0, TURN * ground.degree * size / np.where(turning > 0, turning, 1), np.inf
    )
    lost |= limit < STUCK * length
    step, piece, edge = np.zeros(len(left)), some.weights.copy(), np.full(len(left), -1)
    tried = np.flatnonzero(~lost)
    for _ in range(HALVINGS):
        few = some.take(tried)
        z = corner_z[tried]
        most = np.minimum(left, limit)[tried]
        middle = _moved(few.weights, slope[tried], 0.5 * np.minimum(reach[tried], most))
        along = nearest_member(member[tried], np.einsum("nk,nk->n", middle, z), ground.degree)
        ahead = turn[tried] * ground.ways(few.triangle, middle, along)
        rise = _slopes(ground, few.triangle, ahead)
        far, border = _reach(ground, few, rise)
        walked = np.minimum(far, most)
        there = _moved(few.weights, rise, walked)
        last = nearest_member(along, np.einsum("nk,nk->n", there, z), ground.degree)
        off = np.minimum((last * along.conj()).real, (member[tried] * along.conj()).real)
        fine = off >= np.cos(MOST_OFF)
        done = tried[fine]
        step[done], piece[done], way[done] = walked[fine], there[fine], ahead[fine]
        edge[done] = np.where(far <= most, border, -1)[fine]
        member[done] = along[fine]
        tried = tried[~fine]
        if not len(tried):
            break
        # The field bends more than it seemed to: a shorter piece.
        limit[tried] = 0.5 * walked[~fine]
    lost[tried] = True
    return piece, way, member, edge, step, lost


def _slopes(ground: Ground, triangle: np.ndarray, way: np.ndarray) -> np.ndarray:
    """(n, 3) how barycentric coordinates change along a direction."""
    gradient = ground.gradient[triangle]
    return gradient.real * way.real[:, None] + gradient.imag * way.imag[:, None]


def _reach(ground: Ground, some: Walkers, slope: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """How far it is to the border of the triangle, and which edge is there."""
    falling = slope < -ALONG * np.abs(slope).max(axis=1, keepdims=True)
    way = np.where(falling, some.weights / np.where(falling, -slope, 1), np.inf)
    edge = np.argmin(way, axis=1)
    return np.take_along_axis(way, edge[:, None], 1)[:, 0], edge


def _moved(weights: np.ndarray, slope: np.ndarray, step: np.ndarray) -> np.ndarray:
    weights = np.maximum(weights + slope * step[:, None], 0)
    return weights / weights.sum(axis=1, keepdims=True)


def _cross(
    ground: Ground, some: Walkers, edge: np.ndarray, turn: np.ndarray | None = None
) -> np.ndarray:
    """Take walkers over the edges that they have reached; True for those that cannot go on."""
    reached = np.flatnonzero(edge >= 0)
    stopped = np.zeros(len(edge), dtype=bool)
    triangle, k = some.triangle[reached], edge[reached]
    beyond = ground.across[triangle, k]
    stopped[reached[beyond < 0]] = True
    over = beyond >= 0
    reached, triangle, k, beyond = reached[over], triangle[over], k[over], beyond[over]
    j = ground.back[triangle, k].astype(np.intp)
    unfold = ground.unfold[triangle, k]
    weights = some.weights[reached]
    row = np.arange(len(reached))
    fresh = np.zeros_like(weights)
    # Neighbours run along their edge in opposite directions.
    fresh[row, (j + 1) % 3] = weights[row, (k + 2) % 3]
    fresh[row, (j + 2) % 3] = weights[row, (k + 1) % 3]
    some.weights[reached] = fresh / fresh.sum(axis=1, keepdims=True)
    some.triangle[reached] = beyond
    some.member[reached] *= unfold
    if turn is not None:
        turn[reached] = unfold
    return stopped
