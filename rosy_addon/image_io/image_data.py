"""`ImageData`: a picture as an image of Blender stores it."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from .png import png_bytes


class ImageData(NamedTuple):
    """A picture as an image of Blender stores it: the bytes of a file, or pixels.

    Attributes
    ----------
    width, height : int
        Pixels.
    png : bytes or None
        The file of an 8-bit image.
    pixels : (H, W, 4) float32 ndarray or None
        Linear values of an image in single precision.
    """

    width: int
    height: int
    png: bytes | None = None
    pixels: np.ndarray | None = None


def image_of_pixels(pixels: np.ndarray, as_float: bool, *, is_color: bool) -> ImageData:
    """Convert pixels for a Blender image as they are.

    Parameters
    ----------
    pixels : (H, W, 4) float32 ndarray
        Linear, rows from the bottom.
    as_float : bool
        Store linear values in single precision.
    is_color : bool
        Whether 8-bit values are colors (sRGB), and not data.
    """
    height, width = pixels.shape[:2]
    if as_float:
        return ImageData(width, height, pixels=pixels)
    return ImageData(width, height, png=png_bytes(pixels, is_color=is_color))
