"""`ImageData`: the contents of an image for Blender, as a PNG file or as pixels in single precision."""

import struct
from typing import TypeAlias

import numpy as np

from .png import png_bytes

#: The bytes of a PNG file for an 8-bit image, or (H, W, 4) float32 linear values, rows from the bottom.
ImageData: TypeAlias = bytes | np.ndarray


def image_of_pixels(pixels: np.ndarray, as_float: bool, *, is_color: bool) -> ImageData:
    """Return the contents of an image for Blender, given its pixels.

    Parameters
    ----------
    pixels : (H, W, 4) float32 ndarray
        Linear values, rows from the bottom.
    as_float : bool
        Whether the image has linear values in single precision. Otherwise, it is a PNG file with 8 bits per
        channel.
    is_color : bool
        Whether pixels are colors, which a PNG file stores as sRGB. Otherwise, they are data, which it stores
        as they are.
    """
    return pixels if as_float else png_bytes(pixels, is_color=is_color)


def image_size(contents: ImageData) -> tuple[int, int]:
    """Return the width and the height of an image in pixels."""
    if isinstance(contents, bytes):
        # After the header of the first chunk.
        width, height = struct.unpack_from(">II", contents, 16)
        return width, height
    return contents.shape[1], contents.shape[0]
