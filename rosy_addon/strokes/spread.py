"""Strokes evenly spread: they grow from seeds side by side until the surface is full.

After Jobard and Lefer, "Creating Evenly-Spaced Streamlines of Arbitrary Density" (1997): a stroke
begins abeam of one that is there, at the spacing asked for, and ends where it comes too near to
another. Here all of it is done on the surface; all strokes grow at once, each with two heads, and
children follow their parents while these still grow, so that fronts run out from few places and
meet along few seams. A stroke also ends where the gap beside it becomes too wide for one and too
narrow for two (as fields diverge): what begins beyond it is spaced better.

Only strokes of a family keep a distance. Of two points near each other the strokes are of one
family if their members match; which members these are elsewhere makes no difference.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..errors import RosyError
from ..field.frames import dot
from .ground import Ground
from .nearby import Nearby, Strip
from .walk import Path, Walkers, go_straight, walk

#: Share of the spacing from one sample of a stroke to the next.
STEP = 0.5

#: Shares of the spacing: how far strokes beside are looked for, and up to where a side is covered.
REACH, COVERED = 1.6, 1.5

#: Abeam is what is at most this share of the spacing ahead or behind.
ABEAM = 0.36

#: Shares of the spacing: so near strokes come that meet head on.
HEAD_ON = 0.35

#: A head that may not go a whole step tries halves of it, down to this share.
LEAST_PACE = 0.2

#: A stroke meets itself only beyond so many spacings of its length.
OWN = 2.5

#: Places that are looked at at once: bounds memory.
BLOCK = 1 << 14

#: Rounds of steps between two rounds of seeds, spacings that a parent is ahead of its children, and
#: how few heads are not worth waiting for.
PAUSE, LEAD, FEW = 3, 2.5, 64

#: Spacings along a stroke from a place where a seed was tried to the next one.
TRIED = 1.0

#: Cosine between normals, and height over distance, beyond which points are on different sheets.
FACING, HEIGHT = 0.1, 0.6


@dataclass(frozen=True)
class Rules:
    """How strokes keep their distance; lengths in spacings.

    Attributes
    ----------
    nearest : float
        Strokes of a family end before they are nearer than this.
    farthest : float
        They end where a gap beside them gets wider than this, as long as no other fits in.
    shortest : float
        Shorter ones are left out.
    longest : float
        Longer ones end.
    """

    nearest: float = 0.75
    farthest: float = 1.24
    shortest: float = 1.5
    longest: float = np.inf

    def __post_init__(self) -> None:
        if not 0.1 <= self.nearest < 1 < self.farthest:
            raise RosyError(
                f"strokes are to end between {self.nearest:g} and {self.farthest:g} spacings: the "
                "first is to be from 0.1 to below 1, the second above 1"
            )
        if not 0 <= self.shortest < self.longest:
            raise RosyError("the shortest stroke is to be shorter than the longest")


class _Table:
    """Columns that grow together."""

    def __init__(self, **columns: tuple[tuple[int, ...], type]) -> None:
        self.count = 0
        self.columns = columns
        for name, (shape, kind) in columns.items():
            setattr(self, name, np.zeros((1024, *shape), dtype=kind))

    def add(self, **values: np.ndarray) -> np.ndarray:
        """Numbers of the new rows; columns that are not given are 0."""
        size = len(next(iter(values.values())))
        first, self.count = self.count, self.count + size
        for name in self.columns:
            column = getattr(self, name)
            while self.count > len(column):
                column = np.concatenate([column, np.zeros_like(column)])
                setattr(self, name, column)
            if name in values:
                column[first : self.count] = values[name]
        return np.arange(first, self.count)


class _Samples(_Table):
    """Samples of strokes; what they are compared by lies in a row."""

    frame: np.ndarray

    @property
    def place(self) -> np.ndarray:
        return self.frame[:, 0]

    @property
    def normal(self) -> np.ndarray:
        return self.frame[:, 1]

    @property
    def way(self) -> np.ndarray:
        return self.frame[:, 2]


@dataclass(eq=False)
class _Heads:
    """The growing ends of strokes."""

    walkers: Walkers
    stroke: np.ndarray
    arc: np.ndarray
    pace: np.ndarray

    def take(self, chosen: np.ndarray) -> _Heads:
        return _Heads(
            self.walkers.take(chosen), self.stroke[chosen], self.arc[chosen], self.pace[chosen]
        )


@dataclass(eq=False)
class _Beside:
    """What is beside n new samples: gaps in spacings on the left and right, and pairs abeam."""

    gap: np.ndarray
    refused: np.ndarray
    gave_way: np.ndarray
    sample: np.ndarray
    other: np.ndarray
    own_side: np.ndarray
    other_side: np.ndarray


class Growth:
    """Strokes that grow on a ground.

    Parameters
    ----------
    ground : Ground
    spacing : (T, 3) ndarray
        At the corners of the triangles, world space.
    rules : Rules
    """

    def __init__(self, ground: Ground, spacing: np.ndarray, rules: Rules) -> None:
        self.ground, self.spacing, self.rules = ground, spacing, rules
        self.samples = _Samples(
            # Place, normal, way and member.
            frame=((4, 3), float),
            spacing=((), float),
            stroke=((), np.int32),
            arc=((), float),
            time=((), np.int32),
            alive=((), bool),
            covered=((2,), bool),
            beside=((2,), np.int32),
            triangle=((), np.int32),
            weights=((3,), float),
            own_member=((), complex),
            own_way=((), complex),
        )
        self.strokes = _Table(
            heads=((), np.int32),
            parent=((), np.int64),
            low=((), float),
            high=((), float),
            low_done=((), bool),
            high_done=((), bool),
            ends=((2,), np.int32),
            gave_way=((2,), bool),
            seed=((), np.int32),
            alive=((), bool),
            spacing=((), float),
        )
        self.busy = np.zeros(1024, dtype=np.int32)
        local = np.einsum("tk->t", spacing) / 3
        expected = float((ground.area / local**2).sum()) * ground.lines / STEP
        if not expected < 5e7:
            raise RosyError("the strokes would be too many: ask for a wider spacing")
        self.nearby = Nearby(1.01 * REACH * float(np.median(local)), int(expected))
        self.expected = expected
        self.heads = _Heads(
            Walkers(np.empty(0, np.int32), np.empty((0, 3)), np.empty(0, complex), np.empty(0)),
            np.empty(0, np.int32),
            np.empty(0),
            np.empty(0),
        )
        self.time = 0
        self.open = np.empty(0, dtype=np.int64)
        self.pieces: list[tuple[np.ndarray, ...]] = []
        self.doubtful: list[np.ndarray] = []

    # --- samples ----------------------------------------------------------------------------------

    def _spacing_at(self, walkers: Walkers) -> np.ndarray:
        return np.einsum("nk,nk->n", walkers.weights, self.spacing[walkers.triangle])

    def _add(self, walkers: Walkers, stroke: np.ndarray, arc: np.ndarray) -> np.ndarray:
        """New samples, alive, entered into the grid."""
        ground, triangle, weights = self.ground, walkers.triangle, walkers.weights
        member = ground.members(triangle, weights, walkers.member)
        member = np.where(member == 0, walkers.member, member)
        way = ground.ways(triangle, weights, member)
        place = ground.place(triangle, weights)
        normal = ground.shading_normal(triangle, weights)
        along = ground.upright(triangle, ground.in_space(triangle, way), normal)
        also = along
        if way is not member:
            also = ground.upright(triangle, ground.in_space(triangle, member), normal)
        number = self.samples.add(
            frame=np.stack([place, normal, along, also], axis=1),
            spacing=self._spacing_at(walkers),
            stroke=stroke,
            arc=arc,
            time=np.full(len(triangle), self.time),
            alive=np.ones(len(triangle), dtype=bool),
            triangle=triangle,
            weights=weights,
            own_member=member,
            own_way=way,
        )
        self.nearby.add(place)
        return number

    def _forget(self, number: np.ndarray) -> None:
        self.samples.alive[number] = False
        self.nearby.forget(number)

    def _beside(self, number: np.ndarray, nearest: float, farthest: float) -> _Beside:
        """Judge samples against all others that are near."""
        s = self.samples
        query, other = self.nearby.around(
            s.place[number], REACH * s.spacing[number], Strip(s.way[number])
        )
        own = number[query]
        apart = np.abs(s.arc.take(own) - s.arc.take(other))
        keep = s.stroke.take(own) != s.stroke.take(other)
        keep = np.flatnonzero(keep | (apart > OWN * s.spacing.take(own)))
        query, own, other = query.take(keep), own.take(keep), other.take(keep)
        here, there = s.frame.take(own, axis=0), s.frame.take(other, axis=0)
        facing = dot(here[:, 1], there[:, 1])
        keep = facing > FACING
        keep &= self.ground.same_line(here[:, 3], here[:, 1], there[:, 3], there[:, 1])
        delta = here[:, 0] - there[:, 0]
        normal = here[:, 1] + there[:, 1]
        size = np.maximum(2 + 2 * facing, 1e-9)
        height = dot(delta, normal)
        keep = np.flatnonzero(keep & (height * height <= HEIGHT**2 * dot(delta, delta) * size))
        query, own, other, facing = (values.take(keep) for values in (query, own, other, facing))
        here, there = here.take(keep, axis=0), there.take(keep, axis=0)
        flat = delta.take(keep, axis=0)
        flat -= (height / size).take(keep)[:, None] * normal.take(keep, axis=0)
        # The surface bends between the two: from the chord to the arc.
        flat *= (1 + (1 - facing) / 12)[:, None]
        square = dot(flat, flat)
        spacing = (s.spacing[own] + s.spacing[other]) / 2
        along = dot(flat, there[:, 2])
        across = np.sqrt(np.maximum(square - along * along, 0))
        ahead = np.abs(along)
        beyond = np.maximum(ahead - STEP / 2 * spacing, 0) * (max(nearest, 1e-3) / HEAD_ON)
        distance = np.sqrt(across * across + beyond * beyond)
        older = s.time[other] < s.time[own]
        older |= (s.time[other] == s.time[own]) & (s.stroke[other] < s.stroke[own])
        refused = np.zeros(len(number), dtype=bool)
        refused[query[older & (distance < nearest * spacing)]] = True

        abeam = np.abs(dot(flat, here[:, 2])) <= ABEAM * spacing
        abeam = np.flatnonzero(abeam & (across < REACH * spacing))
        query, other = query.take(abeam), other.take(abeam)
        here, there, flat = (values.take(abeam, axis=0) for values in (here, there, flat))
        share = (across / spacing).take(abeam)
        own_side = (_triple(flat, here) > 0).astype(np.intp)
        other_side = (_triple(flat, there) < 0).astype(np.intp)
        gap = np.full((len(number), 2), np.inf)
        np.minimum.at(gap, (query, own_side), share)
        gave_way = ~refused & ((gap > farthest) & (gap < COVERED)).any(axis=1)
        refused |= gave_way
        covering = share < COVERED
        return _Beside(
            gap,
            refused,
            gave_way,
            query[covering],
            other[covering],
            own_side[covering],
            other_side[covering],
        )

    def _cover(self, number: np.ndarray, beside: _Beside) -> None:
        """Sides on which there is somebody, of both."""
        accepted = ~beside.refused[beside.sample]
        s = self.samples
        own, other = number[beside.sample[accepted]], beside.other[accepted]
        s.covered[own, beside.own_side[accepted]] = True
        s.covered[other, beside.other_side[accepted]] = True
        # One of them, plus 1: for when this sample goes.
        s.beside[own, beside.own_side[accepted]] = other + 1

    # --- growing ----------------------------------------------------------------------------------

    def step(self) -> None:
        """All heads go one sample on, or end."""
        self.time += 1
        heads, rules = self.heads, self.rules
        spacing = self._spacing_at(heads.walkers)
        length = STEP * spacing * heads.pace
        now, walked, ended, path = walk(self.ground, heads.walkers, length)
        moved = walked > 0.02 * length
        chord = self.ground.place(now.triangle, now.weights) - self.ground.place(
            heads.walkers.triangle, heads.walkers.weights
        )
        # Slivers may hold a walker where it is.
        moved &= dot(chord, chord) > (0.02 * length) ** 2
        ended |= ~moved
        sign = heads.walkers.sign
        arc = heads.arc + sign * walked
        which = np.flatnonzero(moved)
        number = self._add(now.take(which), heads.stroke[which], arc[which])
        beside = self._beside(number, rules.nearest, rules.farthest)
        self._forget(number[beside.refused])
        self._cover(number, beside)
        refused = np.zeros(len(ended), dtype=bool)
        refused[which[beside.refused]] = True
        kept = np.zeros(len(ended), dtype=bool)
        kept[which[~beside.refused]] = True
        heads.pace[refused] /= 2
        ended = np.where(refused, heads.pace < LEAST_PACE, ended)
        self._note_open(number[~beside.refused])
        self._note_path(path, heads, kept)
        at_end = np.where(sign > 0, 1, 0)
        fine = which[~beside.refused]
        self.strokes.ends[heads.stroke[fine], at_end[fine]] = number[~beside.refused]
        self.strokes.gave_way[heads.stroke[which], at_end[which]] = beside.gave_way
        self._stretch(heads.stroke[kept], arc[kept])
        total = self.strokes.high[heads.stroke] - self.strokes.low[heads.stroke]
        ended |= total > rules.longest * self.strokes.spacing[heads.stroke]
        self._finish(heads.stroke[ended], sign[ended])
        back = np.flatnonzero(refused)
        now.put(back, heads.walkers.take(back))
        arc = np.where(refused, heads.arc, arc)
        going = np.flatnonzero(~ended)
        self.heads = _Heads(now.take(going), heads.stroke[going], arc[going], heads.pace[going])

    def _note_path(self, path: Path, heads: _Heads, kept: np.ndarray) -> None:
        """Keep the pieces of heads that went on; pieces of a round keep their order."""
        chosen = kept[path.walker]
        walker = path.walker[chosen]
        self.pieces.append(
            (
                heads.stroke[walker],
                heads.walkers.sign[walker].astype(np.int8),
                path.triangle[chosen],
                path.begin[chosen],
                path.weights[chosen],
                path.way[chosen],
            )
        )

    def _note_open(self, number: np.ndarray) -> None:
        """Sides of samples at which nobody is yet: twice the sample, plus 1 for the right."""
        covered = self.samples.covered[number]
        both = np.concatenate([2 * number[~covered[:, 0]], 2 * number[~covered[:, 1]] + 1])
        self.open = np.concatenate([self.open, both])

    def _stretch(self, stroke: np.ndarray, arc: np.ndarray) -> None:
        np.maximum.at(self.strokes.high, stroke, arc)
        np.minimum.at(self.strokes.low, stroke, arc)

    def _finish(self, stroke: np.ndarray, sign: np.ndarray) -> None:
        """Heads that end; strokes of which both have, and that are too short, go."""
        t = self.strokes
        t.high_done[stroke[sign > 0]] = True
        t.low_done[stroke[sign < 0]] = True
        np.subtract.at(t.heads, stroke, 1)
        done = np.unique(stroke)
        done = done[t.heads[done] == 0]
        parent = t.parent[done]
        np.subtract.at(self.busy, parent[parent >= 0], 1)
        short = done[t.high[done] - t.low[done] < self.rules.shortest * t.spacing[done]]
        self._drop(short)

    def _drop(self, short: np.ndarray) -> None:
        """Take back strokes; what they covered stays so, or they would come again."""
        if not len(short):
            return
        self.strokes.alive[short] = False
        s = self.samples
        # Their samples are among the latest.
        first = int(self.strokes.seed[short].min())
        gone = ~self.strokes.alive[s.stroke[first : s.count]]
        gone &= s.alive[first : s.count]
        number = first + np.flatnonzero(gone)
        beside = s.beside[number].ravel() - 1
        self.doubtful.append(beside[beside >= 0])
        self._forget(number)

    def resume(self, rules: Rules) -> None:
        """Have strokes that gave way go on, by other rules."""
        self.rules = rules
        t, s = self.strokes, self.samples
        done = np.stack([t.low_done[: t.count], t.high_done[: t.count]], axis=1)
        stroke, end = np.nonzero(t.gave_way[: t.count] & t.alive[: t.count, None] & done)
        number = t.ends[stroke, end]
        heads = Walkers(
            s.triangle[number],
            s.weights[number],
            s.own_member[number],
            np.where(end > 0, 1.0, -1.0),
        )
        # Whoever waited for those that had ended waits no more.
        t.parent[stroke[t.heads[stroke] == 0]] = -1
        np.add.at(t.heads, stroke, 1)
        self._join(_Heads(heads, stroke.astype(np.int32), s.arc[number], np.ones(len(stroke))))

    def rest(self) -> None:
        """End all strokes as if they had given way; nobody is sown beside them before `reopen`."""
        heads = self.heads
        end = np.where(heads.walkers.sign > 0, 1, 0)
        self.strokes.gave_way[heads.stroke, end] = True
        self._finish(heads.stroke, heads.walkers.sign)
        self.heads = heads.take(np.empty(0, dtype=np.intp))
        self.doubtful.append(np.unique(self.open >> 1))
        self.open = np.empty(0, dtype=np.int64)

    def reopen(self, rules: Rules) -> None:
        """Look again, by other rules, where no stroke came to stay."""
        self.rules = rules
        s = self.samples
        number = np.unique(np.concatenate([np.empty(0, dtype=np.int64), *self.doubtful]))
        number = number[s.alive[number]]
        self.doubtful = []
        s.covered[number] = False
        for start in range(0, len(number), BLOCK):
            part = number[start : start + BLOCK]
            beside = self._beside(part, 0.0, np.inf)
            self._cover(part, beside)
        self._note_open(number)

    # --- seeds ------------------------------------------------------------------------------------

    def sow(self, walkers: Walkers, parent: np.ndarray | None = None) -> np.ndarray:
        """Begin strokes; True for those that have room there.

        `parent` is twice the stroke, plus 1 for its right side; -1 for those without.
        """
        count = len(walkers)
        parent = np.full(count, -1) if parent is None else parent
        if not count:
            return np.zeros(0, dtype=bool)
        self.time += 1
        spacing = self._spacing_at(walkers)
        stroke = self.strokes.add(
            heads=np.full(count, 2),
            parent=parent,
            alive=np.ones(count, dtype=bool),
            spacing=spacing,
        )
        if 2 * self.strokes.count > len(self.busy):
            self.busy = np.concatenate(
                [self.busy, np.zeros(2 * self.strokes.count, dtype=np.int32)]
            )
        number = self._add(walkers, stroke, np.zeros(count))
        self.strokes.seed[stroke] = number
        self.strokes.ends[stroke] = number[:, None]
        beside = self._beside(number, self.rules.nearest, self.rules.farthest)
        self._forget(number[beside.refused])
        self.strokes.alive[stroke[beside.refused]] = False
        self._cover(number, beside)
        fits = ~beside.refused
        self._note_open(number[fits])
        np.add.at(self.busy, parent[fits & (parent >= 0)], 1)
        some = np.flatnonzero(fits)
        for sign in (1.0, -1.0):
            ahead = walkers.take(some)
            ahead.sign = np.full(len(some), sign)
            own = stroke[some].astype(np.int32)
            self._join(_Heads(ahead, own, np.zeros(len(some)), np.ones(len(some))))
        return fits

    def _join(self, heads: _Heads) -> None:
        mine = self.heads
        self.heads = _Heads(
            Walkers.joined(mine.walkers, heads.walkers),
            np.concatenate([mine.stroke, heads.stroke]),
            np.concatenate([mine.arc, heads.arc]),
            np.concatenate([mine.pace, heads.pace]),
        )

    def sow_beside(self) -> int:
        """Begin strokes beside those that are there, one at a time for each side of each."""
        s, t = self.samples, self.strokes
        number, side = self.open >> 1, self.open & 1
        keep = s.alive[number] & ~s.covered[number, side]
        self.open, number, side = self.open[keep], number[keep], side[keep]
        stroke = s.stroke[number]
        free = self.busy[2 * stroke + side] == 0
        arc, lead = s.arc[number], LEAD * s.spacing[number]
        free &= (arc <= t.high[stroke] - lead) | t.high_done[stroke]
        free &= (arc >= t.low[stroke] + lead) | t.low_done[stroke]
        number, side = number[free], side[free]
        if not len(number):
            return 0
        number, side, near, near_side = self._middles(number, side)
        s.covered[near, near_side] = True
        self.doubtful.append(near)
        walkers, fits = self._abeam(number, side)
        parent = 2 * s.stroke[number].astype(np.int64) + side
        return int(self.sow(walkers.take(np.flatnonzero(fits)), parent[fits]).sum())

    def _middles(self, number: np.ndarray, side: np.ndarray) -> tuple[np.ndarray, ...]:
        """Of the sides of each stroke, the middle of the longest run that is open.

        Samples and sides; then the same of all that are near them: where there is no room for a
        seed, there is hardly any beside it.
        """
        s = self.samples
        arc, key = s.arc[number], 2 * s.stroke[number].astype(np.int64) + side
        order = np.lexsort((arc, key))
        number, side, arc, key = number[order], side[order], arc[order], key[order]
        new = np.ones(len(key), dtype=bool)
        new[1:] = (key[1:] != key[:-1]) | (np.diff(arc) > 1.6 * STEP * s.spacing[number[1:]])
        first = np.flatnonzero(new)
        length = np.diff(np.append(first, len(key)))
        best = np.lexsort((-length, key[first]))
        which = np.unique(key[first][best], return_index=True)[1]
        run = best[which]
        middle = first[run] + length[run] // 2
        chosen = middle[np.searchsorted(key[middle], key)]
        near = np.abs(arc - arc[chosen]) <= TRIED * s.spacing[number]
        return number[middle], side[middle], number[near], side[near]

    def _abeam(self, number: np.ndarray, side: np.ndarray) -> tuple[Walkers, np.ndarray]:
        """Places for seeds beside samples, and whether there is room."""
        share = np.ones(len(number))
        walkers, fits = self._beside_place(number, side, share)
        room = self._room(number, walkers, fits)
        # Strokes that fit between two that are there share the room.
        again = np.flatnonzero(np.isfinite(room))
        whole = 1 + room[again]
        closer = whole / np.where(whole > 2.5, 3, 2)
        moved, fits[again] = self._beside_place(number[again], side[again], closer)
        walkers.put(again, moved)
        return walkers, fits

    def _beside_place(
        self, number: np.ndarray, side: np.ndarray, share: np.ndarray
    ) -> tuple[Walkers, np.ndarray]:
        """Places so many spacings beside samples, and whether the surface and the field get there."""
        s = self.samples
        start = Walkers(
            s.triangle[number], s.weights[number], s.own_member[number], np.ones(len(number))
        )
        way = s.own_way[number] * np.where(side == 0, 1j, -1j)
        wanted = share * s.spacing[number]
        walkers, walked = go_straight(self.ground, start, way, wanted)
        return walkers, (walked >= 0.999 * wanted) & (walkers.member != 0)

    def _room(self, number: np.ndarray, walkers: Walkers, fits: np.ndarray) -> np.ndarray:
        """(n,) gap from places to the next stroke on the side away from a sample, in spacings."""
        s = self.samples
        room = np.full(len(number), np.inf)
        which = np.flatnonzero(fits)
        before = s.count
        probes = self._probe(walkers.take(which))
        toward = s.place[number[which]] - s.place[probes]
        left = dot(toward, np.cross(s.normal[probes], s.way[probes])) > 0
        gap = self._beside(probes, 0.0, np.inf).gap
        room[which] = gap[np.arange(len(which)), left.astype(np.intp)]
        s.count = before
        return room

    def is_empty(self, walkers: Walkers) -> np.ndarray:
        """(n,) bool: whether no stroke of their family covers a place."""
        found = np.zeros(len(walkers), dtype=bool)
        for start in range(0, len(walkers), BLOCK):
            part = np.arange(start, min(start + BLOCK, len(walkers)))
            before = self.samples.count
            probes = self._probe(walkers.take(part))
            beside = self._beside(probes, COVERED, np.inf)
            found[part] = ~beside.refused
            self.samples.count = before
        return found

    def _probe(self, walkers: Walkers) -> np.ndarray:
        """Samples that are not in the grid; to be taken off the end of the table again."""
        nearby, self.nearby = self.nearby, _Nowhere()
        try:
            return self._add(walkers, np.full(len(walkers), -1, np.int32), np.zeros(len(walkers)))
        finally:
            self.nearby = nearby


def _triple(flat: np.ndarray, frame: np.ndarray) -> np.ndarray:
    """(n,) how far to the left of frames vectors point."""
    return dot(flat, np.cross(frame[:, 1], frame[:, 2]))


class _Nowhere:
    """A grid that keeps nothing."""

    def add(self, points: np.ndarray) -> None:
        return None
