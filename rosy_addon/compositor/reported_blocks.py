"""Blocks of pixels that report how far the work on them has come."""

from __future__ import annotations

from collections.abc import Iterator

from ..core.progress import report
from ..projection.pixel_blocks import pixel_blocks


def reported_blocks(
    count: int, label: str, start: float = 0.0, stop: float = 1.0
) -> Iterator[slice]:
    """Yield the `pixel_blocks` of `count` pixels, and report the progress before each.

    Parameters
    ----------
    count : int
    label : str
        What is being done, for a status bar.
    start, stop : float
        Fractions of the present work before the first and after the last block.
    """
    for block in pixel_blocks(count):
        report(start + (stop - start) * block.start / count, label)
        yield block
