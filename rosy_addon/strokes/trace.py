"""From a field on a surface to strokes: where they begin, until when, and as which arrays."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..errors import RosyError
from ..field.frames import dot
from ..progress import Progress, Work, drain
from ..projection.gbuffer import Body
from .apart import kept_apart
from .families import label_families
from .ground import lay_ground, nearest_member, on_corners
from .loops import closed_up
from .poles import around_singularities
from .spread import FEW, PAUSE, Growth, Rules
from .strokes import Strokes
from .walk import Walkers

#: Probes for each square of the spacing, that find where the surface is still empty.
PROBES = 0.35

#: Spacings between seeds that are sown at once: at first so many, then half as many each time.
WIDEST, NARROWEST = 96.0, 6.0

#: Share of the heads that are not waited for when new seeds are sown.
STRAGGLERS = 0.1

#: Strokes are to be longer than the shortest by so much at first, and in between; what is left of
#: the gaps in the end is filled with strokes that are nearer by so much than the nearest.
LONG, MIDDLE, TIGHT = 3.3, 1.7, 0.85

#: Steps that strokes around singularities go at first, and shares of the spacing that they are apart
#: until then, at least.
AWAY, CROWDED = 6, 0.6


def trace(body: Body, spacing: np.ndarray | float, **more) -> Strokes:
    """Cover a surface with strokes; see `tracing`."""
    return drain(tracing(body, spacing, **more))


def tracing(
    body: Body,
    spacing: np.ndarray | float,
    *,
    rules: Rules | None = None,
    display: str = "smooth",
    cross_creases: bool = False,
) -> Work[Strokes]:
    """Cover a surface with evenly spaced strokes along its field.

    Parameters
    ----------
    body : Body
        In world space.
    spacing : float, or (V,) or (F,) array_like
        Between strokes of a family, world space; everywhere, or at vertices or faces.
    rules : Rules, optional
    display : {"smooth", "flat"}
    cross_creases : bool

    Returns
    -------
    Strokes

    Raises
    ------
    RosyError
        If there is no field, or the spacing is not above 0, or so small that millions would come.
    """
    ground = lay_ground(body, display=display, cross_creases=cross_creases)
    corners = on_corners(ground, spacing, body.surface.name)
    if not (np.isfinite(corners).all() and (corners > 0).all()):
        raise RosyError(f"{body.surface.name}: the spacing of strokes is to be above 0")
    growth = Growth(ground, corners, rules or Rules())
    rules = growth.rules
    yield from growing(growth)
    drawn = closed_up(ground, collect(growth), corners)
    drawn = kept_apart(ground, drawn, rules.shortest)
    return label_families(drawn, ground)


def growing(growth: Growth) -> Work[None]:
    """Sow, and let grow, until there is no room left."""
    label = "growing strokes"
    rules = growth.rules
    growth.rules = replace(rules, nearest=min(CROWDED, rules.nearest), farthest=np.inf)
    growth.sow(around_singularities(growth.ground, growth.spacing))
    for _ in range(AWAY):
        if len(growth.heads.stroke):
            growth.step()
    growth.rest()
    walkers = probes(growth)
    walkers = walkers.take(empty(growth, walkers))
    apart = WIDEST
    growth.rules = replace(rules, shortest=LONG * rules.shortest)
    while len(walkers):
        growth.sow(walkers.take(scattered(growth, walkers, apart)))
        yield from _until_grown(growth, label, STRAGGLERS)
        if apart <= NARROWEST:
            break
        apart /= 4
        walkers = walkers.take(empty(growth, walkers))
    growth.reopen(replace(rules, shortest=MIDDLE * rules.shortest))
    yield from _until_grown(growth, label, STRAGGLERS)
    last = replace(rules, nearest=TIGHT * rules.nearest, farthest=np.inf)
    growth.resume(replace(last, shortest=MIDDLE * rules.shortest))
    yield from _until_grown(growth, label, STRAGGLERS)
    growth.reopen(last)
    yield from _until_grown(growth, label)


def _until_grown(growth: Growth, label: str, stragglers: float = 0.0) -> Work[None]:
    """Step and sow, until but a share of the heads are left of as many as there were at most."""
    rounds, most = 0, 0
    while True:
        if rounds % PAUSE == 0 or len(growth.heads.stroke) < FEW:
            sown = growth.sow_beside()
            if not sown and not len(growth.heads.stroke):
                if not len(growth.open):
                    return
                if not growth.sow_beside() and not growth.sow_beside():
                    return
            share = growth.samples.count / max(growth.expected, 1)
            yield Progress(min(share, 0.99), label)
        heads = len(growth.heads.stroke)
        most = max(most, heads)
        if heads < stragglers * most:
            return
        if heads:
            growth.step()
        rounds += 1


def probes(growth: Growth) -> Walkers:
    """Places spread evenly over the ground, with each of the lines through them."""
    ground = growth.ground
    spacing = growth.spacing.mean(axis=1)
    wanted = np.cumsum(PROBES * ground.area / spacing**2 * (ground.z != 0).any(axis=1))
    count = int(np.ceil(wanted[-1]))
    triangle = np.searchsorted(wanted, (np.arange(count) + 0.5) * wanted[-1] / count)
    triangle = np.minimum(triangle, len(wanted) - 1).astype(np.int32)
    # Low discrepancy within triangles: multiples of irrational numbers.
    u = np.modf((np.arange(count) + 1) * 0.7548776662466927)[0]
    v = np.modf((np.arange(count) + 1) * 0.5698402909980532)[0]
    fold = u + v > 1
    u, v = np.where(fold, 1 - u, u), np.where(fold, 1 - v, v)
    weights = np.stack([1 - u - v, u, v], axis=1)
    z = np.einsum("nk,nk->n", weights, ground.z[triangle])
    first = nearest_member(np.ones(count, dtype=complex), z, ground.degree)
    turns = np.exp(2j * np.pi * np.arange(ground.lines) / ground.degree)
    walkers = Walkers(
        np.repeat(triangle, ground.lines),
        np.repeat(weights, ground.lines, axis=0),
        (first[:, None] * turns).ravel(),
        np.ones(count * ground.lines),
    )
    return walkers.take(np.flatnonzero(walkers.member != 0))


def empty(growth: Growth, walkers: Walkers) -> np.ndarray:
    """Numbers of those that have no stroke of their family near."""
    if not len(walkers):
        return np.empty(0, dtype=np.intp)
    return np.flatnonzero(growth.is_empty(walkers))


def scattered(growth: Growth, walkers: Walkers, apart: float) -> np.ndarray:
    """Numbers of some that are at least about so many spacings apart; of all lines at a place."""
    if not len(walkers):
        return np.empty(0, dtype=np.intp)
    place = growth.ground.place(walkers.triangle, walkers.weights)
    low, size = place.min(axis=0), apart * float(np.median(growth.spacing))
    # As few cells as can be, and of each the place nearest to its middle.
    count = np.maximum(np.ceil(np.ptp(place, axis=0) / size), 1)
    within = (place - low) * count / np.maximum(np.ptp(place, axis=0), 1e-300)
    cell = np.minimum(np.floor(within), count - 1)
    off = within - cell - 0.5
    number = (cell[:, 0] * count[1] + cell[:, 1]) * count[2] + cell[:, 2]
    order = np.lexsort((np.round(dot(off, off), 9), number))
    first = order[np.unique(number[order], return_index=True)[1]]
    which = np.searchsorted(number[first], number)
    same = place - place[first[which]]
    return np.flatnonzero(dot(same, same) == 0)


def collect(growth: Growth) -> Strokes:
    """The strokes that grew, as arrays; their families are not numbered."""
    ground, s = growth.ground, growth.samples
    stroke, sign, triangle, begin, weights, way = (
        np.concatenate(column) for column in zip(*growth.pieces, strict=True)
    )
    alive = growth.strokes.alive[: growth.strokes.count]
    keep = np.flatnonzero(alive[stroke])
    stroke, sign, triangle, begin, weights, way = (
        column[keep] for column in (stroke, sign, triangle, begin, weights, way)
    )
    # A point is the end of the piece before it: of a backward half, that where a head began it.
    # The first point is the end of the last piece backward, or the seed.
    back = np.flatnonzero(sign < 0)
    used = np.unique(stroke)
    last = np.full(growth.strokes.count, -1)
    last[stroke[back]] = back
    last = last[used]
    seed, own = growth.strokes.seed[used], last[:, None] < 0
    first_triangle = np.where(last < 0, s.triangle[seed], triangle[last])
    first_weights = np.where(own, s.weights[seed], weights[last])
    first_way = np.where(last < 0, s.own_way[seed], -way[last])
    weights[back] = begin[back]
    place = sign * (np.arange(len(stroke)) + 1.0)
    order = np.lexsort(
        (
            np.concatenate([place, np.where(last < 0, 0.0, -last - 1.5)]),
            np.concatenate([stroke, used]),
        )
    )
    stroke = np.concatenate([stroke, used])[order]
    triangle = np.concatenate([triangle, first_triangle])[order]
    weights = np.concatenate([weights, first_weights])[order]
    way = np.concatenate([way * sign, first_way])[order]
    number = np.searchsorted(used, stroke)
    points = ground.place(triangle, weights)
    start = np.concatenate([[0], np.cumsum(np.bincount(number, minlength=len(used)))])
    spacing = np.einsum("nk,nk->n", weights, growth.spacing[triangle])
    return Strokes(
        points=points,
        start=start,
        family=np.zeros(len(used), dtype=np.int32),
        names=("family 1",),
        face=ground.face[triangle],
        triangle=triangle.astype(np.int32),
        weights=weights,
        normal=ground.shading_normal(triangle, weights),
        member=ground.in_space(triangle, way),
        spacing=spacing,
        width=np.ones(len(points)),
        opacity=np.ones(len(points)),
        closed=np.zeros(len(used), dtype=bool),
    )
