"""Strips: ranges of rows of a picture that are drawn independently of each other.

How a picture is cut into strips does not depend on the number of processes (see `strip_division`). A strip
depends on a limited number of rows around it, its context. Every process draws the same pixels of a strip, to
the last bit. So several processes can share a picture.

Streamlines differ between two strips. So the first rows of a strip are drawn twice, also with the strip
below, and fade from the lower strip to the upper one (`join_strips`).
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from .look_units import PixelLook

#: Number of rows of the strip above for which a strip computes averages of streamlines, too.
OVERLAP_ROWS = 12

#: Number of rows beside a strip whose pixels may contain samples of the surface in the strip.
BORDER_ROWS = 1

#: Number of rows in which a strip fades into the one above. Their pixels may show samples of `BORDER_ROWS`
#: further rows.
FADE_ROWS = OVERLAP_ROWS - BORDER_ROWS


class Strip(NamedTuple):
    """A strip: a range of rows of a frame.

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
        """The rows whose pixels get averages of streamlines: the first row, and the row after the last.

        They are the strip and `OVERLAP_ROWS` rows above it: `drawn_rows`, and `BORDER_ROWS` more.
        """
        return self.start, min(self.stop + OVERLAP_ROWS, self.height)

    @property
    def drawn_rows(self) -> tuple[int, int]:
        """The rows of the picture of this strip: the first row, and the row after the last.

        The last `FADE_ROWS` of them fade into the strip above, if there is one.
        """
        return self.start, min(self.stop + FADE_ROWS, self.height)


def streamline_margin(look: PixelLook) -> int:
    """Return by how many rows streamlines may leave a strip."""
    return look.streamline_reach() + 2


def join_strips(pictures: Sequence[np.ndarray], strips: Sequence[Strip]) -> np.ndarray:
    """Join the pictures of strips, in order from the bottom. Neighboring strips fade into each other.

    Parameters
    ----------
    pictures : sequence of (h, W, 4) float32 ndarray
        The `drawn_rows` of the strips. RGBA, not premultiplied.
    strips : sequence of Strip
        Adjacent strips, from the bottom.

    Returns
    -------
    (H, W, 4) float32 ndarray
        The rows from the first row of the first strip to the last drawn row of the last strip.
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
    """Return (f, W, 4) rows that fade from a strip to the strip above.

    `lower` and `upper` are the same f rows of both strips: RGBA, not premultiplied. The first row is `lower`.
    """
    weight = np.linspace(1, 0, len(lower), endpoint=False, dtype=np.float32)[:, None, None]
    alpha = upper[..., 3:] + weight * (lower[..., 3:] - upper[..., 3:])
    premultiplied = upper[..., :3] * upper[..., 3:]
    premultiplied += weight * (lower[..., :3] * lower[..., 3:] - premultiplied)
    faded = np.concatenate([premultiplied, alpha], axis=2)
    np.divide(faded[..., :3], alpha, out=faded[..., :3], where=alpha > 0)
    faded[0] = lower[0]
    return np.where(lower == upper, upper, faded)
