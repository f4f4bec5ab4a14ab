"""`Pool`: helper processes that share function calls, such as drawing the strips of a large picture."""

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
            The arguments of each call.
        count : int
            Number of processes, including this one. 0 means one per processor core.
        function_here : function, optional
            Function with the same results, for the calls in this process. For example, it may use a cache
            that exists only in this process. By default `function`.

        Returns
        -------
        list
            The results, in the order of the arguments.
        """
        helper_count = max(min(count or core_count(), len(arguments)) - 1, 0)
        while len(self.helpers) < helper_count:
            self.helpers.append(Helper(ENVIRONMENT))
        free = self.helpers[:helper_count]
        results: list[Any] = [None] * len(arguments)
        waiting = deque(range(len(arguments)))
        #: The number of the call of each busy helper.
        given: dict[Helper, int] = {}
        report = current_report()

        def attend_to_helpers() -> None:
            """Take results and give out waiting calls. The calls of lost helpers wait again."""
            for helper, number in list(given.items()):
                try:
                    outcome = helper.poll()
                    if outcome is not None:
                        free.append(helper)
                        del given[helper]
                        results[number] = outcome()
                except HelperLostError:
                    waiting.appendleft(number)
                    del given[helper]
            while waiting and free:
                helper = free.pop()
                with suppress(HelperLostError):
                    helper.submit(function, *arguments[waiting[0]])
                    given[helper] = waiting.popleft()

        def hear(fraction: float, label: str) -> None:
            """Report the progress of this process, and serve the helpers."""
            attend_to_helpers()
            done = len(arguments) - len(waiting) - len(given) - 1
            report((done + fraction) / len(arguments), label)

        try:
            while waiting or given:
                attend_to_helpers()
                if waiting:
                    number = waiting.popleft()
                    with listening(hear):
                        results[number] = (function_here or function)(*arguments[number])
                elif given:
                    wait([helper.connection for helper in given], WAIT_SECONDS)
                    hear(1.0, "waiting for other processes")
        except BaseException:
            for helper in given:
                helper.close()
            raise
        return results

    def close(self) -> None:
        """End all helper processes."""
        for helper in self.helpers:
            helper.close()
        self.helpers.clear()


#: The pool of helper processes of this process.
POOL = Pool()
