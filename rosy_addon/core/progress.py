"""Progress of long functions, which is reported to a listener.

A function reports its progress with `report`, from 0 to 1. If it calls other functions that report, it wraps
the call in ``with progress(...)``, which scales their reports to a part of its own range. Without a listener,
both take almost no time. The listener is stored in a context variable, so it is not passed from function to
function.
"""

from collections.abc import Callable
from contextvars import ContextVar
from typing import NamedTuple

#: A function that is called with the progress, from 0 to 1, and a description of the current work. If it
#: raises an exception, the work ends.
Listener = Callable[[float, str], None]


class _Part(NamedTuple):
    """A listener, the range of its progress to which reports are scaled, and the label of all reports.

    If the label is None, each report has its own label.
    """

    listener: Listener
    start: float
    stop: float
    label: str | None


_current: ContextVar[_Part | None] = ContextVar("rosy_progress", default=None)


def report(fraction: float, label: str) -> None:
    """Report the progress of the current part of the work to the listener, if there is one.

    Parameters
    ----------
    fraction : float
        Progress: 0 at the start of the part, 1 when it is done.
    label : str
        Description of the current work for a status bar, such as "tracing strokes".
    """
    part = _current.get()
    if part is not None:
        fraction = part.start + (part.stop - part.start) * fraction
        part.listener(float(fraction), label if part.label is None else part.label)


class _Scope:
    """A context manager that sets the current part of the work."""

    __slots__ = ("_part", "_token")

    def __init__(self, part: _Part | None) -> None:
        self._part = part

    def __enter__(self) -> None:
        self._token = _current.set(self._part)

    def __exit__(self, *_: object) -> None:
        _current.reset(self._token)


def progress(start: float, stop: float | None = None, label: str | None = None) -> _Scope:
    """Context manager: scale the reports in the block to a part of the current work.

    Parameters
    ----------
    start, stop : float
        Fractions of the current work at which the part begins and ends. By default, `stop` is `start`, for
        parts that take almost no time.
    label : str, optional
        Label of all reports in the block, instead of their own labels.

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
    first, last = outer.start + extent * start, outer.start + extent * stop
    return _Scope(_Part(outer.listener, first, last, label if outer.label is None else outer.label))


def listening(listener: Listener | None) -> _Scope:
    """Context manager: send the reports in the block to a listener. With None, they are discarded.

    The progress that the listener receives never decreases: if a report is below an earlier one, the earlier
    value is sent again.
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
    """Return a function like `report` that always reports to the part of the work that is current now.

    It can be called later and elsewhere, when another part of the work, or none, is current.
    """
    part = _current.get()

    def report_there(fraction: float, label: str) -> None:
        with _Scope(part):
            report(fraction, label)

    return report_there
