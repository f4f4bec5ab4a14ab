"""Long work as a generator of `Progress`: a modal operator ticks it, a script drains it."""

from __future__ import annotations

from collections.abc import Generator
from typing import NamedTuple, TypeVar

Result = TypeVar("Result")


class Progress(NamedTuple):
    """How far a piece of long work is.

    Attributes
    ----------
    fraction : float
        0 at the start, 1 when done.
    label : str
        What is being done, for a status bar.
    """

    fraction: float
    label: str


#: Long work that ends in a `Result`. Closing the generator cancels the work.
Work = Generator[Progress, None, Result]


def drain(work: Work[Result]) -> Result:
    """Run `work` to its end and return its result."""
    while True:
        try:
            next(work)
        except StopIteration as done:
            return done.value


def part(work: Work[Result], start: float, stop: float, label: str | None = None) -> Work[Result]:
    """Run `work` as the stretch from `start` to `stop` of something longer, under a label of that."""
    while True:
        try:
            step = next(work)
        except StopIteration as done:
            return done.value
        fraction = start + (stop - start) * step.fraction
        yield Progress(fraction, step.label if label is None else label)
