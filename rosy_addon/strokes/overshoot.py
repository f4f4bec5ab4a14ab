"""Strokes that run on past where something ends them, as lines do that are drawn with a swing."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from ..field.frames import unit
from ..projection.camera import Camera
from ..projection.gbuffer import Body
from .ground import Ground
from .seen import LOOK, STEEPEST, densified, on_screen, pixel_size, sight
from .strokes import COLUMNS, Strokes, arcs

#: Share of what is asked for by which each end runs on at least.
LEAST = 0.3

#: Pixels before an end at which a stroke goes straight on, and for how many its direction is
#: taken before; at most so large a share of it each.
BACK, BACK_SHARE = 6.0, 0.25

#: Strokes run on at either end by at most so large a share of what they are long.
LONGEST = 0.5

#: Barycentric coordinates below this are 0: the point is on an edge.
ON_EDGE = 1e-9


def loose_at_edges(strokes: Strokes, ground: Ground) -> Strokes:
    """Strokes as they were traced, loose where their surface ends and nowhere else.

    Parameters
    ----------
    strokes : Strokes
        With weights at their ends.
    ground : Ground
        That they were traced on: borders end it, and creases that strokes do not cross.
    """
    ends = np.stack([strokes.start[:-1], strokes.start[1:] - 1], axis=1)
    on_edge = strokes.weights[ends] < ON_EDGE
    ended = (on_edge & (ground.across[strokes.triangle[ends]] < 0)).any(axis=2)
    return replace(strokes, loose=ended & ~strokes.closed[:, None])


def overshot(
    strokes: Strokes, camera: Camera, pixels: float, bodies: Sequence[Body] | None = None
) -> Strokes:
    """Let loose ends run on, straight ahead, some farther than others.

    Lines that follow no member stay as they are.

    Parameters
    ----------
    strokes : Strokes
        As `seen` leaves them.
    camera : Camera
    pixels : float
        By which ends run on at most, at least by `LEAST` of it.
    bodies : sequence of Body, optional
        Straight ahead is so in the picture: at the depth of the end, or on what the camera sees
        there of these if the surface goes on or something else is in front. If not given it is
        straight ahead in space.

    Returns
    -------
    Strokes
        With points at most `LOOK` pixels apart where they run on, also outside the frame.
    """
    if bodies is None:
        strokes = densified(strokes, camera)
    flat = np.nan_to_num(on_screen(strokes.points, camera)[0])
    arc = arcs(np.column_stack([flat, np.zeros(len(flat))]), strokes.start)
    ends = np.stack([strokes.start[:-1], strokes.start[1:] - 1], axis=1)
    loose = strokes.is_loose & strokes.member[ends].any(axis=2)
    stroke, side = np.nonzero(loose & (arc[ends[:, 1]] > 0)[:, None])
    end, total = ends[stroke, side], arc[ends[stroke, 1]]
    ahead = _in_space if bodies is None else _in_picture
    leave, origin, way = ahead(strokes, arc, end, np.minimum(BACK, BACK_SHARE * total), camera)
    length = np.minimum(pixels * _shares(len(strokes))[stroke, side], LONGEST * total)
    length = length + np.abs(arc[end] - arc[leave])
    goes = way.any(axis=1) & np.isfinite(way).all(axis=1)
    tails = _Tails(*(column[goes] for column in (leave, side, origin, way, length)))
    longer, along = _with_tails(strokes, tails)
    return longer if bodies is None else _on_what_is_there(longer, along, bodies, camera)


def _in_space(
    strokes: Strokes, arc: np.ndarray, end: np.ndarray, back: np.ndarray, camera: Camera
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Of (k,) ends the points that they are left at, where that is, and which way for a pixel.

    The direction is that over the last (k,) pixels before.
    """
    before, origin = _before_end(arc, strokes, end, back), strokes.points[end]
    way = pixel_size(origin, camera)[:, None] * unit(origin - strokes.points[before])
    return end, origin, way


def _in_picture(
    strokes: Strokes, arc: np.ndarray, end: np.ndarray, back: np.ndarray, camera: Camera
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The same in the plane of the ends that is parallel to the picture.

    They are left so many pixels early: right at a silhouette all lines turn along it.
    """
    leave = _before_end(arc, strokes, end, back)
    before = _before_end(arc, strokes, end, back + np.abs(arc[end] - arc[leave]))
    here, depth = on_screen(strokes.points[leave], camera)
    there, _ = on_screen(strokes.points[before], camera)
    _, far = on_screen(strokes.points[end], camera)
    origin = _at_depth(strokes.points[leave], depth, far, camera)
    return leave, origin, _across(unit(here - there), far, camera)


def _before_end(arc: np.ndarray, strokes: Strokes, end: np.ndarray, far: np.ndarray) -> np.ndarray:
    """(k,) points of strokes that are so far along them from first or last ones, or farther."""
    stroke = strokes.stroke[end]
    first, last = strokes.start[stroke], strokes.start[stroke + 1] - 1
    span = 2 * arc.max(initial=0) + 1
    key = arc + strokes.stroke * span
    after = np.searchsorted(key, far + stroke * span, side="left")
    before = np.searchsorted(key, arc[last] - far + stroke * span, side="right") - 1
    return np.clip(np.where(end == first, after, before), first, last)


def _at_depth(
    points: np.ndarray, depth: np.ndarray, wanted: np.ndarray, camera: Camera
) -> np.ndarray:
    """(k, 3) points moved along their rays from one depth to another."""
    toward = camera.toward(points)
    return points + ((depth - wanted) / (toward @ camera.view[2, :3]))[:, None] * toward


def _across(ways: np.ndarray, depth: np.ndarray, camera: Camera) -> np.ndarray:
    """(k, 3) world space: steps in the picture, in pixels, at depths along the camera's axis."""
    steps = (ways * 2 / (camera.width, camera.height)) @ camera.across_axis.T
    if camera.is_perspective:
        steps *= depth[:, None]
    return steps @ camera.view[:2, :3]


def _shares(count: int) -> np.ndarray:
    """(count, 2) float64 from `LEAST` to 1, scattered: a hash of the number of each end."""
    bits = np.arange(1, 2 * count + 1, dtype=np.uint64)
    for shift, factor in ((32, 0x9E3779B97F4A7C15), (29, 0xBF58476D1CE4E5B9), (32, 1)):
        bits = (bits ^ (bits >> np.uint64(shift))) * np.uint64(factor)
    share = (bits >> np.uint64(11)).astype(np.float64) / 2.0**53
    return (LEAST + (1 - LEAST) * share).reshape(count, 2)


class _Tails(NamedTuple):
    """Straight lines in place of the ends of strokes.

    Attributes
    ----------
    leave : (k,) int64 ndarray
        Points that they start from.
    side : (k,) int64 ndarray
        0 for the first points of strokes, 1 for the last ones.
    origin : (k, 3) float64 ndarray
        World space: that point, or one that is at the same place in the picture.
    way : (k, 3) float64 ndarray
        World space, for each pixel.
    length : (k,) float64 ndarray
        In pixels.
    """

    leave: np.ndarray
    side: np.ndarray
    origin: np.ndarray
    way: np.ndarray
    length: np.ndarray


def _with_tails(strokes: Strokes, tails: _Tails) -> tuple[Strokes, np.ndarray]:
    """Strokes, and for each point by how many pixels it is along a tail; 0 for those that stay."""
    low, high = strokes.start[:-1].copy(), strokes.start[1:] - 1
    whose, first = strokes.stroke[tails.leave], tails.side == 0
    low[whose[first]], high[whose[~first]] = tails.leave[first], tails.leave[~first]
    own = np.arange(len(strokes.points))
    own = own[(own >= low[strokes.stroke]) & (own <= high[strokes.stroke])]
    count = np.ceil(tails.length / LOOK).astype(np.int64)
    tail = np.repeat(np.arange(len(count)), count)
    step = np.arange(len(tail)) - np.repeat(np.cumsum(count) - count, count) + 1
    place = np.concatenate([own, tails.leave[tail] + np.where(first[tail], -step, step)])
    point = np.concatenate([own, tails.leave[tail]])
    ahead = (tails.length / count)[tail] * step
    along = np.concatenate([np.zeros(len(own)), ahead])
    points = np.concatenate(
        [strokes.points[own], tails.origin[tail] + ahead[:, None] * tails.way[tail]]
    )
    order = np.lexsort((place, strokes.stroke[point]))
    point, along = point[order], along[order]
    columns = {name: getattr(strokes, name)[point] for name in COLUMNS}
    columns["points"] = points[order]
    columns["weights"] = np.where(along[:, None] > 0, np.nan, columns["weights"])
    size = np.bincount(strokes.stroke[point], minlength=len(strokes))
    return replace(strokes, **columns, start=np.concatenate([[0], np.cumsum(size)])), along


def _on_what_is_there(
    strokes: Strokes, along: np.ndarray, bodies: Sequence[Body], camera: Camera
) -> Strokes:
    """Points past ends moved along their rays onto what is in front, or a little behind, there."""
    tail = np.flatnonzero(along > 0)
    points = strokes.points[tail]
    pixels, depth = on_screen(points, camera)
    size = np.array([camera.width, camera.height])
    column, row = np.clip(np.nan_to_num(pixels), 0, size - 1).astype(np.int64).T
    there = sight(bodies, camera)
    wanted = there.depth[row, column]
    slope = STEEPEST * (along[tail] + BACK) * pixel_size(points, camera)
    goes = wanted < depth + slope
    tail = tail[goes]
    moved, normal = strokes.points.copy(), strokes.normal.copy()
    moved[tail] = _at_depth(points[goes], depth[goes], wanted[goes], camera)
    normal[tail] = there.normal[there.triangle[row, column][goes]] @ camera.view[:3, :3]
    return replace(strokes, points=moved, normal=normal)
