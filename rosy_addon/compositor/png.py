"""Pictures as .png files, with Python's own zlib alone."""

from __future__ import annotations

import os
import struct
import zlib

import numpy as np

from ..files import write_bytes
from .colour import to_display

_SIGNATURE = b"\x89PNG\r\n\x1a\n"
_EIGHT_BITS, _RGBA, _PERCEPTUAL = 8, 6, 0

#: Of zlib: more effort takes five times as long for a tenth, as streaks are noise.
LEVEL = 1


def write_png(path: str | os.PathLike[str], rgba: np.ndarray) -> None:
    """Write a picture with 8 bits a channel, declared to be sRGB.

    Parameters
    ----------
    path : path-like
    rgba : (H, W, 4) float ndarray
        Linear light, not premultiplied, rows from the bottom, as in a `Picture`.

    Raises
    ------
    RosyError
        If the file cannot be written.
    """
    write_bytes(path, png_bytes(to_bytes(rgba)))


def to_bytes(rgba: np.ndarray) -> np.ndarray:
    """(H, W, 4) uint8 of a linear picture, sRGB, still with rows from the bottom."""
    display = np.concatenate([to_display(rgba[..., :3]), np.clip(rgba[..., 3:], 0, 1)], axis=-1)
    return np.rint(display * 255).astype(np.uint8)


def png_bytes(rgba: np.ndarray) -> bytes:
    """A .png file of (H, W, 4) uint8 values, rows from the bottom."""
    height, width = rgba.shape[:2]
    rows = rgba[::-1].reshape(height, width * 4)
    # Every row is led by its filter: 0, none, for noise is not foretold by its neighbours.
    rows = np.concatenate([np.zeros((height, 1), dtype=np.uint8), rows], axis=1)
    header = struct.pack(">IIBBBBB", width, height, _EIGHT_BITS, _RGBA, 0, 0, 0)
    chunks = [
        (b"IHDR", header),
        (b"sRGB", bytes([_PERCEPTUAL])),
        (b"IDAT", zlib.compress(rows.tobytes(), LEVEL)),
        (b"IEND", b""),
    ]
    return _SIGNATURE + b"".join(_chunk(kind, data) for kind, data in chunks)


def _chunk(kind: bytes, data: bytes) -> bytes:
    return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))
