"""Blocks of pixels: long lists of pixels are processed block by block.

A block bounds the memory of intermediate results and fits the caches of the processor.
"""

from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import Any, TypeVar

import numpy as np

from ..core.progress import report
from ..field.blocks import row_blocks

Record = TypeVar("Record")

#: Pixels per block.
BLOCK_PIXELS = 1 << 14


def pixel_blocks(count: int, size: int = BLOCK_PIXELS) -> list[slice]:
    """Return slices of at most `size` that cover `count` pixels."""
    return row_blocks(count, size) if count else []


def reported_blocks(
    count: int, label: str, start: float = 0.0, stop: float = 1.0, size: int = BLOCK_PIXELS
) -> Iterator[slice]:
    """Yield the `pixel_blocks` of `count` pixels, and report the progress before each.

    Parameters
    ----------
    count : int
    label : str
        Name of the step, for a status bar.
    start, stop : float
        Progress before the first and after the last block, as fractions of the caller's work.
    size : int
        Largest number of pixels in a block.
    """
    for block in pixel_blocks(count, size):
        report(start + (stop - start) * block.start / count, label)
        yield block


def part_of(record: Record, index: Any) -> Record:
    """Return a copy of a record in which each array is replaced by ``array[index]``.

    `record` is a named tuple of arrays, or a dataclass. Arrays in dicts of a dataclass are replaced, too.
    """
    if isinstance(record, tuple):
        return type(record)(*(array[index] for array in record))

    def parts(values: Mapping[Any, Any]) -> dict[Any, Any]:
        return {key: value[index] for key, value in values.items() if isinstance(value, np.ndarray)}

    dicts = {name: parts(value) for name, value in vars(record).items() if isinstance(value, dict)}
    return replace(record, **parts(vars(record)), **dicts)
