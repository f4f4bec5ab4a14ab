"""Draw colors over parts of a picture, in linear light."""

from __future__ import annotations

import numpy as np


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
