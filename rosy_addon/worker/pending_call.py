"""`PendingCall`: a call of a job that a helper makes."""

from __future__ import annotations

from typing import Any

from ..errors import RosyError
from .helper import Helper, HelperLostError
from .job import Call, Step


class PendingCall:
    """A call that a helper makes. If the helper ends before it is done, another one makes it once more.

    Parameters
    ----------
    call : Call
    helper : Helper

    Raises
    ------
    HelperLostError
        If no helper can be started.
    """

    def __init__(self, call: Call, helper: Helper) -> None:
        self.call = call
        self._helper = helper
        self._is_repeated = False
        self._handle = helper.submit(call.function, *call.arguments)

    def poll(self) -> bool:
        """Return whether the call is done, without waiting.

        Raises
        ------
        HelperLostError
            If no helper can be started.
        RosyError
            If the helper has ended twice.
        """
        try:
            return self._handle.poll()
        except HelperLostError as lost:
            if not lost.has_started:
                raise
            if self._is_repeated:
                raise RosyError(
                    "the process that computes has ended twice, as it does without enough memory: "
                    "choose a smaller size or a smaller mesh"
                ) from lost
        self._is_repeated = True
        self._handle = self._helper.submit(self.call.function, *self.call.arguments)
        return False

    @property
    def progress(self) -> Step:
        """How far the job has come."""
        start, stop, label = self.call.start, self.call.stop, self.call.label
        handle = self._handle
        fraction = start + (stop - start) * handle.fraction
        return Step(fraction, handle.label if label is None else label)

    def result(self) -> Any:
        """Return what the function has returned, or raise what it has raised, once the call is done."""
        return self._handle.result()

    def cancel(self) -> None:
        """End the helper at once, if the call is not done."""
        self._handle.cancel()
