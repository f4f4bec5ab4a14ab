"""Strips: rows of a picture that are drawn by themselves.

A large picture is cut into strips by its size alone (see `strip_division`). What a strip shows depends on a limited
number of rows around it, its context, and is the same to the last bit wherever it is drawn. So several processes
can share a picture.

Streamlines differ between two strips. So the first rows of a strip are drawn with the strip below, too, and
fade from that one to this one (`join_strips`).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from .look_units import PixelLook

#: Rows of the strip above in which a strip takes averages of streamlines, too.
OVERLAP_ROWS = 12

#: Rows beside a strip whose pixels may show a sample of it.
BORDER_ROWS = 1

#: Rows in which a strip fades into the one above: a pixel in them may show the border.
FADE_ROWS = OVERLAP_ROWS - BORDER_ROWS


class Strip(NamedTuple):
    """Rows of a frame.

    Attributes
    ----------
    start, stop : int
        The first row, and the row after the last one.
    height : int
        Height of the frame.
    """

    start: int
    stop: int
    height: int

    @property
    def averaged_rows(self) -> tuple[int, int]:
        """The rows whose pixels get averages of streamlines."""
        return self.start, min(self.stop + OVERLAP_ROWS, self.height)

    @property
    def drawn_rows(self) -> tuple[int, int]:
        """The rows of the picture of this strip. The last ones fade into the strip above."""
        return self.start, min(self.stop + FADE_ROWS, self.height)


def streamline_margin(look: PixelLook) -> int:
    """Return how many rows streamlines may leave a strip."""
    return look.streamline_reach() + 2


def join_strips(pictures: Sequence[np.ndarray], strips: Sequence[Strip]) -> np.ndarray:
    """Join the pictures of strips, from the bottom.

    Parameters
    ----------
    pictures : sequence of (h, W, 4) float32 ndarray
        The `drawn_rows` of the strips. RGBA, not premultiplied.
    strips : sequence of Strip
        One above the other.

    Returns
    -------
    (H, W, 4) float32 ndarray
        From the first row of the first strip to the last drawn row of the last one.
    """
    if len(pictures) == 1:
        return pictures[0]
    first, (_, last) = strips[0].start, strips[-1].drawn_rows
    joined = np.empty((last - first, *pictures[0].shape[1:]), dtype=np.float32)
    faded = 0
    for strip, picture in zip(strips, pictures, strict=True):
        target = joined[strip.start - first :][: len(picture)]
        if faded:
            picture = picture.copy()
            picture[:faded] = _faded(target[:faded], picture[:faded])
        target[:] = picture
        faded = len(picture) - (strip.stop - strip.start)
    return joined


def _faded(lower: np.ndarray, upper: np.ndarray) -> np.ndarray:
    """Fade from one strip to the strip above, row by row. The first row is from the lower strip."""
    weight = np.linspace(1, 0, len(lower), endpoint=False, dtype=np.float32)[:, None, None]
    alpha = upper[..., 3:] + weight * (lower[..., 3:] - upper[..., 3:])
    premultiplied = upper[..., :3] * upper[..., 3:]
    premultiplied += weight * (lower[..., :3] * lower[..., 3:] - premultiplied)
    faded = np.concatenate([premultiplied, alpha], axis=2)
    np.divide(faded[..., :3], alpha, out=faded[..., :3], where=alpha > 0)
    faded[0] = lower[0]
    return np.where(lower == upper, upper, faded)
