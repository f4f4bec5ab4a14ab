"""`Pool`: the helpers that a large picture is divided among."""

from __future__ import annotations

import os
from collections import deque
from collections.abc import Callable, Sequence
from multiprocessing.connection import wait
from typing import Any

from ..progress import current_report, listening
from .helper import Handle, Helper, HelperLostError

#: Environment of the helpers. Each has one core.
ENVIRONMENT = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1", "MKL_NUM_THREADS": "1"}

#: Seconds without news after which helpers are asked again.
WAIT_SECONDS = 0.5


def core_count() -> int:
    """Return the number of processor cores that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


class Pool:
    """Helpers of this process. They are started when they are first needed, and stay for the next call.

    Attributes
    ----------
    helpers : list of Helper
    """

    def __init__(self) -> None:
        self.helpers: list[Helper] = []

    def map(
        self, function: Callable[..., Any], arguments: Sequence[tuple[Any, ...]], count: int = 0
    ) -> list[Any]:
        """Call a function with each of several tuples of arguments, in several processes.

        This process is one of them. What a helper does not finish is done here.

        Parameters
        ----------
        function : function
            Of a module that needs no Blender, as `Helper.submit`.
        arguments : sequence of tuple
        count : int
            Number of processes; 0 is one for each core.

        Returns
        -------
        list
            The results, in the order of the arguments.
        """
        waiting = deque(range(len(arguments)))
        results: list[Any] = [None] * len(arguments)
        busy: dict[Helper, tuple[int, Handle]] = {}
        lost: set[Helper] = set()
        helper_count = min(count or core_count(), len(arguments)) - 1
        while len(self.helpers) < helper_count:
            self.helpers.append(Helper(ENVIRONMENT))

        report_here = current_report()

        def collect() -> None:
            """Take what helpers have done, and give them what is waiting."""
            for helper in self.helpers[: max(helper_count, 0)]:
                if helper in lost:
                    continue
                try:
                    if helper in busy:
                        index, handle = busy[helper]
                        if not handle.poll():
                            continue
                        del busy[helper]
                        results[index] = handle.result()
                    if waiting:
                        index = waiting.popleft()
                        busy[helper] = index, helper.submit(function, *arguments[index])
                        busy[helper][1].poll()
                except HelperLostError:
                    lost.add(helper)
                    waiting.appendleft(busy.pop(helper)[0] if helper in busy else index)

        def hear(fraction: float, label: str) -> None:
            """Report the work of this process, and attend to the helpers."""
            collect()
            done = len(arguments) - len(waiting) - len(busy) - 1
            report_here((done + fraction) / len(arguments), label)

        try:
            while waiting or busy:
                collect()
                if waiting:
                    index = waiting.popleft()
                    with listening(hear):
                        results[index] = function(*arguments[index])
                elif busy:
                    hear(1.0, "waiting for other processes")
                    wait([helper.connection for helper in busy], WAIT_SECONDS)
        except BaseException:
            for _, handle in busy.values():
                handle.cancel()
            raise
        return results

    def close(self) -> None:
        """End all helpers."""
        for helper in self.helpers:
            helper.close()
        self.helpers.clear()


#: The helpers of this process.
POOL = Pool()
