"""Draw the dots and labels of singularities over a picture."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from ..core.color import from_hex, to_linear
from ..core.progress import report
from .index_labels import HALO, HALO_COLOR, LABEL_COLOR, Label, placed_labels, stroke_width
from .painting import draw_over, window
from .singularity_marks import (
    COLOR_BY_SIGN,
    HIDDEN_OPACITY,
    OUTLINE,
    OUTLINE_COLOR,
    SingularityMarks,
)

#: Dots that are drawn in a step.
DOTS_PER_BLOCK = 256


def draw_marks(rgba: np.ndarray, marks: SingularityMarks) -> np.ndarray:
    """Draw dots and their labels over a picture.

    Parameters
    ----------
    rgba : (H, W, 4) float32 ndarray
        Linear, not premultiplied, rows from the bottom. Not changed.
    marks : SingularityMarks

    Returns
    -------
    (H, W, 4) float32 ndarray
    """
    rgba = rgba.copy()
    marks = marks.in_drawing_order()
    for number, (center, radius, index, is_visible) in enumerate(
        zip(marks.position, marks.radius.tolist(), marks.index, marks.is_visible, strict=True)
    ):
        if number % DOTS_PER_BLOCK == 0:
            report(number / len(marks), "drawing singularities")
        draw_dot(
            rgba,
            center,
            radius,
            OUTLINE * marks.size,
            int(index),
            1.0 if is_visible else HIDDEN_OPACITY,
        )
    color, halo = to_linear(from_hex(LABEL_COLOR)), to_linear(from_hex(HALO_COLOR))
    for label in placed_labels(marks):
        _draw_label(rgba, label, marks.size, color, halo)
    return rgba


def draw_dot(
    rgba: np.ndarray,
    center: np.ndarray,
    radius: float,
    outline: float,
    index: int,
    opacity: float = 1.0,
) -> None:
    """Draw the dot of a singularity over a picture, in place.

    Parameters
    ----------
    rgba : (H, W, 4) float32 ndarray
        Linear, not premultiplied, rows from the bottom.
    center : (2,) float ndarray
        Pixels from the lower left.
    radius, outline : float
        Radius without the outline, and width of the outline, pixels.
    index : int
        Its sign decides the color.
    opacity : float
    """
    outer = radius + outline
    part, x, y = window(rgba, center - outer - 1, center + outer + 1)
    distance = np.hypot(x - center[0], y - center[1])
    inner_share = np.clip(radius + 0.5 - distance, 0, 1)[..., None].astype(np.float32)
    fill, line = (
        _linear_color(code) for code in (COLOR_BY_SIGN[int(np.sign(index))], OUTLINE_COLOR)
    )
    draw_over(
        part, line + inner_share * (fill - line), opacity * np.clip(outer + 0.5 - distance, 0, 1)
    )


@lru_cache(maxsize=8)
def _linear_color(code: str) -> np.ndarray:
    """Return the (3,) linear values of a color ``#rrggbb``; not to be changed."""
    return to_linear(from_hex(code))


def _draw_label(
    rgba: np.ndarray, label: Label, size: float, color: np.ndarray, halo: np.ndarray
) -> None:
    """Draw a label and the halo around it, in place."""
    segments = label.segments()
    width = stroke_width(size) / 2
    reach = width + HALO * size + 1
    part, x, y = window(rgba, segments.min(axis=(0, 1)) - reach, segments.max(axis=(0, 1)) + reach)
    distance = _distance_to_segments(x, y, segments)
    draw_over(part, halo, np.clip(width + HALO * size + 0.5 - distance, 0, 1))
    draw_over(part, color, np.clip(width + 0.5 - distance, 0, 1))


def _distance_to_segments(x: np.ndarray, y: np.ndarray, segments: np.ndarray) -> np.ndarray:
    """Return the distances of points to the nearest of (n, 2, 2) segments, in the shape of x and y."""
    nearest = np.full(x.shape, np.inf)
    for (ax, ay), (bx, by) in segments.tolist():
        dx, dy = bx - ax, by - ay
        length = dx * dx + dy * dy or 1.0
        along = np.clip(((x - ax) * dx + (y - ay) * dy) / length, 0, 1)
        np.minimum(nearest, np.hypot(x - ax - along * dx, y - ay - along * dy), out=nearest)
    return nearest
