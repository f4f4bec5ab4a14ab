"""Steps that run between redraws; their calls are made by a helper process."""

from __future__ import annotations

import time
from collections.abc import Callable
from functools import partial
from typing import Any, NoReturn

from ..errors import RosyError
from ..worker.helper import Handle, Helper, HelperLostError
from ..worker.job import Call, Step, Steps


class SharedHelper:
    """The helper process of all live views. It makes one call at a time."""

    def __init__(self) -> None:
        self._helper = Helper()
        self._runner: StepRunner | None = None
        #: Whether a process can be started. Otherwise calls are made in Blender's process.
        self.is_usable = True

    def submit(self, call: Call, runner: StepRunner) -> Handle | None:
        """Let the process make a call; None if it works for another runner.

        Raises
        ------
        HelperLostError
            If it cannot be started.
        """
        if self._runner is not None:
            return None
        if not self.is_usable:
            raise HelperLostError("no helper process can be started", False)
        handle = self._helper.submit(call.function, *call.arguments)
        self._runner = runner
        return handle

    def release(self, runner: StepRunner) -> None:
        """Let others use the process, if a runner does."""
        if self._runner is runner:
            self._runner = None

    def close(self) -> None:
        """End the process."""
        self._runner = None
        self._helper.close()


class StepRunner:
    """Runs steps bit by bit: calls in a helper process, the rest in this process.

    Parameters
    ----------
    steps : Steps
    helper : SharedHelper

    Attributes
    ----------
    helper_seconds : float
        Seconds of work of the helper so far.
    is_done : bool
        Whether the steps have ended, with a result or an error.
    """

    def __init__(self, steps: Steps[Any], helper: SharedHelper) -> None:
        self.helper_seconds, self.is_done = 0.0, False
        self._steps, self._helper = steps, helper
        self._step: Step | None = None
        #: A call that the steps wait for, the helper's handle of it, and what returns or raises its result.
        self._call: Call | None = None
        self._handle: Handle | None = None
        self._outcome: Callable[[], Any] | None = None
        self._call_time = 0.0

    @property
    def step(self) -> Step | None:
        """What is done next; None before the first step."""
        if self._call is not None and self._call.label is None and self._handle is not None:
            return Step(self._handle.fraction, self._handle.label)
        return self._step

    @property
    def has_answer(self) -> bool:
        """Whether the helper has made a call, and the steps have not gone on yet."""
        return self._outcome is not None

    def poll(self) -> bool:
        """Return whether the steps can go on. Otherwise the helper is at work."""
        if self._call is None or self._outcome is not None:
            return True
        try:
            if self._handle is None:
                self._handle = self._helper.submit(self._call, self)
                self._call_time = time.monotonic()
            if self._handle is None or not self._handle.poll():
                return False
            self._outcome = self._handle.result
        except HelperLostError as error:
            if error.has_started:
                problem = f"{error}, as it does without enough memory: choose a smaller mesh"
                self._outcome = partial(_raise, RosyError(problem))
            else:
                self._helper.is_usable, self._outcome = False, self._call.__call__
        self._helper.release(self)
        self.helper_seconds += time.monotonic() - self._call_time
        return True

    def advance(self) -> Step:
        """Go on to the next step and return it. Call it only when the steps can go on.

        Raises
        ------
        StopIteration
            With the result, if the steps are done.
        """
        outcome, self._call, self._handle, self._outcome = self._outcome, None, None, None
        try:
            step = next(self._steps) if outcome is None else self._continued(outcome)
        except BaseException:
            self.is_done = True
            raise
        if isinstance(step, Call):
            self._call = step
            self._step = step = Step(step.start, step.label or "starting")
        else:
            self._step = step
        return step

    def _continued(self, outcome: Callable[[], Any]) -> Call | Step:
        """Send the steps the result or the error of their call."""
        try:
            answer = outcome()
        except Exception as error:
            return self._steps.throw(error)
        return self._steps.send(answer)

    def close(self) -> None:
        """Stop, and end the helper if it works for these steps."""
        if self._handle is not None:
            self._handle.cancel()
        self._helper.release(self)
        self._call = self._handle = self._outcome = None
        self._steps.close()


def _raise(error: Exception) -> NoReturn:
    raise error
