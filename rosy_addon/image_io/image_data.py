"""`ImageData`: the contents of an image of Blender, a PNG file or pixels in single precision."""

from __future__ import annotations

import struct
from typing import TypeAlias

import numpy as np

from .png import png_bytes

#: The bytes of a PNG file for an 8-bit image, or (H, W, 4) float32 linear values, rows from the bottom.
ImageData: TypeAlias = bytes | np.ndarray


def image_of_pixels(pixels: np.ndarray, as_float: bool, *, is_color: bool) -> ImageData:
    """Return the contents of an image with these pixels.

    Parameters
    ----------
    pixels : (H, W, 4) float32 ndarray
        Linear, rows from the bottom.
    as_float : bool
        Store linear values in single precision.
    is_color : bool
        Whether 8-bit values are colors (sRGB), and not data.
    """
    return pixels if as_float else png_bytes(pixels, is_color=is_color)


def image_size(contents: ImageData) -> tuple[int, int]:
    """Return the width and the height of an image in pixels."""
    if isinstance(contents, bytes):
        width, height = struct.unpack_from(
            ">II", contents, 16
        )  # after the header of the first chunk
        return width, height
    return contents.shape[1], contents.shape[0]
