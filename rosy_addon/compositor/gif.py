"""Moving pictures as .gif: 256 colours, dithered, run by the format of 1989 (GIF89a)."""

from __future__ import annotations

import struct
from collections.abc import Sequence

import numpy as np

#: Levels of red, green and blue of the palette of coloured pictures: 252 colours.
LEVELS = (6, 7, 6)

#: The order in which a 4 x 4 square of pixels goes to the next level (Bayer 1973).
BAYER = np.array([[0, 8, 2, 10], [12, 4, 14, 6], [3, 11, 1, 9], [15, 7, 13, 5]]) / 16 + 1 / 32

#: Of the compression: codes of at most so many bits.
MOST_BITS = 12


def gif_bytes(frames: Sequence[np.ndarray], rate: float) -> bytes:
    """An endless .gif of some pictures.

    Parameters
    ----------
    frames : sequence of (H, W, 3) uint8 ndarray
        Display values (sRGB), rows from the top, all of one size.
    rate : float
        Pictures a second; the format has hundredths of a second.
    """
    height, width = frames[0].shape[:2]
    grey = all((frame == frame[..., :1]).all() for frame in frames)
    palette = np.repeat(np.arange(256)[:, None], 3, axis=1) if grey else _palette()
    screen = struct.pack("<HHBBB", width, height, 0xF7, 0, 0)
    parts = [b"GIF89a", screen, palette.astype(np.uint8).tobytes(), _LOOP]
    delay = max(round(100 / rate), 2)  # viewers slow down what is faster
    for frame in frames:
        index = frame[..., 0] if grey else _dithered(frame)
        parts.append(struct.pack("<BBBBHBB", 0x21, 0xF9, 4, 0, delay, 0, 0))
        parts.append(struct.pack("<BHHHHB", 0x2C, 0, 0, width, height, 0))
        parts.append(b"\x08")
        data = compressed(np.ascontiguousarray(index, dtype=np.uint8).tobytes())
        parts += [
            bytes([len(block)]) + block
            for start in range(0, len(data), 255)
            if (block := data[start : start + 255])
        ]
        parts.append(b"\x00")
    return b"".join([*parts, b"\x3b"])


_LOOP = b"\x21\xff\x0bNETSCAPE2.0\x03\x01\x00\x00\x00"


def compressed(data: bytes) -> bytes:
    """Bytes by the method of Lempel, Ziv and Welch, with codes from 9 to 12 bits, the low bit first."""
    clear, end = 256, 257
    known: dict[tuple[int, int], int] = {}
    bits, following = 9, end + 1
    out = bytearray()
    held, count = clear, bits
    string = data[0]
    for byte in data[1:]:
        code = known.get((string, byte))
        if code is not None:
            string = code
            continue
        held |= string << count
        count += bits
        if following < 1 << MOST_BITS:
            known[string, byte] = following
            if following == 1 << bits:
                bits += 1
            following += 1
        else:
            held |= clear << count
            count += bits
            known.clear()
            bits, following = 9, end + 1
        if count > 4096:
            whole = count // 8
            out += (held & ((1 << 8 * whole) - 1)).to_bytes(whole, "little")
            held >>= 8 * whole
            count -= 8 * whole
        string = byte
    held |= string << count
    count += bits
    held |= end << count
    count += bits
    return bytes(out + held.to_bytes((count + 7) // 8, "little"))


def _palette() -> np.ndarray:
    """(256, 3): all combinations of the levels, the last few black."""
    red, green, blue = (np.linspace(0, 255, count) for count in LEVELS)
    colours = np.stack(np.meshgrid(red, green, blue, indexing="ij"), axis=-1).reshape(-1, 3)
    return np.rint(np.concatenate([colours, np.zeros((256 - len(colours), 3))]))


def _dithered(frame: np.ndarray) -> np.ndarray:
    """(H, W) uint8 entries of the palette."""
    height, width = frame.shape[:2]
    threshold = np.tile(BAYER, (-(-height // 4), -(-width // 4)))[:height, :width]
    index = np.zeros((height, width), dtype=np.int64)
    for channel, count in enumerate(LEVELS):
        level = np.floor(frame[..., channel] / 255 * (count - 1) + threshold).astype(np.int64)
        index = index * count + np.minimum(level, count - 1)
    return index.astype(np.uint8)
