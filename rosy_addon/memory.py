"""Tuning of the C library's memory allocator: keep freed memory for the next arrays."""

from __future__ import annotations

import numpy as np

#: Size in bytes of the array that raises the threshold. The GNU C library raises the threshold for
#: freed blocks of up to 32 MiB only.
MMAP_THRESHOLD_BYTES = 31 << 20


def raise_mmap_threshold() -> None:
    """Make the C library keep freed memory for the next arrays instead of unmapping it.

    A frame allocates and frees its arrays dozens of times. The operating system clears the pages of
    each new mapping, which takes a fifth of the time of a frame. The GNU C library maps blocks
    above a threshold separately, and raises this threshold to the size of the largest such block
    that was freed. This function allocates and frees one large block, without writing to it. It has
    no effect with other C libraries.
    """
    np.empty(MMAP_THRESHOLD_BYTES, dtype=np.uint8)
