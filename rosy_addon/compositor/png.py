"""Pictures as .png files, written and read with Python's own zlib alone."""

from __future__ import annotations

import os
import struct
import zlib

import numpy as np

from ..errors import RosyError
from ..files import read_bytes, write_bytes
from .colour import to_display, to_linear

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


#: Channels of a pixel, by the kind of colour: grey, RGB, a palette's, grey and alpha, RGBA.
_CHANNELS = {0: 1, 2: 3, 3: 1, 4: 2, 6: 4}
_PALETTE = 3


def read_png(path: str | os.PathLike[str]) -> np.ndarray:
    """Read a picture with 8 or 16 bits a channel, taken to be sRGB.

    Parameters
    ----------
    path : path-like

    Returns
    -------
    (H, W, 4) float32 ndarray
        Linear light, not premultiplied, rows from the bottom.

    Raises
    ------
    RosyError
        If it is no such file, broken, interlaced or of fewer bits a channel.
    """
    chunks = _chunks(path, read_bytes(path))
    broken = RosyError(f"{path}: is broken, or no .png file as it should be")
    try:
        width, height, bits, kind, _, _, interlaced = struct.unpack(">IIBBBBB", chunks[b"IHDR"])
    except (KeyError, struct.error):
        raise broken from None
    if bits not in (8, 16) or kind not in _CHANNELS or interlaced:
        raise RosyError(
            f"{path}: only pictures of 8 or 16 bits a channel that are not interlaced are read"
        )
    depth = bits // 8
    size = _CHANNELS[kind] * depth
    try:
        rows = np.frombuffer(zlib.decompress(chunks[b"IDAT"]), dtype=np.uint8)
        rows = rows.reshape(height, 1 + width * size)
        values = _unfiltered(rows[:, 1:].reshape(height, width, size), rows[:, 0])
        if kind == _PALETTE:
            values = _from_palette(values, chunks)
    except (KeyError, ValueError, IndexError, zlib.error):
        raise broken from None
    if depth == 2:
        values = values.reshape(height, width, -1).view(">u2")
    return _as_rgba(values[::-1].astype(np.float32) / np.float32(256**depth - 1))


def _chunks(path: str | os.PathLike[str], data: bytes) -> dict[bytes, bytes]:
    """The contents of a file by their names; those of one name joined."""
    if data[:8] != _SIGNATURE:
        raise RosyError(f"{path}: is not a .png file")
    found: dict[bytes, bytes] = {}
    place = 8
    while place + 8 <= len(data):
        size, name = struct.unpack(">I4s", data[place : place + 8])
        found[name] = found.get(name, b"") + data[place + 8 : place + 8 + size]
        place += 12 + size
    return found


def _unfiltered(rows: np.ndarray, filters: np.ndarray) -> np.ndarray:
    """Undo what each row's filter has done, given (H, W, bytes of a pixel) and (H,) filters.

    A byte depends on those to the left, above, and above to the left. All pixels for which row and
    column sum to one number are found at once: what they depend on has a smaller one.
    """
    height, width, size = rows.shape
    if not filters.any():
        return rows
    if filters.max() > 4:
        raise ValueError
    # A border of zeros to the left and above.
    out = np.zeros((height + 1, width + 1, size), dtype=np.int16)
    for diagonal in range(height + width - 1):
        row = np.arange(max(diagonal - width + 1, 0), min(diagonal + 1, height))
        column = diagonal - row
        left, above, corner = out[row + 1, column], out[row, column + 1], out[row, column]
        guess = left + above - corner
        off = [np.abs(guess - near) for near in (left, above, corner)]
        paeth = np.where(
            (off[0] <= off[1]) & (off[0] <= off[2]), left, np.where(off[1] <= off[2], above, corner)
        )
        foretold = np.stack([np.zeros_like(left), left, above, (left + above) // 2, paeth])
        kind = filters[row].astype(np.intp)
        chosen = foretold[kind, np.arange(len(row))]
        out[row + 1, column + 1] = (rows[row, column] + chosen) & 255
    return out[1:, 1:].astype(np.uint8)


def _from_palette(values: np.ndarray, chunks: dict[bytes, bytes]) -> np.ndarray:
    """(H, W, 4) uint8 colours of their numbers."""
    colours = np.frombuffer(chunks[b"PLTE"], dtype=np.uint8).reshape(-1, 3)
    table = np.full((len(colours), 4), 255, dtype=np.uint8)
    table[:, :3] = colours
    alpha = np.frombuffer(chunks.get(b"tRNS", b""), dtype=np.uint8)
    table[: len(alpha), 3] = alpha
    return table[values[..., 0]]


def _as_rgba(values: np.ndarray) -> np.ndarray:
    """Linear RGBA of one to four channels of display values."""
    channels = values.shape[2]
    rgba = np.ones((*values.shape[:2], 4), dtype=np.float32)
    rgba[..., :3] = to_linear(values[..., : 3 if channels > 2 else 1])
    if channels % 2 == 0:
        rgba[..., 3] = values[..., -1]
    return rgba
