"""Bands of a picture: rows that are drawn by themselves, with some around them as context.

The pixels of a band are the same to the last bit, however a picture is divided. What is computed at
a pixel depends on a limited number of rows around it (see `band_division`), and the strips in which
streamlines are traced (see `fast_lic`) do not depend on the bands. Strips only have in common the
rows at their border, which are blended. If two strips are in two bands, the lower band hands its
values to the upper one through a `BandExchange`.
"""

from __future__ import annotations

from collections.abc import Hashable
from dataclasses import dataclass
from typing import Protocol

import numpy as np

#: Rows beyond those of a band whose pixels may show a sample of them.
BORDER_ROWS = 1


class BandExchange(Protocol):
    """Hands arrays from a band to the one above it."""

    def put(self, key: Hashable, values: np.ndarray) -> None:
        """Store an array for the band above."""

    def get(self, key: Hashable) -> np.ndarray | None:
        """Wait for an array of the band below, and return it; None if that band ends without it."""


@dataclass(frozen=True, eq=False)
class Band:
    """Rows of a frame that are drawn by themselves.

    Attributes
    ----------
    start, stop : int
        The first row, and the row after the last one. A border of strips, or of the frame.
    context : int
        Rows below and above that the G-buffer has, too.
    exchange : BandExchange
    """

    start: int
    stop: int
    context: int
    exchange: BandExchange

    def rows(self, height: int) -> tuple[int, int]:
        """Return the rows of the G-buffer, for a frame of this height."""
        return max(self.start - self.context, 0), min(self.stop + self.context, height)


def drawn_pixels(band: Band | None, pixel: np.ndarray, width: int) -> slice:
    """Return the range of ascending flat pixels that get colors.

    They are those of a band and of its border, or all if there is no band.
    """
    if band is None:
        return slice(0, len(pixel))
    first_pixels = np.array(
        [max(band.start - BORDER_ROWS, 0) * width, (band.stop + BORDER_ROWS) * width]
    )
    return slice(*np.searchsorted(pixel, first_pixels.astype(pixel.dtype)).tolist())
