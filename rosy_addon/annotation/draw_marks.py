"""Draw arrowheads, and the dots and labels of singularities, over a picture, in linear light."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from ..core.color import from_hex, to_linear
from ..core.progress import report
from ..field.blocks import blocks_by_count, concatenated_ranges
from . import arrow_marks
from .arrow_marks import NOTCH, WIDTH, ArrowMarks
from .index_labels import HALO, HALO_COLOR, LABEL_COLOR, Label, placed_labels, stroke_width
from .singularity_marks import (
    COLOR_BY_SIGN,
    HIDDEN_OPACITY,
    OUTLINE,
    OUTLINE_COLOR,
    SingularityMarks,
)

#: Dots that are drawn between two reports, and pixels of arrowheads that are drawn at once.
DOTS_PER_BLOCK, PIXELS_PER_BLOCK = 256, 1 << 19


def window(
    rgba: np.ndarray, low: np.ndarray, high: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the part of a picture between two corners, which may be empty, and x and y of its pixels."""
    size = rgba.shape[1::-1]
    left, bottom = np.floor(np.clip(low, 0, size)).astype(int)
    right, top = np.ceil(np.clip(high, 0, size)).astype(int)
    y, x = np.mgrid[bottom:top, left:right] + 0.5
    return rgba[bottom:top, left:right], x, y


def draw_over(part: np.ndarray, color: np.ndarray, opacity: np.ndarray) -> None:
    """Draw a color over a part of a picture, in place."""
    opacity = opacity.astype(np.float32)
    below = part[..., 3] * (1 - opacity)
    alpha = opacity + below
    share = np.divide(opacity, alpha, out=np.zeros_like(alpha), where=alpha > 0)[..., None]
    part[..., :3] += share * (color - part[..., :3])
    part[..., 3] = alpha


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
        opacity = 1.0 if is_visible else HIDDEN_OPACITY
        draw_dot(rgba, center, radius, OUTLINE * marks.size, int(index), opacity)
    for label in placed_labels(marks):
        _draw_label(rgba, label, marks.size)
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
    inner = np.clip(radius + 0.5 - distance, 0, 1)[..., None].astype(np.float32)
    fill, line = _linear_color(COLOR_BY_SIGN[int(np.sign(index))]), _linear_color(OUTLINE_COLOR)
    coverage = opacity * np.clip(outer + 0.5 - distance, 0, 1)
    draw_over(part, line + inner * (fill - line), coverage)


@lru_cache(maxsize=8)
def _linear_color(code: str) -> np.ndarray:
    """Return the (3,) linear values of a color ``#rrggbb``; not to be changed."""
    return to_linear(from_hex(code))


def _draw_label(rgba: np.ndarray, label: Label, size: float) -> None:
    """Draw a label and the halo around it, in place."""
    segments = label.segments()
    width = stroke_width(size) / 2
    reach = width + HALO * size + 1
    part, x, y = window(rgba, segments.min(axis=(0, 1)) - reach, segments.max(axis=(0, 1)) + reach)
    distance = _distance_to_segments(x, y, segments)
    for color, radius in ((HALO_COLOR, width + HALO * size), (LABEL_COLOR, width)):
        draw_over(part, _linear_color(color), np.clip(radius + 0.5 - distance, 0, 1))


def _distance_to_segments(x: np.ndarray, y: np.ndarray, segments: np.ndarray) -> np.ndarray:
    """Return the distances of points to the nearest of (n, 2, 2) segments, in the shape of x and y."""
    nearest = np.full(x.shape, np.inf)
    for (ax, ay), (bx, by) in segments.tolist():
        dx, dy = bx - ax, by - ay
        length = dx * dx + dy * dy or 1.0
        along = np.clip(((x - ax) * dx + (y - ay) * dy) / length, 0, 1)
        np.minimum(nearest, np.hypot(x - ax - along * dx, y - ay - along * dy), out=nearest)
    return nearest


# --- arrowheads --------------------------------------------------------------------------------------


def draw_arrows(rgba: np.ndarray, marks: ArrowMarks) -> np.ndarray:
    """Draw arrowheads over a picture, with one outline around those that overlap.

    Parameters
    ----------
    rgba : (H, W, 4) float32 ndarray
        Linear, not premultiplied, rows from the bottom. Not changed.
    marks : ArrowMarks

    Returns
    -------
    (H, W, 4) float32 ndarray
    """
    rgba = rgba.copy()
    height, width = rgba.shape[:2]
    distance = np.full(height * width, np.inf, dtype=np.float32)
    reach = np.hypot(1, WIDTH) / 2 * marks.size + marks.outline + 1
    low = np.clip(np.floor(marks.position - reach), 0, (width, height)).astype(np.intp)
    high = np.clip(np.ceil(marks.position + reach), 0, (width, height)).astype(np.intp)
    # The rows of pixels of each arrowhead.
    row_count = high[:, 1] - low[:, 1]
    head = np.repeat(np.arange(len(marks)), row_count)
    row = concatenated_ranges(low[:, 1], row_count)
    length = (high - low)[head, 0]
    for part in blocks_by_count(length, PIXELS_PER_BLOCK):
        report(part.start / len(head), "drawing arrowheads")
        column = concatenated_ranges(low[head[part], 0], length[part])
        of_head, of_row = (np.repeat(values[part], length[part]) for values in (head, row))
        x, y = column + 0.5 - marks.position[of_head, 0], of_row + 0.5 - marks.position[of_head, 1]
        nearest = head_distance(x, y, marks.direction[of_head], marks.size).astype(np.float32)
        near = np.flatnonzero(nearest < marks.outline + 0.5)
        np.minimum.at(distance, of_row[near] * width + column[near], nearest[near])
    drawn = np.flatnonzero(distance < marks.outline + 0.5)
    pixels = rgba.reshape(-1, 4)
    part, distance = pixels[drawn], distance[drawn]
    fill, line = _linear_color(arrow_marks.FILL_COLOR), _linear_color(arrow_marks.OUTLINE_COLOR)
    inner = np.clip(0.5 - distance, 0, 1)[:, None]
    draw_over(part, line + inner * (fill - line), np.clip(marks.outline + 0.5 - distance, 0, 1))
    pixels[drawn] = part
    return rgba


def head_distance(x: np.ndarray, y: np.ndarray, direction: np.ndarray, size: float) -> np.ndarray:
    """Return the distances of points to an arrowhead, negative inside.

    Parameters
    ----------
    x, y : (n,) float64 ndarray
        Relative to the middle of the arrowhead, pixels.
    direction : (n, 2) float64 ndarray
        Unit vectors.
    size : float
        Length, pixels.

    Returns
    -------
    (n,) float64 ndarray
        Pixels.
    """
    along = x * direction[:, 0] + y * direction[:, 1]
    across = np.abs(y * direction[:, 0] - x * direction[:, 1])
    tip, barb, notch = head_outline(size)
    to_side, is_inside_side = _edge_distance(along, across, tip, barb)
    to_back, is_inside_back = _edge_distance(along, across, barb, notch)
    distance = np.minimum(to_side, to_back)
    return np.where(is_inside_side & is_inside_back, -distance, distance)


def head_outline(size: float) -> np.ndarray:
    """Return (3, 2): the tip, the left barb and the notch of an arrowhead, forward and to the left."""
    return size * np.array([[0.5, 0.0], [-0.5, 0.5 * WIDTH], [NOTCH - 0.5, 0.0]])


def _edge_distance(
    along: np.ndarray, across: np.ndarray, start: np.ndarray, end: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return the distances of points to an edge, and whether they are on its left side or on it."""
    dx, dy = end - start
    px, py = along - start[0], across - start[1]
    share = np.clip((px * dx + py * dy) / (dx * dx + dy * dy), 0, 1)
    return np.hypot(px - share * dx, py - share * dy), dx * py - dy * px >= 0
