"""Long tasks as generators that yield `Progress`.

A modal operator advances a task step by step, so that Blender stays responsive and the user can
cancel. A script runs it to completion.
"""

from __future__ import annotations

from collections.abc import Generator
from typing import NamedTuple, TypeVar

Result = TypeVar("Result")


class Progress(NamedTuple):
    """How far a task has come.

    Attributes
    ----------
    fraction : float
        0 at the start, 1 when done.
    label : str
        The current step, for a status bar.
    """

    fraction: float
    label: str


#: A generator that yields `Progress` and returns a `Result`. Closing it cancels the task.
Task = Generator[Progress, None, Result]


def run_to_completion(task: Task[Result]) -> Result:
    """Run a task to its end and return its result."""
    while True:
        try:
            next(task)
        except StopIteration as end:
            return end.value


def subtask(
    task: Task[Result], start: float, stop: float, label: str | None = None
) -> Task[Result]:
    """Run a task as one part of a longer task, with its progress scaled to that part.

    Parameters
    ----------
    task : Task
    start, stop : float
        Fractions of the longer task at which this part starts and ends.
    label : str, optional
        Replaces the labels of `task`.

    Yields
    ------
    Progress
        With the fraction of the longer task.

    Returns
    -------
    Result
        The result of `task`.

    Examples
    --------
    ::

        def both_task() -> Task[tuple[int, int]]:
            first = yield from subtask(first_task(), 0.0, 0.5)
            second = yield from subtask(second_task(), 0.5, 1.0)
            return first, second
    """
    while True:
        try:
            progress = next(task)
        except StopIteration as end:
            return end.value
        fraction = start + (stop - start) * progress.fraction
        yield Progress(fraction, progress.label if label is None else label)
