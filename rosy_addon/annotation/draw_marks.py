"""Draw the dots and labels of singularities over a picture."""

from __future__ import annotations

import numpy as np

from ..color import from_hex, to_linear
from ..progress import Progress, Task
from .index_labels import HALO, HALO_COLOR, LABEL_COLOR, Label, placed_labels, stroke_width
from .singularity_marks import (
    COLOR_BY_SIGN,
    HIDDEN_OPACITY,
    OUTLINE,
    OUTLINE_COLOR,
    SingularityMarks,
)

#: Dots that are drawn in a step.
DOTS_PER_STEP = 256


def draw_marks_task(rgba: np.ndarray, marks: SingularityMarks) -> Task[np.ndarray]:
    """Draw dots and their labels over a picture.

    Parameters
    ----------
    rgba : (H, W, 4) float32 ndarray
        Linear, not premultiplied, rows from the bottom. Not changed.
    marks : SingularityMarks

    Yields
    ------
    Progress

    Returns
    -------
    (H, W, 4) float32 ndarray
    """
    rgba = rgba.copy()
    marks = marks.in_drawing_order()
    radii = marks.radius
    outline = to_linear(from_hex(OUTLINE_COLOR))
    fills = {sign: to_linear(from_hex(code)) for sign, code in COLOR_BY_SIGN.items()}
    for number in range(len(radii)):
        if number % DOTS_PER_STEP == 0:
            yield Progress(number / len(radii), "drawing singularities")
        center, radius = marks.position[number], float(radii[number])
        outer = radius + OUTLINE * marks.size
        window = _window(rgba, center - outer - 1, center + outer + 1)
        if window is None:
            continue
        part, x, y = window
        distance = np.hypot(x - center[0], y - center[1])
        opacity = 1.0 if marks.is_visible[number] else HIDDEN_OPACITY
        inner_share = np.clip(radius + 0.5 - distance, 0, 1)[..., None].astype(np.float32)
        color = outline + inner_share * (fills[int(np.sign(marks.index[number]))] - outline)
        _draw_over(part, color, opacity * np.clip(outer + 0.5 - distance, 0, 1))
    color, halo = to_linear(from_hex(LABEL_COLOR)), to_linear(from_hex(HALO_COLOR))
    for label in placed_labels(marks):
        _draw_label(rgba, label, marks.size, color, halo)
    return rgba


def _draw_label(
    rgba: np.ndarray, label: Label, size: float, color: np.ndarray, halo: np.ndarray
) -> None:
    """Draw a label and the halo around it, in place."""
    segments = label.segments()
    width = stroke_width(size) / 2
    reach = width + HALO * size + 1
    window = _window(rgba, segments.min(axis=(0, 1)) - reach, segments.max(axis=(0, 1)) + reach)
    if window is None:
        return
    part, x, y = window
    distance = _distance_to_segments(x, y, segments)
    _draw_over(part, halo, np.clip(width + HALO * size + 0.5 - distance, 0, 1))
    _draw_over(part, color, np.clip(width + 0.5 - distance, 0, 1))


def _window(
    rgba: np.ndarray, low: np.ndarray, high: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray] | None:
    """Return the part of a picture between two corners, and x and y of its pixels; None if empty."""
    height, width = rgba.shape[:2]
    left, bottom = np.floor(np.maximum(low, 0)).astype(int)
    right, top = np.ceil(np.minimum(high, (width, height))).astype(int)
    if left >= right or bottom >= top:
        return None
    y, x = np.mgrid[bottom:top, left:right] + 0.5
    return rgba[bottom:top, left:right], x, y


def _draw_over(part: np.ndarray, color: np.ndarray, opacity: np.ndarray) -> None:
    """Draw a color over a part of a picture, in place."""
    opacity = opacity.astype(np.float32)
    below = part[..., 3] * (1 - opacity)
    alpha = opacity + below
    share = np.divide(opacity, alpha, out=np.zeros_like(alpha), where=alpha > 0)[..., None]
    part[..., :3] += share * (color - part[..., :3])
    part[..., 3] = alpha


def _distance_to_segments(x: np.ndarray, y: np.ndarray, segments: np.ndarray) -> np.ndarray:
    """Return the distances of points to the nearest of (n, 2, 2) segments, in the shape of x and y."""
    nearest = np.full(x.shape, np.inf)
    for (ax, ay), (bx, by) in segments.tolist():
        dx, dy = bx - ax, by - ay
        length = dx * dx + dy * dy or 1.0
        along = np.clip(((x - ax) * dx + (y - ay) * dy) / length, 0, 1)
        np.minimum(nearest, np.hypot(x - ax - along * dx, y - ay - along * dy), out=nearest)
    return nearest
