"""Progress of long functions, reported to a listener.

A function reports its progress with `report`, from 0 to 1. Where it calls others that report, `progress`
scales their reports to a part of its own. Nobody need listen: then both cost next to nothing. The listener is
a context variable, so no function passes it on.
"""

from __future__ import annotations

from collections.abc import Callable
from contextvars import ContextVar
from types import TracebackType
from typing import NamedTuple

#: Is told a fraction from 0 to 1, and what is being done. An exception that it raises ends the work.
Listener = Callable[[float, str], None]


class _Part(NamedTuple):
    """A listener, and the range of its progress that is reported now."""

    listener: Listener
    start: float
    stop: float
    label: str | None


_current: ContextVar[_Part | None] = ContextVar("rosy_progress", default=None)


def report(fraction: float, label: str) -> None:
    """Tell the listener, if there is one, how far the present part of the work has come.

    Parameters
    ----------
    fraction : float
        0 at the start of the part, 1 when it is done.
    label : str
        What is being done, for a status bar.
    """
    part = _current.get()
    if part is not None:
        fraction = part.start + (part.stop - part.start) * fraction
        part.listener(float(fraction), label if part.label is None else part.label)


class _Scope:
    """Sets the current part within a ``with`` block."""

    __slots__ = ("_part", "_token")

    def __init__(self, part: _Part | None) -> None:
        self._part = part

    def __enter__(self) -> None:
        self._token = _current.set(self._part)

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        _current.reset(self._token)


def progress(start: float, stop: float | None = None, label: str | None = None) -> _Scope:
    """Scale what is reported in a ``with`` block to a part of the present work.

    Parameters
    ----------
    start, stop : float
        Fractions of the present work at which the part begins and ends. By default it ends where it
        begins: it takes next to no time.
    label : str, optional
        Replaces the labels that are reported.

    Examples
    --------
    >>> def both():
    ...     with progress(0.0, 0.5):
    ...         report(0.5, "first")
    ...     with progress(0.5, 1.0):
    ...         report(0.5, "second")
    >>> with listening(lambda fraction, label: print(fraction, label)):
    ...     both()
    0.25 first
    0.75 second
    """
    outer = _current.get()
    if outer is None:
        return _Scope(None)
    extent, stop = outer.stop - outer.start, start if stop is None else stop
    inner_label = label if outer.label is None else outer.label
    return _Scope(
        _Part(
            outer.listener, outer.start + extent * start, outer.start + extent * stop, inner_label
        )
    )


def listening(listener: Listener | None) -> _Scope:
    """Send the reports of a ``with`` block to a listener; with None, to nobody.

    A fraction that is less than one before is told as that one: progress stands still, and never goes back.
    """
    if listener is None:
        return _Scope(None)
    last = 0.0

    def tell(fraction: float, label: str) -> None:
        nonlocal last
        last = max(last, fraction)
        listener(last, label)

    return _Scope(_Part(tell, 0.0, 1.0, None))


def current_report() -> Listener:
    """Return a function that reports to the present part of the work, wherever it is called."""
    part = _current.get()

    def report_there(fraction: float, label: str) -> None:
        with _Scope(part):
            report(fraction, label)

    return report_there
