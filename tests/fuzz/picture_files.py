"""Write .png files of all kinds, with faults of their header and data."""

from __future__ import annotations

import struct
import zlib

from numpy.random import Generator

_CHANNELS = {0: 1, 2: 3, 3: 1, 4: 2, 6: 4}


def png_bytes(rng: Generator, size: tuple[int, int] | None = None) -> bytes:
    """Return a PNG file, by default a small one, valid in half of all cases."""
    width, height = size or (int(side) for side in rng.integers(1, 40, 2))
    bits = int(rng.choice([8] * 12 + [16] * 4 + [1, 4]))
    color = int(rng.choice([0, 2, 3, 4, 6]))
    header = [width, height, bits, color, 0, 0, int(rng.random() < 0.02)]
    row_size = 1 + (width * _CHANNELS[color] * bits + 7) // 8
    rows = bytearray(rng.bytes(height * row_size))
    for row in range(height):
        rows[row * row_size] = rng.integers(256) if rng.random() < 1e-3 else rng.integers(5)
    palette = rng.bytes(3 * int(rng.choice([256, 256, 256, 2])))
    match rng.integers(14):
        case 0:
            header[rng.integers(2)] = int(rng.choice([0, 1, 18000, 2**31 - 1, 2**32 - 1]))
        case 1:
            header[rng.integers(2, 7)] = int(rng.integers(256))
        case 2:
            rows = rows[: rng.integers(len(rows) + 1)]
        case 3:
            rows += bytes(int(rng.choice([1, 1000, 50_000_000])))
        case 4:
            header[:2] = [18000, 18000]
            rows = bytes(300_000_000) if rng.random() < 0.2 else rows
        case 5:
            palette = palette[: rng.integers(len(palette) + 1)]
    compressed = zlib.compress(bytes(rows), 1)
    half = int(rng.integers(len(compressed) + 1))
    chunks = [
        (b"IHDR", struct.pack(">IIBBBBB", *header)),
        (b"PLTE", palette),
        (b"tRNS", rng.bytes(int(rng.integers(300)))),
        (b"IDAT", compressed[:half]),
        (b"IDAT", compressed[half:]),
        (b"IEND", b""),
    ]
    if rng.random() < 0.05:
        del chunks[rng.integers(len(chunks))]
    data = b"\x89PNG\r\n\x1a\n"
    for kind, content in chunks:
        data += struct.pack(">I", len(content)) + kind + content
        data += struct.pack(">I", zlib.crc32(kind + content))
    return data
