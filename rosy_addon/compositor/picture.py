"""The finished picture."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass

import numpy as np

from ..annotation.singularity_marks import SingularityMarks


@dataclass(frozen=True, eq=False)
class Picture:
    """An image of a field, rows from the bottom as in Blender.

    Attributes
    ----------
    rgba : (H, W, 4) float32 ndarray
        Linear, not premultiplied. Alpha is the fraction of the pixel in which a field is visible
        times, if lines are drawn on paper that is not opaque, the opacity of ink and paper.
    spread : (H, W) float32 ndarray or None
        If the colors are thresholds of ink: the fourth channel of `ink_thresholds.threshold_pixels`. Alpha
        is the fraction of the pixel in which a field is visible.
    color_range : (float, float) or None
        Values of the first and the last color of the color map. None if the look has no color map, or the
        fields of several degrees have ranges of their own.
    marks : SingularityMarks or None
        The singularities that are drawn over it. None if it has no dots.
    line_count : int
        The largest number of lines of its fields through a point; 0 if the picture is from a graphics card.
    """

    rgba: np.ndarray
    spread: np.ndarray | None = None
    color_range: tuple[float, float] | None = None
    marks: SingularityMarks | None = None
    line_count: int = 0


def common_color_range(ranges: Collection[tuple[float, float]]) -> tuple[float, float] | None:
    """Return `Picture.color_range`, given the ranges of the magnitudes of each degree."""
    return min(ranges) if len(set(ranges)) == 1 else None
