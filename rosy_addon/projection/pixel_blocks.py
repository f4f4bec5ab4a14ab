"""Blocks of pixels: long lists of pixels are processed block by block.

A block bounds the memory of intermediate results and fits the caches of the processor.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any, TypeVar

import numpy as np

Record = TypeVar("Record")

#: Pixels per block.
BLOCK_PIXELS = 1 << 14


def pixel_blocks(count: int) -> list[slice]:
    """Return slices of at most `BLOCK_PIXELS` that cover `count` pixels."""
    return [
        slice(start, min(start + BLOCK_PIXELS, count)) for start in range(0, count, BLOCK_PIXELS)
    ]


def part_of(record: Record, index: Any) -> Record:
    """Return a copy of a dataclass in which each array is replaced by ``array[index]``."""
    arrays = {
        name: value[index] for name, value in vars(record).items() if isinstance(value, np.ndarray)
    }
    return replace(record, **arrays)
