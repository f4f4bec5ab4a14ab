"""Listeners to progress, for tests."""

from collections.abc import Callable
from typing import Any

from rosy_addon.core.progress import Listener, listening


class CancelledError(Exception):
    """Raised by a listener to end the work."""


def reported(function: Callable[..., Any], *args: Any, **kwargs: Any) -> list[tuple[float, str]]:
    """Call a function, and return the fractions and labels that it reports."""
    reports: list[tuple[float, str]] = []
    with listening(lambda fraction, label: reports.append((fraction, label))):
        function(*args, **kwargs)
    return reports


def cancel_at(count: int) -> Listener:
    """Return a listener that raises `CancelledError` at a number of reports."""
    remaining = count

    def listen(fraction: float, label: str) -> None:
        nonlocal remaining
        remaining -= 1
        if not remaining:
            raise CancelledError

    return listen
