"""Draw colors over parts of a picture, in linear light."""

from __future__ import annotations

import numpy as np


def window(
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


def draw_over(part: np.ndarray, color: np.ndarray, opacity: np.ndarray) -> None:
    """Draw a color over a part of a picture, in place."""
    opacity = opacity.astype(np.float32)
    below = part[..., 3] * (1 - opacity)
    alpha = opacity + below
    share = np.divide(opacity, alpha, out=np.zeros_like(alpha), where=alpha > 0)[..., None]
    part[..., :3] += share * (color - part[..., :3])
    part[..., 3] = alpha
