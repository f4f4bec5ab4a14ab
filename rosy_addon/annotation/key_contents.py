"""The contents of the key of a picture."""

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
        As in `color.map_colors`.
    low, high : float or None
        Values with the first and with the last color; the larger one is at the top of the color bar. None
        if there is not one such value: it differs between frames, or between fields.
    """

    title: str
    color_map: str
    low: float | None
    high: float | None

    def colors(self, count: int) -> np.ndarray:
        """Return (count, 3) float32 display values of the color bar, from the bottom."""
        positions = (np.arange(count) + 0.5) / count
        is_inverted = self.low is not None and self.high is not None and self.low > self.high
        return map_colors(positions[::-1] if is_inverted else positions, self.color_map)


@dataclass(frozen=True)
class IndexCount:
    """A kind of singularities.

    Attributes
    ----------
    index : int
        In units of 1 / N.
    degree : int
        N.
    count : int or None
        How many are visible. None if that is not known, as for all frames of an animation.
    """

    index: int
    degree: int
    count: int | None


@dataclass(frozen=True)
class PictureKey:
    """The contents of the key of a picture.

    Attributes
    ----------
    color_scale : ColorScale or None
        None if the picture has no color map.
    indices : tuple of IndexCount
        The indices of its singularities, the largest first. Empty if it has no dots.
    dot_size : float
        Diameter of a dot of index 1 / N, in pixels of the picture.
    """

    color_scale: ColorScale | None = None
    indices: tuple[IndexCount, ...] = ()
    dot_size: float = 0.0

    def to_json(self) -> str:
        """Return the key as text, for `from_json`."""
        return json.dumps(asdict(self))

    @classmethod
    def from_json(cls, text: str) -> PictureKey:
        """Return the key that `to_json` has written. It is empty if the text is from another version."""
        try:
            values = json.loads(text)
            scale = values["color_scale"]
            return cls(
                None if scale is None else ColorScale(**scale),
                tuple(IndexCount(**entry) for entry in values["indices"]),
                values["dot_size"],
            )
        except (ValueError, KeyError, TypeError):
            return cls()


def count_indices(marks: SingularityMarks) -> tuple[IndexCount, ...]:
    """Return the indices that occur among visible singularities, the largest first."""
    kinds = np.stack([marks.index, marks.degree], axis=1)[marks.is_visible]
    return sorted_indices(kinds, has_counts=True)


def sorted_indices(kinds: np.ndarray, *, has_counts: bool) -> tuple[IndexCount, ...]:
    """Return the distinct rows of (K, 2) indices and degrees, the largest index first."""
    distinct, counts = np.unique(kinds.reshape(-1, 2), axis=0, return_counts=True)
    entries = [
        IndexCount(index, degree, count if has_counts else None)
        for (index, degree), count in zip(distinct.tolist(), counts.tolist(), strict=True)
    ]
    return tuple(sorted(entries, key=lambda entry: (-entry.index / entry.degree, entry.degree)))
