"""Images that are anchored to the picture, computed for whole tiles and kept for later pictures.

Whole tiles do not change while the visible region changes a little, so they stay cached.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable
from functools import partial
from typing import NamedTuple

import numpy as np

from ..core.cache import Cache

#: Side of a tile in pixels.
TILE_PIXELS = 256

#: Maximum number of pixels of an image that is cached for the next picture.
MAX_CACHED_PIXELS = 1 << 22

#: The cached images. It holds eight of the largest.
TILE_CACHE = Cache(max_bytes=8 * 4 * MAX_CACHED_PIXELS)


class TileRectangle(NamedTuple):
    """A rectangle of the picture that consists of whole tiles; rows from the bottom, in pixels."""

    left: int
    right: int
    bottom: int
    top: int

    def index(self, row: np.ndarray, column: np.ndarray) -> np.ndarray:
        """Return the flat indices of pixels in the rectangle, row by row."""
        return (row - self.bottom) * np.int32(self.right - self.left) + (column - self.left)


def tile_rectangle(
    pixel: np.ndarray, width: int, subpixels: int = 1, extra_columns: int = 0
) -> TileRectangle:
    """Return the rectangle that covers some pixels.

    Parameters
    ----------
    pixel : (P,) int32 ndarray
        Flat pixel indices into a supersampled frame, ascending.
    width : int
        Width of that frame in pixels.
    subpixels : int
        Subpixels along each side of a pixel. The rectangle is in pixels, not in subpixels.
    extra_columns : int
        Columns that are added at the right.
    """
    column = pixel % np.int32(width)
    left, right = int(column.min()) // subpixels, int(column.max()) // subpixels + 1
    bottom, top = (int(end) // width // subpixels for end in pixel[[0, -1]])
    return TileRectangle(
        *_round_outward(left, right + extra_columns), *_round_outward(bottom, top + 1)
    )


def _round_outward(start: int, stop: int) -> tuple[int, int]:
    """Round a range of rows or columns outward to whole tiles."""
    return start // TILE_PIXELS * TILE_PIXELS, -(-stop // TILE_PIXELS) * TILE_PIXELS


def cached_tiles(
    create: Callable[..., np.ndarray],
    rectangle: TileRectangle,
    *settings: Hashable,
) -> np.ndarray:
    """Return the result of ``create(rectangle, *settings)``, from the cache if it is there.

    It is a flat image of the rectangle. Large images are not stored.
    """
    left, right, bottom, top = rectangle
    if (right - left) * (top - bottom) > MAX_CACHED_PIXELS:
        return create(rectangle, *settings)
    key = create.__name__, rectangle, settings
    image = TILE_CACHE.get_or_create(key, partial(create, rectangle, *settings))
    TILE_CACHE.evict_over_limit()
    return image
