"""`Helper`: a process that makes long numeric calls for this one."""

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
    """Raised if a helper has ended before its work was done, or cannot be started.

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
    """The traceback of an error in a helper as text, set as the cause of the error in this process."""


class Helper:
    """A process that makes calls for this one, one at a time.

    It ends when this object is closed, and when this process ends for any reason.

    Parameters
    ----------
    environment : mapping of str to str
        Added to the environment of the process.

    Attributes
    ----------
    is_usable : bool
        Whether a process may be started. It is False once that has failed.
    fraction : float
        Progress of the last call, 0 to 1.
    label : str
        Label of the present step.
    """

    def __init__(self, environment: Mapping[str, str] | None = None) -> None:
        self.is_usable = True
        self.fraction, self.label = 0.0, "starting"
        self._user: object | None = None
        self._environment = dict(environment or {})
        self._process: subprocess.Popen[bytes] | None = None
        self._channel: Channel | None = None
        self._is_ready, self._start_time = False, 0.0
        #: A call that has not been sent.
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
        """Send a call of a function of this package to the process.

        Parameters
        ----------
        function : function
            A function of a module that needs no Blender.
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
        """Read messages of the process, without waiting.

        Returns
        -------
        callable or None
            Once the call is done: returns the result of the function, or raises its error.

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
        """Reserve the process for a user. Return whether it was free, or is already theirs."""
        if self._user is None:
            self._user = user
        return self._user is user

    def release(self, user: object) -> None:
        """Let others use the process, if a user has it."""
        if self._user is user:
            self._user = None

    def close(self) -> None:
        """End the process, even during a call."""
        process, channel = self._process, self._channel
        self._process = self._channel = None
        if process is not None:
            process.kill()
            process.wait()
        if channel is not None:
            channel.close()

    def wait(self, seconds: float) -> None:
        """Wait for a message of the process or its end, at most for some seconds."""
        if self.connection is not None:
            wait([self.connection], seconds)

    @property
    def connection(self) -> Connection | None:
        """Connection that becomes readable when the process has sent a message, or has ended."""
        return None if self._channel is None else self._channel.connection

    @property
    def pid(self) -> int | None:
        """ID of the process, if it runs."""
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
        """End the process, and return the error that says why it is lost."""
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
