"""`Strokes`: polylines on a surface as flat arrays, with methods to select, cut, taper and divide them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..field.blocks import concatenated_ranges
from ..field.formats.polygons import offsets_from_sizes
from ..field.frames import dot, normalize

#: The attributes of `Strokes` that have a row for each point.
POINT_COLUMNS = ("points", "face", "triangle", "weights", "normal", "member", "spacing", "width")


@dataclass(frozen=True, eq=False)
class Strokes:
    """S polylines on a surface with n points in all, in world space.

    The points of stroke s are ``start[s] .. start[s + 1] - 1``, two or more. Each segment lies in
    one face.

    Attributes
    ----------
    points : (n, 3) float64 ndarray
        Points of all strokes, one stroke after another.
    start : (S + 1,) int64 ndarray
        Index of the first point of each stroke, then n.
    family : (S,) int32 ndarray
        Family of each stroke, from 0. There is one family for each line direction of the field. In
        `outline_strokes`, the families are silhouettes, creases and borders.
    names : tuple of str
        Names of the families.
    face : (n,) int32 ndarray
        Face in which the segment that ends at each point lies. The first point of a stroke has the face of
        the segment that starts there.
    triangle : (n,) int32 ndarray
        Triangle of the surface in which this segment lies.
    weights : (n, 3) float64 ndarray
        Barycentric coordinates of the points in these triangles; NaN at points that were added after tracing.
    normal : (n, 3) float64 ndarray
        Unit shading normals.
    member : (n, 3) float64 ndarray
        Unit direction of the stroke along the field; zero for outlines, which do not follow a field.
    spacing : (n,) float64 ndarray
        Required spacing, in world space.
    width : (n,) float64 ndarray
        Width as a fraction of the full width, from 0 to 1.
    closed : (S,) bool ndarray
        Whether the last point is the same as the first.
    free_ends : (S, 2) bool ndarray or None
        Whether the first and the last point are free ends, at which the stroke may be extended: it is
        occluded there, or the surface or the shaded area ends. None means that no end is free.
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
    closed: np.ndarray
    free_ends: np.ndarray | None = None

    def __len__(self) -> int:
        """Return S, the number of strokes."""
        return len(self.start) - 1

    @property
    def stroke(self) -> np.ndarray:
        """(n,) int64: index of the stroke to which each point belongs."""
        return np.repeat(np.arange(len(self)), np.diff(self.start))

    @property
    def arc(self) -> np.ndarray:
        """(n,) float64: arc length from the start of the stroke to each point, in world space."""
        return arc_lengths(self.points, self.start)

    @property
    def length(self) -> np.ndarray:
        """(S,) float64: lengths of the strokes, in world space."""
        return self.arc[self.start[1:] - 1]

    @property
    def free_end_mask(self) -> np.ndarray:
        """(S, 2) bool: `free_ends`, or all false if it is None."""
        return np.zeros((len(self), 2), dtype=bool) if self.free_ends is None else self.free_ends

    def select(self, selection: np.ndarray) -> Strokes:
        """Return some of the strokes.

        `selection` is an array of indices of strokes, whose order is kept, or an (S,) bool mask.
        """
        selection = np.asarray(selection)
        selection = np.flatnonzero(selection) if selection.dtype == bool else selection
        count = np.diff(self.start)[selection]
        return replace(
            self.take_points(concatenated_ranges(self.start[:-1][selection], count)),
            start=offsets_from_sizes(count),
            family=self.family[selection],
            closed=self.closed[selection],
            free_ends=self.free_end_mask[selection],
        )

    def take_points(self, point: np.ndarray) -> Strokes:
        """Return a copy with only the points at the indices `point`.

        Attributes for each stroke, such as `start`, are not changed. The caller has to replace them.
        """
        return replace(self, **{name: getattr(self, name)[point] for name in POINT_COLUMNS})

    def between(self, after: np.ndarray, fraction: np.ndarray) -> Strokes:
        """Return a copy with m interpolated points on segments.

        Attributes for each stroke, such as `start`, are not changed. The caller has to replace them.
        The segments end at the points with the indices `after`, (m,). `fraction`, (m,), is the position of
        the new point on its segment, from 0 to 1. Interpolated normals are not of unit length. Weights are
        NaN where the fraction is below 1, as the two ends of a segment may be in different triangles.
        """
        before = np.maximum(after - 1, 0)
        result = self.take_points(after)
        for name in ("points", "normal", "spacing", "width"):
            values, previous = getattr(result, name), getattr(self, name)[before]
            values -= previous
            values *= fraction.reshape((-1,) + (1,) * (values.ndim - 1))
            values += previous
        result.weights[fraction < 1] = np.nan
        return result

    def runs_where(
        self,
        kept: np.ndarray,
        split_labels: np.ndarray | None = None,
        free_at_removed: np.ndarray | bool = True,
    ) -> Strokes:
        """Cut strokes into runs of two or more consecutive points that are kept.

        Parameters
        ----------
        kept : (n,) bool ndarray
            Points that are kept.
        split_labels : (n,) ndarray, optional
            Strokes are also split between points with different labels.
        free_at_removed : bool or (n,) bool ndarray
            Whether the ends of runs next to a removed point become free ends: one value for all, or a value
            for each point, of which only the values of removed points are used.

        Returns
        -------
        Strokes
            A stroke for each run. A closed stroke stays closed only if all of it is kept.
        """
        stroke = self.stroke
        starts_run = kept.copy()
        boundary = stroke[1:] != stroke[:-1]
        if split_labels is not None:
            boundary |= split_labels[1:] != split_labels[:-1]
        starts_run[1:] &= ~kept[:-1] | boundary
        run = np.cumsum(starts_run) - 1
        count = np.bincount(run[kept], minlength=int(starts_run.sum()))
        is_long = count >= 2
        point = np.flatnonzero(kept)
        point = point[is_long[run[point]]]
        first = np.flatnonzero(starts_run)[is_long]
        owner = stroke[first]
        ends = np.stack([first, first + count[is_long] - 1], axis=1)
        stroke_ends = np.stack([self.start[owner], self.start[owner + 1] - 1], axis=1)
        outside = np.clip(ends + (-1, 1), 0, len(kept) - 1)
        free = free_at_removed & ~kept
        is_whole = count[is_long] == np.diff(self.start)[owner]
        return replace(
            self.take_points(point),
            start=offsets_from_sizes(count[is_long]),
            family=self.family[owner],
            closed=self.closed[owner] & is_whole,
            free_ends=np.where(ends == stroke_ends, self.free_end_mask[owner], free[outside]),
        )

    def tapered(
        self, length: float, min_width: float = 0.0, ends: np.ndarray | None = None
    ) -> Strokes:
        """Return the strokes with widths that decrease toward their ends.

        Closed strokes are not tapered.

        Parameters
        ----------
        length : float
            Length of the taper in spacings. It is limited to half of the length of the stroke.
        min_width : float
            Factor by which the width at the very ends is multiplied, from 0 to 1.
        ends : (S, 2) bool ndarray, optional
            Whether the first and the last end of each stroke is tapered; by default, all ends are.
        """
        arc, stroke = self.arc, self.stroke
        total = self.length[stroke]
        taper_length = np.minimum(length * self.spacing, total / 2)
        taper_first, taper_last = (True, True) if ends is None else ends[stroke].T
        from_first = np.where(taper_first, arc, np.inf)
        end_distance = np.minimum(from_first, np.where(taper_last, total - arc, np.inf))
        fraction = np.clip(end_distance / np.where(taper_length > 0, taper_length, 1), 0, 1)
        fraction[self.closed[stroke] | (taper_length <= 0)] = 1
        smooth = fraction * fraction * (3 - 2 * fraction)
        return replace(self, width=self.width * (min_width + (1 - min_width) * smooth))

    def subdivided(self, counts: np.ndarray, first: int = 0, stop: int | None = None) -> Strokes:
        """Divide segments of strokes into parts of equal length.

        Parameters
        ----------
        counts : (n,) ndarray
            For each point, the number of parts of the segment that ends there. Values at the first points of
            strokes are ignored.
        first, stop : int
            Return only the strokes ``first .. stop - 1``; by default, all strokes are returned.

        Returns
        -------
        Strokes
            The weights of added points are NaN.
        """
        stop = len(self) if stop is None else stop
        start = self.start[first : stop + 1]
        counts = counts[start[0] : start[-1]].astype(np.int64)
        counts[start[:-1] - start[0]] = 1
        end = offsets_from_sizes(counts)
        row = np.repeat(np.arange(len(counts)), counts)
        fraction = (np.arange(len(row)) - (end[:-1] - 1)[row]) / counts[row]
        divided = self.between(row + start[0], fraction)
        return replace(
            divided,
            start=end[start - start[0]],
            family=self.family[first:stop],
            closed=self.closed[first:stop],
            free_ends=self.free_end_mask[first:stop],
            normal=normalize(divided.normal),
        )

    @staticmethod
    def join(blocks: Sequence[Strokes]) -> Strokes:
        """Return the strokes of several sets with the same families, one set after another."""
        offsets = offsets_from_sizes([len(block.points) for block in blocks])
        names = (*POINT_COLUMNS, "family", "closed")
        columns = {
            name: np.concatenate([getattr(block, name) for block in blocks]) for name in names
        }
        start = [block.start[:-1] + offset for block, offset in zip(blocks, offsets, strict=False)]
        return replace(
            blocks[0],
            **columns,
            start=np.concatenate([*start, offsets[-1:]]),
            free_ends=np.concatenate([block.free_end_mask for block in blocks]),
        )

    @staticmethod
    def concatenate(first: Strokes, second: Strokes) -> Strokes:
        """Return the strokes of both sets. The families of the second set are numbered after the others."""
        renumbered = replace(second, family=second.family + np.int32(len(first.names)))
        return replace(Strokes.join([first, renumbered]), names=first.names + second.names)


def arc_lengths(points: np.ndarray, start: np.ndarray) -> np.ndarray:
    """Return (n,) float64: the length of the polyline from its first point to each of its points.

    Parameters
    ----------
    points : (n, 3) or (n, 2) ndarray
        Points of all polylines, one after another.
    start : (S + 1,) ndarray of int
        Index of the first point of each polyline, then n.
    """
    step = np.zeros(len(points))
    delta = np.diff(points, axis=0)
    step[1:] = np.sqrt(dot(delta, delta))
    step[start[:-1]] = 0
    total = np.cumsum(step)
    return total - np.repeat(total[start[:-1]], np.diff(start))
