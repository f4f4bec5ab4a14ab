"""Jobs: generators that read data, have results computed, and apply them.

A job yields each long computation as a `Call` (a function with arguments) and receives its result. In a
script, the function is called in the same process (`run`). In Blender's window, a helper process calls it, so
that Blender stays responsive.
"""

from collections.abc import Callable, Generator, Iterable, Iterator
from functools import update_wrapper
from typing import Any, Generic, NamedTuple, ParamSpec, TypeVar

from ..core.progress import progress, report

Item = TypeVar("Item")
Result = TypeVar("Result")
Arguments = ParamSpec("Arguments")


class Call(NamedTuple):
    """A function call that a job yields to receive its result. The function must not need Blender.

    Attributes
    ----------
    function : function
    arguments : tuple
        Arguments of the function, which can be pickled.
    start, stop : float
        Progress of the job when the call begins and when it ends, 0 to 1.
    label : str or None
        Label of the progress. None: the labels that the function reports are used.
    """

    function: Callable[..., Any]
    arguments: tuple[Any, ...]
    start: float = 0.0
    stop: float = 1.0
    label: str | None = None

    def __call__(self) -> Any:
        """Call the function in this process, and return its result."""
        with progress(self.start, self.stop, self.label):
            return self.function(*self.arguments)


class Step(NamedTuple):
    """A pause that a job yields while it works in Blender's process: on the graphics card or between frames.

    Attributes
    ----------
    fraction : float
        Progress of the job, 0 to 1.
    label : str
        What the job does next, as text for a progress bar.
    """

    fraction: float
    label: str

    def __call__(self) -> None:
        """Report the progress."""
        report(self.fraction, self.label)


#: A running job: a generator that yields calls and pauses, and to which the results of calls are sent. To
#: close the generator cancels the job.
Steps = Generator[Call | Step, Any, Result]


def advance(steps: Steps[Any], outcome: Callable[[], Any] | None = None) -> Call | Step:
    """Run a job up to its next call or step, and return it.

    Parameters
    ----------
    steps : Steps
    outcome : callable, optional
        Function that returns the result of the last call, or raises its error, which is then raised in the
        job. None when the job begins, or after a `Step`.

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
    """Return the steps of a job that consists of one function call and returns its result."""
    return (yield Call(function, arguments))


def part(steps: Steps[Result], start: float, stop: float, label: str = "") -> Steps[Result]:
    """Run a job as a part of another job (with ``yield from``), and return its result.

    Parameters
    ----------
    steps : Steps
    start, stop : float
        Progress of the whole job when the part begins and when it ends, 0 to 1.
    label : str, optional
        Label of all steps of the part. By default they have their own labels.
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


def reverting(steps: Steps[Result], revert: Callable[[], object]) -> Steps[Result]:
    """Return the steps of a job that calls `revert` if it does not end with a result.

    It may have failed or been cancelled, also before its first step. Use this for changes that were made
    before the job begins.
    """

    def guarded() -> Steps[Result]:
        try:
            yield Step(0.0, "starting")
            return (yield from steps)
        except BaseException:
            revert()
            raise

    guard = guarded()
    next(guard)  # to close a generator that has not started would not run its `except`
    return guard


def shares(items: Iterable[Item], stop: float = 1.0) -> Iterator[tuple[Item, float, float]]:
    """Iterate over what a job works on, each item with the progress of the job when it begins and ends.

    Parameters
    ----------
    items : iterable
        All items take the same share of the job.
    stop : float
        Progress of the job when the last item ends, 0 to 1.
    """
    items = list(items)
    for index, item in enumerate(items):
        yield item, stop * index / len(items), stop * (index + 1) / len(items)


class Job(Generic[Arguments, Result]):
    """A function that runs a job to its end and returns its result.

    Its attribute `begin` is the generator function: it returns the steps of the job, and runs none of them.
    """

    def __init__(self, begin: Callable[Arguments, Steps[Result]]) -> None:
        self.begin = begin
        update_wrapper(self, begin)

    def __call__(self, *args: Arguments.args, **kwargs: Arguments.kwargs) -> Result:
        return run(self.begin(*args, **kwargs))


def job(begin: Callable[Arguments, Steps[Result]]) -> Job[Arguments, Result]:
    """Decorator: turn a generator function into a function that runs the job in this process; see `Job`.

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
