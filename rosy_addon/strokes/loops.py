"""Strokes that come round to where they began, closed without a seam.

A stroke that grows around a tube meets its own other end and stops before it. If the field brings it
back to its first point, but for an offset that is small over its length, it is drawn anew from there,
leaning so little to one side that it arrives exactly.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from ..field.frames import dot, unit
from .ground import Ground
from .strokes import Strokes
from .walk import Walkers, walk

#: Radians that a stroke may lean from the field to close.
LEAN = np.radians(0.09)

#: Shares of the spacing: how far the ends of a stroke are apart, at most, ahead and aside.
AHEAD, ASIDE = 1.5, 0.4

#: A loop is at least so many spacings long.
SHORTEST = 6.0

#: Rounds of leaning, and the share of the spacing by which the end may miss the beginning then.
ROUNDS, OFF = 4, 1e-3

#: Share of the spacing that a walker goes at once.
STEP = 0.5


class _Trail(NamedTuple):
    """Where n walkers came by on their way round.

    Attributes
    ----------
    walker, triangle, weights, way :
        As in `walk.Path`.
    left : (n,) float64 ndarray
        How far to the left of the first point they passed it.
    passed : (n,) bool ndarray
        Whether they did.
    """

    walker: np.ndarray
    triangle: np.ndarray
    weights: np.ndarray
    way: np.ndarray
    left: np.ndarray
    passed: np.ndarray


def closed_up(ground: Ground, strokes: Strokes, spacing: np.ndarray) -> Strokes:
    """Close strokes whose ends meet.

    Parameters
    ----------
    ground : Ground
        On which they were traced.
    strokes : Strokes
    spacing : (T, 3) ndarray
        At the corners of the triangles.
    """
    some = _candidates(strokes)
    if not len(some):
        return strokes
    first, last = strokes.start[:-1][some], strokes.start[1:][some] - 1
    off = OFF * strokes.spacing[first]
    # From how far aside the strokes end as they are, by the rule of the secant.
    before, missed = np.zeros(len(some)), _leftward(strokes, first, strokes.points[last])
    lean = np.clip(-missed / strokes.length[some], -LEAN, LEAN)
    for _ in range(ROUNDS):
        trail = _around(ground, strokes, some, lean)
        change, turned = trail.left - missed, lean - before
        if (np.abs(trail.left) <= off).all():
            break
        more = np.divide(-trail.left * turned, change, out=np.zeros_like(lean), where=change != 0)
        before, missed, lean = lean, trail.left, lean + np.clip(more, -LEAN, LEAN)
    closes = trail.passed & (np.abs(trail.left) <= off) & (np.abs(lean) <= LEAN)
    if not closes.any():
        return strokes
    open_ = np.ones(len(strokes), dtype=bool)
    open_[some[closes]] = False
    loops = _drawn(ground, strokes.chosen(some), trail, closes, spacing)
    joined = Strokes.joined(strokes.chosen(open_), loops)
    return replace(joined, family=np.zeros(len(joined), dtype=np.int32), names=strokes.names)


def _leftward(strokes: Strokes, first: np.ndarray, points: np.ndarray) -> np.ndarray:
    """(n,) how far left of first points, as one looks along the strokes there, others are."""
    aside = np.cross(strokes.normal[first], strokes.member[first])
    return dot(points - strokes.points[first], unit(aside))


def _candidates(strokes: Strokes) -> np.ndarray:
    """Numbers of strokes whose last point is a little before their first one."""
    first, last = strokes.start[:-1], strokes.start[1:] - 1
    spacing = strokes.spacing[first]
    gap = strokes.points[first] - strokes.points[last]
    way = unit(strokes.member[first] + strokes.member[last])
    ahead = dot(gap, way)
    aside = np.sqrt(np.maximum(dot(gap, gap) - ahead * ahead, 0))
    found = (dot(strokes.member[first], strokes.member[last]) > 0.8) & ~strokes.closed
    found &= dot(strokes.normal[first], strokes.normal[last]) > 0.8
    found &= (np.abs(ahead) < AHEAD * spacing) & (aside < ASIDE * spacing)
    length = strokes.length
    return np.flatnonzero(found & (length > SHORTEST * spacing) & (aside < 2 * LEAN * length))


def _around(ground: Ground, strokes: Strokes, some: np.ndarray, lean: np.ndarray) -> _Trail:
    """Walk from the first points until they are passed again, or missed."""
    first = strokes.start[:-1][some]
    origin, along = strokes.points[first], strokes.member[first]
    spacing, length = strokes.spacing[first], strokes.length[some]
    now = _at_first(ground, strokes, first)
    travelled = np.zeros(len(some))
    passed = np.zeros(len(some), dtype=bool)
    active = np.arange(len(some))
    trails: list[tuple[np.ndarray, ...]] = []
    while len(active):
        here = now.take(active)
        gap = origin[active] - ground.place(here.triangle, here.weights)
        ahead = dot(gap, along[active])
        near = (travelled > length - 2 * spacing)[active] & (dot(gap, gap) < spacing[active] ** 2)
        there = near & (ahead < 1e-6 * spacing[active])
        passed[active[there]] = True
        missed = travelled[active] > length[active] + (AHEAD + 1) * spacing[active]
        going = np.flatnonzero(~there & ~missed)
        if not len(going):
            break
        step = STEP * spacing[active]
        step = np.where(near, np.minimum(ahead, step), step)[going]
        active, here = active[going], here.take(going)
        here, walked, ended, path = walk(ground, here, step, lean[active])
        trails.append((active[path.walker], path.triangle, path.weights, path.way))
        now.put(active, here)
        travelled[active] += walked
        active = active[~ended & (walked > 0)]
    columns = [np.concatenate(column) for column in zip(*trails, strict=True)]
    left = _leftward(strokes, first, ground.place(now.triangle, now.weights))
    return _Trail(*columns, left, passed)


def _at_first(ground: Ground, strokes: Strokes, first: np.ndarray) -> Walkers:
    """Walkers at first points, that go the way of their strokes."""
    triangle, along = strokes.triangle[first], strokes.member[first]
    way = dot(along, ground.x[triangle]) + 1j * dot(along, ground.y[triangle])
    weights = strokes.weights[first].copy()
    member = ground.members(triangle, weights, way)
    return Walkers(triangle.copy(), weights, member, np.ones(len(first)))


def _drawn(
    ground: Ground, strokes: Strokes, trail: _Trail, closes: np.ndarray, spacing: np.ndarray
) -> Strokes:
    """The trails of those that close, as strokes."""
    loop = np.flatnonzero(closes)
    first = strokes.start[:-1][loop]
    start = _at_first(ground, strokes, first)
    keep = closes[trail.walker]
    walker = np.concatenate([loop, trail.walker[keep]])
    order = np.argsort(walker, kind="stable")
    triangle = np.concatenate([start.triangle, trail.triangle[keep]])[order]
    weights = np.concatenate([start.weights, trail.weights[keep]])[order]
    way = np.concatenate([start.member, trail.way[keep]])[order]
    count = np.bincount(walker, minlength=len(strokes))[loop]
    return Strokes(
        points=ground.place(triangle, weights),
        start=np.concatenate([[0], np.cumsum(count)]),
        family=np.zeros(len(loop), dtype=np.int32),
        names=strokes.names,
        face=ground.face[triangle],
        triangle=triangle,
        weights=weights,
        normal=ground.shading_normal(triangle, weights),
        member=ground.in_space(triangle, way),
        spacing=np.einsum("nk,nk->n", weights, spacing[triangle]),
        width=np.ones(len(triangle)),
        opacity=np.ones(len(triangle)),
        closed=np.ones(len(loop), dtype=bool),
    )
