"""Draw arrowheads over a picture."""

from __future__ import annotations

import numpy as np

from ..core.color import from_hex, to_linear
from ..core.progress import report
from ..field.blocks import blocks_by_count, concatenated_ranges
from .arrow_marks import FILL_COLOR, NOTCH, OUTLINE_COLOR, WIDTH, ArrowMarks
from .painting import draw_over

#: Pixels of arrowheads that are drawn in a step.
PIXELS_PER_BLOCK = 1 << 19


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
    report(0.0, "drawing arrowheads")
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
    fill, line = (to_linear(from_hex(code)) for code in (FILL_COLOR, OUTLINE_COLOR))
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
