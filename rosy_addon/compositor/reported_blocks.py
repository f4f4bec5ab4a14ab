"""Loops over blocks of pixels that report the progress."""

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
        Name of the step, for a status bar.
    start, stop : float
        Progress before the first and after the last block, from 0 to 1 of the work of the caller.
    """
    for block in pixel_blocks(count):
        report(start + (stop - start) * block.start / count, label)
        yield block
