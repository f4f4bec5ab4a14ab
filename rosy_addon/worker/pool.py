"""`Pool`: helper processes that share function calls, such as drawing the strips of a large picture."""

from __future__ import annotations

import os
from collections import deque
from collections.abc import Callable, Sequence
from contextlib import suppress
from multiprocessing.connection import wait
from typing import Any

from ..core.progress import current_report, listening
from .helper import Helper, HelperLostError

#: Environment variables of the helper processes, with which numpy uses one core in each.
ENVIRONMENT = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1", "MKL_NUM_THREADS": "1"}

#: Longest wait for messages of helper processes, in seconds. Progress is reported after each wait.
WAIT_SECONDS = 0.5


def core_count() -> int:
    """Return the number of processor cores that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


class Pool:
    """A pool of helper processes. They are started when they are first needed, and reused later.

    Attributes
    ----------
    helpers : list of Helper
    """

    def __init__(self) -> None:
        self.helpers: list[Helper] = []

    def map(
        self,
        function: Callable[..., Any],
        arguments: Sequence[tuple[Any, ...]],
        count: int = 0,
        function_here: Callable[..., Any] | None = None,
    ) -> list[Any]:
        """Call a function with each of several tuples of arguments, in several processes.

        This process is one of them. If a helper process is lost, another process repeats its call.

        Parameters
        ----------
        function : function
            A function of a module that needs no Blender; see `Helper.submit`.
        arguments : sequence of tuple
        count : int
            Number of processes. 0 means one per processor core.
        function_here : function, optional
            Function for the calls in this process, such as the same one with a cache of the caller. By
            default `function`.

        Returns
        -------
        list
            The results, in the order of the arguments.
        """
        helper_count = max(min(count or core_count(), len(arguments)) - 1, 0)
        while len(self.helpers) < helper_count:
            self.helpers.append(Helper(ENVIRONMENT))
        helpers = self.helpers[:helper_count]
        return _SharedCalls(helpers, function, arguments, function_here or function).make()

    def close(self) -> None:
        """End all helper processes."""
        for helper in self.helpers:
            helper.close()
        self.helpers.clear()


class _SharedCalls:
    """Function calls that are shared between this process and some helper processes."""

    def __init__(
        self,
        helpers: Sequence[Helper],
        function: Callable[..., Any],
        arguments: Sequence[tuple[Any, ...]],
        function_here: Callable[..., Any],
    ) -> None:
        self._function, self._arguments = function, arguments
        self._function_here = function_here
        self._results: list[Any] = [None] * len(arguments)
        #: Indices of the calls that have not started, and the index of the call of each busy helper process.
        self._waiting = deque(range(len(arguments)))
        self._given: dict[Helper, int] = {}
        self._free = list(helpers)
        self._report = current_report()

    def make(self) -> list[Any]:
        """Make all calls, and return their results in order."""
        try:
            while self._waiting or self._given:
                self._attend_to_helpers()
                if self._waiting:
                    number = self._waiting.popleft()
                    with listening(self._hear):
                        self._results[number] = self._function_here(*self._arguments[number])
                elif self._given:
                    wait([helper.connection for helper in self._given], WAIT_SECONDS)
                    self._hear(1.0, "waiting for other processes")
        except BaseException:
            for helper in self._given:
                helper.close()
            raise
        return self._results

    def _hear(self, fraction: float, label: str) -> None:
        """Report the total progress, and attend to the helper processes.

        Called when this process reports its own.
        """
        self._attend_to_helpers()
        done = len(self._arguments) - len(self._waiting) - len(self._given) - 1
        self._report((done + fraction) / len(self._arguments), label)

    def _attend_to_helpers(self) -> None:
        """Receive results of helper processes, and give free ones waiting calls.

        Calls of lost helpers wait again.
        """
        for helper, number in list(self._given.items()):
            try:
                outcome = helper.poll()
                if outcome is not None:
                    self._free.append(helper)
                    del self._given[helper]
                    self._results[number] = outcome()
            except HelperLostError:
                self._waiting.appendleft(number)
                del self._given[helper]
        while self._waiting and self._free:
            helper = self._free.pop()
            with suppress(HelperLostError):
                helper.submit(self._function, *self._arguments[self._waiting[0]])
                self._given[helper] = self._waiting.popleft()


#: The pool of helper processes of this process.
POOL = Pool()
