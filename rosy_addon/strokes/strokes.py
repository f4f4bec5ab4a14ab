"""Strokes as flat arrays, and what is done with them: taper, cuts, resampling."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ..field.frames import dot, unit

#: What is kept for each point.
COLUMNS = (
    "points",
    "face",
    "triangle",
    "weights",
    "normal",
    "member",
    "spacing",
    "width",
    "opacity",
)


@dataclass(frozen=True, eq=False)
class Strokes:
    """S polylines on a surface, n points in all, world space.

    The points of stroke s are ``start[s] .. start[s + 1] - 1``, two or more. Straight pieces lie in
    one face each.

    Attributes
    ----------
    points : (n, 3) float64 ndarray
    start : (S + 1,) int64 ndarray
    family : (S,) int32 ndarray
        Which of the lines through a point it is, from 0; for `outline` what kind it is.
    names : tuple of str
        Of the families.
    face : (n,) int32 ndarray
        In which the piece up to each point lies; of a first point, that after it.
    triangle : (n,) int32 ndarray
        Of the surface's triangles, that of the same piece; -1 where there is none.
    weights : (n, 3) float64 ndarray
        Barycentric, in it.
    normal : (n, 3) float64 ndarray
        Unit shading normals.
    member : (n, 3) float64 ndarray
        The unit member that is followed, at each point; zero for lines that follow none.
    spacing : (n,) float64 ndarray
        That was asked for there.
    width : (n,) float64 ndarray
        From 0 to 1 of the full width: the pressure.
    opacity : (n,) float64 ndarray
    closed : (S,) bool ndarray
        Whether the last point is the first again.
    loose : (S, 2) bool ndarray or None
        Whether the line would go on at its first and its last point: something hides it there, its
        surface ends, or the light lifts the pen. None if all are as long as they are to be.
    """

    points: np.ndarray
    start: np.ndarray
    family: np.ndarray
    names: tuple[str, ...]
    face: np.ndarray
    triangle: np.ndarray
    weights: np.ndarray
    normal: np.ndarray
    member: np.ndarray
    spacing: np.ndarray
    width: np.ndarray
    opacity: np.ndarray
    closed: np.ndarray
    loose: np.ndarray | None = None

    def __len__(self) -> int:
        """S."""
        return len(self.start) - 1

    @property
    def stroke(self) -> np.ndarray:
        """(n,) int64: the stroke that each point is of."""
        return np.repeat(np.arange(len(self)), np.diff(self.start))

    @property
    def arc(self) -> np.ndarray:
        """(n,) float64: how far each point is along its stroke, world space."""
        return arcs(self.points, self.start)

    @property
    def length(self) -> np.ndarray:
        """(S,) float64."""
        return self.arc[self.start[1:] - 1]

    @property
    def is_loose(self) -> np.ndarray:
        """(S, 2) bool: `loose`, also if it is None."""
        return np.zeros((len(self), 2), dtype=bool) if self.loose is None else self.loose

    def between(self, one: np.ndarray, other: np.ndarray) -> np.ndarray:
        """(n,) float64: how far pairs of points of a stroke are apart along it, world space.

        Of a closed one the shorter way round.
        """
        arc, stroke = self.arc, self.stroke
        apart = np.abs(arc[one] - arc[other])
        round_ = np.where(self.closed, self.length, np.inf)[stroke[one]] - apart
        return np.where(stroke[one] == stroke[other], np.minimum(apart, np.abs(round_)), np.inf)

    def chosen(self, strokes: np.ndarray) -> Strokes:
        """Some of the strokes, by number or by (S,) bool, in that order."""
        strokes = np.asarray(strokes)
        strokes = np.flatnonzero(strokes) if strokes.dtype == bool else strokes
        count = np.diff(self.start)[strokes]
        start = np.concatenate([[0], np.cumsum(count)])
        point = np.arange(start[-1]) + np.repeat(self.start[:-1][strokes] - start[:-1], count)
        return replace(
            self._at(point),
            start=start,
            family=self.family[strokes],
            closed=self.closed[strokes],
            loose=self.is_loose[strokes],
        )

    def _at(self, point: np.ndarray) -> Strokes:
        """Columns of the points at some of them; strokes are left as they are."""
        return replace(self, **{name: getattr(self, name)[point] for name in COLUMNS})

    def runs(
        self,
        kept: np.ndarray,
        split: np.ndarray | None = None,
        loose: np.ndarray | bool = True,
    ) -> Strokes:
        """What is left of strokes where (n,) points are kept: runs of two points or more.

        Runs also end where the (n,) numbers of `split` change. Next to points that are left out
        they are loose if these, or all, are said to be.
        """
        stroke = self.stroke
        begins = kept.copy()
        apart = stroke[1:] != stroke[:-1]
        if split is not None:
            apart |= split[1:] != split[:-1]
        begins[1:] &= ~kept[:-1] | apart
        run = np.cumsum(begins) - 1
        count = np.bincount(run[kept], minlength=int(begins.sum()))
        long = count >= 2
        point = np.flatnonzero(kept)
        point = point[long[run[point]]]
        first = np.flatnonzero(begins)[long]
        owner = stroke[first]
        ends = np.stack([first, first + count[long] - 1], axis=1)
        own = np.stack([self.start[owner], self.start[owner + 1] - 1], axis=1)
        beside = np.clip(ends + (-1, 1), 0, len(kept) - 1)
        whole = count[long] == np.diff(self.start)[owner]
        return replace(
            self._at(point),
            start=np.concatenate([[0], np.cumsum(count[long])]),
            family=self.family[owner],
            closed=self.closed[owner] & whole,
            loose=np.where(ends == own, self.is_loose[owner], (loose & ~kept)[beside]),
        )

    def tapered(self, length: float, least: float = 0.0, at: np.ndarray | None = None) -> Strokes:
        """Thinner toward their ends.

        Parameters
        ----------
        length : float
            Over which the width grows, in spacings; at most half of the stroke.
        least : float
            Width at the very ends, from 0 to 1.
        at : (S, 2) bool ndarray, optional
            At which of the ends; at both if not given.
        """
        arc, stroke = self.arc, self.stroke
        total = self.length[stroke]
        reach = np.minimum(length * self.spacing, total / 2)
        first, last = (True, True) if at is None else at[stroke].T
        to_end = np.minimum(np.where(first, arc, np.inf), np.where(last, total - arc, np.inf))
        share = np.clip(to_end / np.where(reach > 0, reach, 1), 0, 1)
        share[self.closed[stroke] | (reach <= 0)] = 1
        smooth = share * share * (3 - 2 * share)
        return replace(self, width=self.width * (least + (1 - least) * smooth))

    def densified(self, pieces: np.ndarray) -> Strokes:
        """With points put in: the piece that ends at each point is cut into (n,) equal pieces."""
        pieces = pieces.astype(np.int64)
        pieces[self.start[:-1]] = 1
        last = np.cumsum(pieces) - 1
        point = np.repeat(np.arange(len(pieces)), pieces)
        share = (np.arange(len(point)) - (last - pieces)[point]) / pieces[point]
        before = np.maximum(point - 1, 0)

        def mixed(values: np.ndarray) -> np.ndarray:
            weight = share.reshape((-1,) + (1,) * (values.ndim - 1))
            return values[before] + weight * (values[point] - values[before])

        made = self._at(point)
        # Weights of the point before are in another triangle, perhaps: they are not mixed.
        return replace(
            made,
            points=mixed(self.points),
            start=np.concatenate([[0], last[self.start[1:] - 1] + 1]),
            normal=unit(mixed(self.normal)),
            spacing=mixed(self.spacing),
            width=mixed(self.width),
            opacity=mixed(self.opacity),
            weights=np.where((share < 1)[:, None], np.nan, made.weights),
        )

    @staticmethod
    def joined(some: Strokes, more: Strokes) -> Strokes:
        """Both, the families of the second counted on from those of the first."""
        loose = np.concatenate([some.is_loose, more.is_loose])
        return Strokes(
            points=np.concatenate([some.points, more.points]),
            start=np.concatenate([some.start, more.start[1:] + some.start[-1]]),
            family=np.concatenate([some.family, more.family + len(some.names)]),
            names=some.names + more.names,
            loose=loose,
            **{
                name: np.concatenate([getattr(some, name), getattr(more, name)])
                for name in (*COLUMNS[1:], "closed")
            },
        )


def arcs(points: np.ndarray, start: np.ndarray) -> np.ndarray:
    """(n,) lengths along polylines up to each point."""
    step = np.zeros(len(points))
    delta = np.diff(points, axis=0)
    step[1:] = np.sqrt(dot(delta, delta))
    step[start[:-1]] = 0
    total = np.cumsum(step)
    return total - np.repeat(total[start[:-1]], np.diff(start))
