"""Encode animated GIF files (GIF89a) with a fixed palette of 256 colors and ordered dithering."""

import struct
from collections.abc import Sequence

import numpy as np

from ..core.progress import report

#: Numbers of levels of red, green and blue in the palette of color pictures. It has 252 colors in all.
PALETTE_LEVELS = (6, 7, 6)

#: (4, 4) thresholds of ordered dithering, between 0 and 1 (Bayer 1973).
BAYER = np.array([[0, 8, 2, 10], [12, 4, 14, 6], [3, 11, 1, 9], [15, 7, 13, 5]]) / 16 + 1 / 32

#: Maximum number of bits of an LZW code in a GIF file.
MAX_CODE_BITS = 12


def gif_bytes(frames: Sequence[np.ndarray], rate: float) -> bytes:
    """Encode frames as an animated GIF file that repeats forever.

    If all frames are gray, the palette has 256 grays and frames are not dithered.

    Parameters
    ----------
    frames : sequence of (H, W, 3) uint8 ndarray
        One or more frames of the same size, as display values (sRGB), rows from the top.
    rate : float
        Frames per second. The duration of a frame is rounded to hundredths of a second, and is at least 0.02
        seconds.

    Returns
    -------
    bytes
        Contents of the file.
    """
    height, width = frames[0].shape[:2]
    is_gray = all((frame == frame[..., :1]).all() for frame in frames)
    palette = np.repeat(np.arange(256)[:, None], 3, axis=1) if is_gray else _palette()
    screen_descriptor = struct.pack("<HHBBB", width, height, 0xF7, 0, 0)
    parts = [b"GIF89a", screen_descriptor, palette.astype(np.uint8).tobytes(), _LOOP_EXTENSION]
    delay = max(round(100 / rate), 2)  # Many viewers slow down shorter delays.
    for number, frame in enumerate(frames):
        report(number / len(frames), "encoding the video")
        index = frame[..., 0] if is_gray else _dither(frame)
        parts.append(struct.pack("<BBBBHBB", 0x21, 0xF9, 4, 0, delay, 0, 0))
        parts.append(struct.pack("<BHHHHB", 0x2C, 0, 0, width, height, 0))
        parts.append(b"\x08")
        data = lzw_compress(np.ascontiguousarray(index, dtype=np.uint8).tobytes())
        blocks = (data[start : start + 255] for start in range(0, len(data), 255))
        parts += [bytes([len(block)]) + block for block in blocks]
        parts.append(b"\x00")
    return b"".join([*parts, b"\x3b"])


_LOOP_EXTENSION = b"\x21\xff\x0bNETSCAPE2.0\x03\x01\x00\x00\x00"


def lzw_compress(data: bytes) -> bytes:
    """Compress one or more bytes by LZW, as in GIF files with 8 bits per pixel.

    Codes have 9 to 12 bits and are packed from the least significant bit.
    """
    clear_code, end_code = 256, 257
    code_table: dict[tuple[int, int], int] = {}
    code_bits, next_code = 9, end_code + 1
    out = bytearray()
    bit_buffer, bit_count = clear_code, code_bits
    prefix = data[0]
    for byte in data[1:]:
        code = code_table.get((prefix, byte))
        if code is not None:
            prefix = code
            continue
        bit_buffer |= prefix << bit_count
        bit_count += code_bits
        if next_code < 1 << MAX_CODE_BITS:
            code_table[prefix, byte] = next_code
            if next_code == 1 << code_bits:
                code_bits += 1
            next_code += 1
        else:
            bit_buffer |= clear_code << bit_count
            bit_count += code_bits
            code_table.clear()
            code_bits, next_code = 9, end_code + 1
        if bit_count > 4096:
            full_bytes = bit_count // 8
            out += (bit_buffer & ((1 << 8 * full_bytes) - 1)).to_bytes(full_bytes, "little")
            bit_buffer >>= 8 * full_bytes
            bit_count -= 8 * full_bytes
        prefix = byte
    for code in (prefix, end_code):
        bit_buffer |= code << bit_count
        bit_count += code_bits
    return bytes(out + bit_buffer.to_bytes((bit_count + 7) // 8, "little"))


def _palette() -> np.ndarray:
    """Return (256, 3) float64: the palette, in display values from 0 to 255.

    It has all combinations of the levels of red, green and blue. The remaining colors are black.
    """
    red, green, blue = (np.linspace(0, 255, count) for count in PALETTE_LEVELS)
    colors = np.stack(np.meshgrid(red, green, blue, indexing="ij"), axis=-1).reshape(-1, 3)
    return np.rint(np.concatenate([colors, np.zeros((256 - len(colors), 3))]))


def _dither(frame: np.ndarray) -> np.ndarray:
    """Return (H, W) uint8: the palette indices of an (H, W, 3) uint8 frame after ordered dithering."""
    height, width = frame.shape[:2]
    threshold = np.tile(BAYER, (-(-height // 4), -(-width // 4)))[:height, :width]
    index = np.zeros((height, width), dtype=np.int64)
    for channel, count in enumerate(PALETTE_LEVELS):
        level = np.floor(frame[..., channel] / 255 * (count - 1) + threshold).astype(np.int64)
        index = index * count + np.minimum(level, count - 1)
    return index.astype(np.uint8)
