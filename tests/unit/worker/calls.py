"""A function that helpers call in tests. It would be in the package, whose modules helpers find."""

import time

from rosy_addon.core.progress import report


def count(steps: int, seconds: float = 0.01) -> int:
    """Count, and report it."""
    for step in range(steps):
        report(step / steps, f"step {step}")
        time.sleep(seconds)
    return steps
