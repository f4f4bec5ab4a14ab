"""`StepRunner`: runs the steps of a job one by one, with their calls in a helper process."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any, NoReturn

from ..core.errors import RosyError
from .helper import Helper, HelperLostError
from .job import Call, Step, Steps, advance


class StepRunner:
    """Run steps one by one: calls in a helper process, the rest in this process.

    Several runners may share a helper, which makes one call at a time. A call whose helper is lost is made
    once more by another one; if none can be started, it is made in this process.

    Parameters
    ----------
    steps : Steps
    helper : Helper

    Attributes
    ----------
    step : Step or None
        Progress of the steps; None before the first one.
    helper_seconds : float
        Seconds of work of the helper so far.
    is_done : bool
        Whether the steps have ended, with a result or an error.
    is_in_place : bool
        Whether the next step makes a call in this process, as there is no helper.
    """

    def __init__(self, steps: Steps[Any], helper: Helper) -> None:
        self.step: Step | None = None
        self.helper_seconds, self.is_done, self.is_in_place = 0.0, False, False
        self._steps, self._helper = steps, helper
        #: A call that the steps wait for, and what returns or raises its result.
        self._call: Call | None = None
        self._outcome: Callable[[], Any] | None = None
        #: Whether the helper has the call, since when (seconds, monotonic), and whether it is the second try.
        self._is_submitted, self._call_time, self._is_repeated = False, 0.0, False

    @property
    def has_answer(self) -> bool:
        """Whether the result of a call is there, and the steps have not continued with it."""
        return self._outcome is not None

    def poll(self) -> bool:
        """Return whether the steps can continue. Otherwise the helper is at work."""
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
        """Run to the next step and return it. Call it only after `poll` has returned True.

        Raises
        ------
        StopIteration
            With the result, if the steps are done.
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
        """Stop, and end the helper if it works for these steps."""
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
