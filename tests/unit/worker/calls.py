"""Functions that helpers call in tests. They would be in the package, whose modules helpers find."""

from __future__ import annotations

import os
import time

from rosy_addon.core.errors import RosyError
from rosy_addon.core.progress import report


def count(steps: int, seconds: float = 0.01) -> int:
    """Count, and report it."""
    for step in range(steps):
        report(step / steps, f"step {step}")
        time.sleep(seconds)
    return steps


def fail(message: str) -> None:
    raise RosyError(message)


def end() -> None:
    os._exit(3)


def answer_with_a_function() -> object:
    return lambda: 0
