"""The contents of the key of a picture: its color scale, and the indices of its singularities."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass

import numpy as np

from ..core.color import map_colors
from .singularity_marks import SingularityMarks


@dataclass(frozen=True)
class ColorScale:
    """The quantity that the color map of a picture shows, and its range.

    Attributes
    ----------
    title : str
        Name of the quantity.
    color_map : str
        Name of the color map; see `color.map_colors`.
    low, high : float or None
        Values that have the first and the last color. None if the value is not the same in all frames or for
        all fields. The larger value is at the top of the color bar.
    """

    title: str
    color_map: str
    low: float | None
    high: float | None

    def colors(self, count: int) -> np.ndarray:
        """Return (count, 3) float32: colors of the color bar as sRGB display values, from the bottom up."""
        positions = (np.arange(count) + 0.5) / count
        is_inverted = self.low is not None and self.high is not None and self.low > self.high
        return map_colors(positions[::-1] if is_inverted else positions, self.color_map)


@dataclass(frozen=True)
class IndexCount:
    """A singularity index that occurs in a picture, with the number of singularities that have it.

    Attributes
    ----------
    index : int
        The index in units of 1 / N.
    degree : int
        Degree N of the field.
    count : int or None
        Number of visible singularities with this index. None if it is not known, as for an animation.
    """

    index: int
    degree: int
    count: int | None


@dataclass(frozen=True)
class PictureKey:
    """The contents of the key of a picture: its color scale, and the indices of its singularities.

    Attributes
    ----------
    color_scale : ColorScale or None
        Colors and their values; None if the picture has no color map.
    indices : tuple of IndexCount
        The indices of the singularities in the picture, the largest first. Empty if it has no dots.
    dot_size : float
        Diameter of a dot of index 1 / N, in pixels of the picture.
    """

    color_scale: ColorScale | None = None
    indices: tuple[IndexCount, ...] = ()
    dot_size: float = 0.0

    def to_json(self) -> str:
        """Return the key as JSON text, which `from_json` reads."""
        return json.dumps(asdict(self))

    @classmethod
    def from_json(cls, text: str) -> PictureKey:
        """Return the key of a text from `to_json`; an empty key if another version wrote the text."""
        try:
            values = json.loads(text)
            scale = values["color_scale"]
            scale = None if scale is None else ColorScale(**scale)
            indices = tuple(IndexCount(**entry) for entry in values["indices"])
            return cls(scale, indices, values["dot_size"])
        except (ValueError, KeyError, TypeError):
            return cls()


def count_indices(marks: SingularityMarks) -> tuple[IndexCount, ...]:
    """Return the indices of the visible singularities with their counts, the largest index first."""
    kinds = np.stack([marks.index, marks.degree], axis=1)[marks.is_visible]
    return sorted_indices(kinds, has_counts=True)


def sorted_indices(kinds: np.ndarray, *, has_counts: bool) -> tuple[IndexCount, ...]:
    """Return each distinct index among K singularities once, the largest index first.

    `kinds`, (K, 2), holds the index in units of 1 / N and the degree N of each singularity. If `has_counts`,
    the results have the number of singularities with each index.
    """
    distinct, counts = np.unique(kinds.reshape(-1, 2), axis=0, return_counts=True)
    rows = zip(distinct.tolist(), counts.tolist(), strict=True)
    entries = [IndexCount(*kind, count if has_counts else None) for kind, count in rows]
    return tuple(sorted(entries, key=lambda entry: (-entry.index / entry.degree, entry.degree)))
