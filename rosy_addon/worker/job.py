"""Jobs: work that reads data, has results computed, and applies them.

A job is a generator. It yields each long computation as a `Call` and receives its result. A script makes the
calls in place (`run`). In a window, a helper process makes them, so that Blender stays responsive.
"""

from __future__ import annotations

from collections.abc import Callable, Generator
from functools import update_wrapper
from typing import Any, Generic, NamedTuple, ParamSpec, TypeVar

from ..core.progress import progress, report

Result = TypeVar("Result")
Arguments = ParamSpec("Arguments")


class Call(NamedTuple):
    """A call of a function that needs no Blender, as one part of a job.

    Attributes
    ----------
    function : function
    arguments : tuple
        Anything that can be pickled.
    start, stop : float
        Fractions of the job at which the call begins and ends.
    label : str or None
        Replaces the labels that the function reports.
    """

    function: Callable[..., Any]
    arguments: tuple[Any, ...]
    start: float = 0.0
    stop: float = 1.0
    label: str | None = None

    def __call__(self) -> Any:
        """Make the call in this process."""
        with progress(self.start, self.stop, self.label):
            return self.function(*self.arguments)


class Step(NamedTuple):
    """A pause of a job that works in Blender's process, with the graphics card or between frames.

    Attributes
    ----------
    fraction : float
        Progress of the job, 0 to 1.
    label : str
        Label of the next step.
    """

    fraction: float
    label: str

    def __call__(self) -> None:
        """Report the progress."""
        report(self.fraction, self.label)


#: A job: it yields calls and steps, and results are sent to it. Closing the generator cancels the job.
Steps = Generator[Call | Step, Any, Result]


def advance(steps: Steps[Any], outcome: Callable[[], Any] | None = None) -> Call | Step:
    """Run a job up to its next call or step, and return it.

    Parameters
    ----------
    steps : Steps
    outcome : callable, optional
        Returns the result of the last call, or raises its error in the job. None for a job that begins.

    Raises
    ------
    StopIteration
        With the result, if the job is done.
    """
    if outcome is None:
        return next(steps)
    try:
        answer = outcome()
    except Exception as error:
        return steps.throw(error)
    return steps.send(answer)


def run(steps: Steps[Result]) -> Result:
    """Run a job to its end in this process, and return its result."""
    step = None
    try:
        while True:
            step = advance(steps, step)
    except StopIteration as end:
        return end.value


def call_steps(function: Callable[..., Result], *arguments: Any) -> Steps[Result]:
    """Make one call as a job, and return its result."""
    return (yield Call(function, arguments))


def part(
    steps: Steps[Result], start: float, stop: float, label: str | None = None
) -> Steps[Result]:
    """Run the steps of a job as one part of another.

    Parameters
    ----------
    steps : Steps
    start, stop : float
        Fractions of the whole job at which the part begins and ends.
    label : str, optional
        Replaces the labels of the steps.
    """

    def scaled(fraction: float) -> float:
        return start + (stop - start) * fraction

    try:
        step = next(steps)
        while True:
            step = step._replace(label=label or step.label)
            try:
                if isinstance(step, Call):
                    answer = yield step._replace(start=scaled(step.start), stop=scaled(step.stop))
                else:
                    answer = yield step._replace(fraction=scaled(step.fraction))
            except Exception as error:
                step = steps.throw(error)
            else:
                step = steps.send(answer)
    except StopIteration as end:
        return end.value
    finally:
        steps.close()


class Job(Generic[Arguments, Result]):
    """A function that runs a job to its end; `begin` returns the steps instead."""

    def __init__(self, begin: Callable[Arguments, Steps[Result]]) -> None:
        self.begin = begin
        update_wrapper(self, begin)

    def __call__(self, *args: Arguments.args, **kwargs: Arguments.kwargs) -> Result:
        return run(self.begin(*args, **kwargs))


def job(begin: Callable[Arguments, Steps[Result]]) -> Job[Arguments, Result]:
    """Turn a generator of steps into a function that runs them in place; see `Job`.

    Examples
    --------
    >>> @job
    ... def squares(count):
    ...     total = yield Call(sum, ([i * i for i in range(count)],))
    ...     return total
    >>> squares(4)
    14
    """
    return Job(begin)
