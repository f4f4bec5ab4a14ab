"""Blocks of pixels: the unit in which long lists of pixels are processed.

A block bounds the memory of intermediate results and fits the caches of the processor.
"""

from __future__ import annotations

#: Pixels per block.
BLOCK_PIXELS = 1 << 14


def pixel_blocks(count: int) -> list[slice]:
    """Return slices of at most `BLOCK_PIXELS` that cover `count` pixels."""
    return [
        slice(start, min(start + BLOCK_PIXELS, count)) for start in range(0, count, BLOCK_PIXELS)
    ]
