"""`Helper`: a process that computes for this one."""

from __future__ import annotations

import subprocess
import time
from collections.abc import Callable, Mapping
from functools import partial
from multiprocessing.connection import Connection, wait
from typing import Any

from .channel import Channel
from .start import PACKAGE, STARTED_PACKAGE, start_module

#: Seconds that a helper may take until it is ready.
START_SECONDS = 60.0

#: Seconds for which large results are received at a time.
RECEIVE_SECONDS = 0.03


class HelperLostError(Exception):
    """A helper has ended before its work was done, or cannot be started.

    Attributes
    ----------
    has_started : bool
        Whether the helper was ready before.
    """

    def __init__(self, message: str, has_started: bool) -> None:
        super().__init__(message, has_started)
        self.has_started = has_started

    def __str__(self) -> str:
        return self.args[0]


class _RemoteTracebackError(Exception):
    """The traceback of an error in a helper, as text. The cause of that error here."""


class Helper:
    """A process that computes for this one, a call at a time.

    It ends when this object is closed, and when this process ends, however it ends.

    Parameters
    ----------
    environment : mapping of str to str
        Added to the environment of the process.

    Attributes
    ----------
    is_usable : bool
        Whether a process may be started. It is False once that has failed.
    fraction : float
        How far the last call has come.
    label : str
        What is being done.
    """

    def __init__(self, environment: Mapping[str, str] | None = None) -> None:
        self.is_usable = True
        self.fraction, self.label = 0.0, "starting"
        self._user: object | None = None
        self._environment = dict(environment or {})
        self._process: subprocess.Popen[bytes] | None = None
        self._channel: Channel | None = None
        self._is_ready, self._start_time = False, 0.0
        #: A call that is not sent yet.
        self._call: tuple[Callable[..., Any], tuple[Any, ...]] | None = None

    def start(self) -> None:
        """Start the process if it does not run, without waiting until it is ready.

        Raises
        ------
        HelperLostError
            If it cannot be started.
        """
        if self._process is not None and self._process.poll() is None:
            return
        self.close()
        if not self.is_usable:
            raise HelperLostError("no helper process is wanted, or none can be started", False)
        try:
            self._process, connection = start_module(
                "worker", PACKAGE, environment=self._environment
            )
        except OSError as error:
            raise HelperLostError(f"no helper process can be started: {error}", False) from None
        self._channel = Channel(connection, STARTED_PACKAGE)
        self._is_ready, self._start_time = False, time.monotonic()

    def submit(self, function: Callable[..., Any], *arguments: Any) -> None:
        """Let the process call a function of this package.

        Parameters
        ----------
        function : function
            Of a module that needs no Blender.
        *arguments
            Anything that can be pickled.

        Raises
        ------
        HelperLostError
            If the process has ended, or cannot be started.
        """
        self.start()
        self.fraction, self.label = 0.0, "starting"
        self._call = function, arguments
        try:
            self._send_call()
        except (EOFError, OSError):
            raise self._lost() from None

    def poll(self) -> Callable[[], Any] | None:
        """Hear what the process says, without waiting.

        Returns
        -------
        callable or None
            Once the call is done: returns what the function has returned, or raises what it has raised.

        Raises
        ------
        HelperLostError
            If the process has ended. The call may be submitted again.
        """
        channel = self._channel
        if channel is None:
            raise self._lost()
        try:
            if not self._send_call():
                return None
            while channel.has_received(RECEIVE_SECONDS):
                kind, *content = channel.receive()
                if kind != "progress":
                    return partial(_outcome, kind, *content)
                self.fraction, self.label = content
        except (EOFError, OSError):
            raise self._lost() from None
        return None

    def take(self, user: object) -> bool:
        """Reserve the process for one of several users, and return whether nobody else has it."""
        if self._user is None:
            self._user = user
        return self._user is user

    def release(self, user: object) -> None:
        """Let others use the process, if a user has it."""
        if self._user is user:
            self._user = None

    def close(self) -> None:
        """End the process, whatever it does."""
        process, channel = self._process, self._channel
        self._process = self._channel = None
        if process is not None:
            process.kill()
            process.wait()
        if channel is not None:
            channel.close()

    def wait(self, seconds: float) -> None:
        """Wait until the process has something to say, or ends, at most for some time."""
        if self.connection is not None:
            wait([self.connection], seconds)

    @property
    def connection(self) -> Connection | None:
        """What becomes readable when the process has something to say, or ends."""
        return None if self._channel is None else self._channel.connection

    @property
    def pid(self) -> int | None:
        """Of the process, if it runs."""
        return None if self._process is None else self._process.pid

    def _send_call(self) -> bool:
        """Send the call once the process is ready. Return whether it has been sent."""
        if not self._is_ready and self._channel.poll():
            self._channel.receive()
            self._is_ready = True
        if not self._is_ready and time.monotonic() - self._start_time > START_SECONDS:
            raise EOFError
        if self._is_ready and self._call is not None:
            self._channel.send(self._call)
            self._call = None
        return self._call is None

    def _lost(self) -> HelperLostError:
        """End what is left of the process, and return what is wrong."""
        has_started, process = self._is_ready, self._process
        self.close()
        status = "" if process is None else f" (status {process.returncode})"
        what = "has ended" if has_started else "cannot be started"
        return HelperLostError(f"the helper process {what}{status}", has_started)


def _outcome(kind: str, answer: Any, traceback: str = "") -> Any:
    """Return a result, or raise an error that has this traceback in the helper."""
    if kind == "error":
        raise answer from _RemoteTracebackError(f"\n{traceback}")
    return answer


#: The helper of Blender's windows; see `ui.helper_start`.
HELPER = Helper()
