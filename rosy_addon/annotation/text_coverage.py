"""Fractions of pixels that the triangles of a text cover."""

from __future__ import annotations

import numpy as np

#: Scan lines of a row of pixels. Along a scan line the coverage is exact.
SCAN_LINES = 8


def triangle_coverage(triangles: np.ndarray, width: int, height: int) -> np.ndarray:
    """Return the fraction of each pixel that triangles cover.

    Each scan line crosses a triangle in an interval. The coverage of all intervals is summed by their
    ends: an end adds to all pixels to its right, in part to its own.

    Parameters
    ----------
    triangles : (n, 3, 2) float ndarray
        Corners in pixels from the lower left, y up, in any order. They do not overlap.
    width, height : int
        Of the window, pixels. What is outside is cut away.

    Returns
    -------
    (height, width) float32 ndarray
        0 to 1.
    """
    corners = np.asarray(triangles, dtype=np.float64)
    corners = np.take_along_axis(corners, np.argsort(corners[..., 1], axis=1)[..., None], axis=1)
    x, y = corners[..., 0], corners[..., 1] * SCAN_LINES
    # Scan line s is at s + 1/2.
    first = np.clip(np.ceil(y[:, 0] - 0.5), 0, SCAN_LINES * height).astype(np.int64)
    stop = np.clip(np.ceil(y[:, 2] - 0.5), 0, SCAN_LINES * height).astype(np.int64)
    count = np.maximum(stop - first, 0)
    owner = np.repeat(np.arange(len(corners)), count)
    line = np.arange(count.sum()) - np.repeat(np.cumsum(count) - count, count) + first[owner]
    x, y, level = x[owner], y[owner], line + 0.5
    is_lower = level < y[:, 1]
    start = np.where(is_lower, 0, 1)
    rows = np.arange(len(owner))
    short_side = _crossing(
        x[rows, start], y[rows, start], x[rows, start + 1], y[rows, start + 1], level
    )
    long_side = _crossing(x[:, 0], y[:, 0], x[:, 2], y[:, 2], level)
    left, right = np.minimum(short_side, long_side), np.maximum(short_side, long_side)
    total = np.zeros(height * (width + 1))
    for end, sign in ((left, 1.0), (right, -1.0)):
        end = np.clip(end, 0, width)
        pixel = np.minimum(end.astype(np.int64), width - 1)
        inside = pixel + 1 - end  # the part of the pixel to the right of the end
        index = (line // SCAN_LINES) * (width + 1) + pixel
        total += np.bincount(index, sign * inside, len(total))
        total += np.bincount(index + 1, sign * (1 - inside), len(total))
    coverage = np.cumsum(total.reshape(height, width + 1), axis=1)[:, :width] / SCAN_LINES
    return np.clip(coverage, 0, 1).astype(np.float32)


def _crossing(
    x0: np.ndarray, y0: np.ndarray, x1: np.ndarray, y1: np.ndarray, level: np.ndarray
) -> np.ndarray:
    """Return the x of the points of edges at a level of y, which is between the ends."""
    rise = y1 - y0
    along = np.divide(level - y0, rise, out=np.zeros_like(level), where=rise > 0)
    return x0 + np.clip(along, 0, 1) * (x1 - x0)
