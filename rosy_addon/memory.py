"""How memory that is free again gets to the next array."""

from __future__ import annotations

import numpy as np

#: Bytes; the GNU C library learns from blocks of up to 32 MiB.
LESSON = 31 << 20


def keep_freed_memory() -> None:
    """Have the C library keep freed memory for the next arrays, instead of giving it back.

    A frame takes and frees its arrays dozens of times over, and the system hands memory out by
    pages, cleared one by one: a fifth of the time. The GNU library gives blocks back that are
    larger than the largest one freed so far, so it is shown one; nothing is written to it. To
    other libraries this is nothing.
    """
    np.empty(LESSON, dtype=np.uint8)
