"""`StepRunner`: runs a job step by step, with its function calls in a helper process."""

import time
from collections.abc import Callable
from typing import Any, NoReturn

from ..core.errors import RosyError
from .helper import Helper, HelperLostError
from .job import Call, Step, Steps, advance


class StepRunner:
    """Runs a job step by step. Function calls run in a helper process, the rest in this process.

    Several runners may share a helper process, which runs one call at a time. If the helper process is lost
    during a call, a new one repeats the call, once. If no helper process can be started, the call runs in
    this process.

    Parameters
    ----------
    steps : Steps
        The generator of the job.
    helper : Helper
        The helper process.

    Attributes
    ----------
    step : Step or None
        Progress and label of the job; None before the first step.
    helper_seconds : float
        Seconds that the helper process has worked for the job so far.
    is_done : bool
        Whether the job has ended, with a result or an error.
    is_in_place : bool
        Whether the next `advance` runs a function call in this process, as there is no helper process.
    """

    def __init__(self, steps: Steps[Any], helper: Helper) -> None:
        self.step: Step | None = None
        self.helper_seconds, self.is_done, self.is_in_place = 0.0, False, False
        self._steps, self._helper = steps, helper
        #: The call that the job waits for, and its outcome: a function that returns the result or raises the
        #: error.
        self._call: Call | None = None
        self._outcome: Callable[[], Any] | None = None
        #: Whether the helper process has the call, since when (`time.monotonic`), and whether it is the
        #: second try.
        self._is_submitted, self._call_time, self._is_repeated = False, 0.0, False

    @property
    def has_answer(self) -> bool:
        """Whether the result of a call has arrived, and the job has not continued with it yet."""
        return self._outcome is not None

    def poll(self) -> bool:
        """Return at once whether the job can continue, or must wait for a result of the helper process."""
        if self._call is None or self._outcome is not None:
            return True
        try:
            if not self._is_submitted:
                if not self._helper.take(self):
                    return False
                self._helper.submit(self._call.function, *self._call.arguments)
                self._is_submitted, self._call_time = True, time.monotonic()
            self._outcome = self._helper.poll()
            call, helper = self._call, self._helper
            fraction = call.start + (call.stop - call.start) * helper.fraction
            self.step = Step(fraction, helper.label if call.label is None else call.label)
            if self._outcome is None:
                return False
        except HelperLostError as lost:
            if lost.has_started and not self._is_repeated:
                self._is_submitted, self._is_repeated = False, True
                return False
            if lost.has_started:
                self._outcome = _raise_lost
            else:
                self._helper.is_usable, self.is_in_place = False, True
                self._outcome = self._call
        self._helper.release(self)
        self.helper_seconds += time.monotonic() - self._call_time
        return True

    def advance(self) -> Step:
        """Run the job to its next step, and return that. Call this only after `poll` has returned True.

        Raises
        ------
        StopIteration
            If the job has ended. Its value is the result of the job.
        """
        outcome, self._call, self._outcome = self._outcome, None, None
        self.is_in_place = self._is_submitted = self._is_repeated = False
        try:
            step = advance(self._steps, outcome)
        except BaseException:
            self.is_done = True
            raise
        if isinstance(step, Call):
            self._call = step
            self.step = Step(step.start, step.label or "starting")
        else:
            self.step = step
        return self.step

    def close(self) -> None:
        """Cancel the job, and end the helper process if it works for the job."""
        if self._is_submitted and self._outcome is None:
            self._helper.close()
        self._helper.release(self)
        self._call = self._outcome = None
        self._steps.close()


def _raise_lost() -> NoReturn:
    raise RosyError(
        "the process that computes has ended twice, as it does without enough memory: choose a smaller "
        "size or a smaller mesh"
    )
