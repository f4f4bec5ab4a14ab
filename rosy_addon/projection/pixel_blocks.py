"""Blocks of pixels: the unit in which long lists of pixels are processed; and parts of their data.

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
    """Return a dataclass with what an index of arrays chooses in each of its arrays."""
    arrays = {
        name: value[index] for name, value in vars(record).items() if isinstance(value, np.ndarray)
    }
    return replace(record, **arrays)
