"""The program of a helper process: run function calls that the parent process sends, until that ends."""

import os
import pickle
import sys
import time
import traceback
from collections.abc import Callable
from typing import Any

from ..core.cache import BAKE_CACHE
from ..core.progress import listening
from .channel import Channel
from .pool import POOL
from .start import own_end

#: Seconds without a function call after which the caches of the helper process are cleared.
IDLE_SECONDS = 120.0

#: Seconds between two reports of progress.
REPORT_SECONDS = 0.05


class _Reporter:
    """A listener that sends progress to the parent process."""

    def __init__(self, channel: Channel) -> None:
        self._channel, self._next_time = channel, 0.0

    def __call__(self, fraction: float, label: str) -> None:
        now = time.monotonic()
        if now < self._next_time:
            return
        self._next_time = now + REPORT_SECONDS
        try:
            self._channel.send(("progress", fraction, label))
        except OSError:  # the parent has ended
            os._exit(1)


def main(handle: str, package: str) -> None:
    """Run the function calls that the parent process sends, until the parent ends.

    Parameters
    ----------
    handle : str
        Handle of this process's end of the connection to the parent.
    package : str
        Name of this package in the parent process.
    """
    channel = Channel(own_end(handle), package)
    reporter = _Reporter(channel)
    try:
        channel.send(("ready",))
        while True:
            if not channel.connection.poll(IDLE_SECONDS):
                BAKE_CACHE.clear()
                POOL.close()
                channel.connection.poll(None)
            answer = _answer(reporter, *channel.receive())
            try:
                channel.send(answer)
            except (pickle.PicklingError, TypeError, AttributeError) as error:
                channel.send(("error", RuntimeError(f"{type(error).__name__}: {error}"), ""))
            del answer
    except (EOFError, OSError):
        os._exit(0)


def _answer(reporter: _Reporter, function: Callable[..., Any], arguments: Any) -> tuple[Any, ...]:
    """Call a function, and return a message for the parent with its result or its error.

    It is ("result", result) or ("error", exception, text of the traceback).
    """
    try:
        with listening(reporter):
            return "result", function(*arguments)
    except Exception as error:
        return "error", error, traceback.format_exc()


if __name__ == "__main__":
    main(*sys.argv[1:])
