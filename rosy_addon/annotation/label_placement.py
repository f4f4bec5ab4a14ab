"""Place labels beside dots so that they cover neither each other nor other dots."""

from __future__ import annotations

import numpy as np

#: Where a label goes beside its dot, the best place first: right or left, above or below.
SIDES = ((1, 1), (-1, 1), (1, -1), (-1, -1))


def place_labels(
    dots: np.ndarray, sizes: np.ndarray, radius: np.ndarray | float, frame: tuple[int, int]
) -> np.ndarray:
    """Choose a place beside its dot for each label, the first labels first.

    Parameters
    ----------
    dots : (K, 2) float ndarray
        Centers of the dots in pixels, y up.
    sizes : (K, 2) float ndarray
        Widths and heights of the labels in pixels.
    radius : (K,) ndarray or float
        Of the dots, in pixels.
    frame : (int, int)
        Width and height of the picture in pixels. No label reaches beyond it.

    Returns
    -------
    (K, 2) float64 ndarray
        Lower left corners of the labels; NaN for those that have no place.
    """
    dots, sizes = np.asarray(dots, dtype=np.float64), np.asarray(sizes, dtype=np.float64)
    corners = np.full(dots.shape, np.nan)
    radii = np.broadcast_to(radius, len(dots))
    low, high = dots - radii[:, None], dots + radii[:, None]
    for label, (dot, size, radius) in enumerate(zip(dots, sizes, radii.tolist(), strict=True)):
        for side in SIDES:
            corner = dot + np.where(np.array(side) > 0, radius, -radius - size)
            is_inside = (corner >= 0).all() and (corner + size <= frame).all()
            is_covered = (corner < high) & (corner + size > low)
            if is_inside and not is_covered.all(axis=1).any():
                corners[label] = corner
                low, high = np.vstack([low, corner]), np.vstack([high, corner + size])
                break
    return corners
