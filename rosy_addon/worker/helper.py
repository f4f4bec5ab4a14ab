"""`Helper`: a process that runs function calls for this one."""

import subprocess
import time
from collections.abc import Callable, Mapping
from functools import partial
from multiprocessing.connection import Connection, wait
from typing import Any

from .channel import Channel
from .lifeline import PROCESS_LIFELINE
from .start import PACKAGE, STARTED_PACKAGE, start_module

#: Seconds after which a helper process that is not ready counts as lost.
START_SECONDS = 60.0

#: Seconds for which one call of `Helper.poll` receives parts of a large result.
RECEIVE_SECONDS = 0.03


class HelperLostError(Exception):
    """An error: a helper process has ended before its work was done, or cannot be started.

    Attributes
    ----------
    has_started : bool
        Whether the process had started and was ready for calls.
    """

    def __init__(self, message: str, has_started: bool) -> None:
        super().__init__(message)
        self.has_started = has_started


class _RemoteTracebackError(Exception):
    """The traceback of an error in a helper process, as text.

    This process raises the error again, with this exception as its ``__cause__``.
    """


class Helper:
    """A helper process, which runs function calls for this process, one at a time.

    The helper process ends when this object is closed, and when this process ends for any reason.

    Parameters
    ----------
    environment : mapping of str to str
        Variables that are added to the environment of the helper process.

    Attributes
    ----------
    is_usable : bool
        Whether a helper process may be started. It is set to False if none is wanted, or if that has failed.
    fraction : float
        Progress of the last call, 0 to 1.
    label : str
        What the last call is doing, as text for a progress bar.
    """

    def __init__(self, environment: Mapping[str, str] | None = None) -> None:
        self.is_usable = True
        self.fraction, self.label = 0.0, "starting"
        self._user: object | None = None
        self._environment = dict(environment or {})
        self._process: subprocess.Popen[bytes] | None = None
        self._channel: Channel | None = None
        self._is_ready, self._start_time = False, 0.0
        #: The function and arguments of a call that was not sent yet; None if all were sent.
        self._call: tuple[Callable[..., Any], tuple[Any, ...]] | None = None

    def start(self) -> None:
        """Start the helper process if it does not run. Do not wait until it is ready.

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
                "worker", PACKAGE, environment=self._environment, group=PROCESS_LIFELINE.group
            )
        except OSError as error:
            raise HelperLostError(f"no helper process can be started: {error}", False) from None
        self._channel = Channel(connection, STARTED_PACKAGE)
        self._is_ready, self._start_time = False, time.monotonic()

    def submit(self, function: Callable[..., Any], *arguments: Any) -> None:
        """Let the helper process call a function of this package. `poll` returns the outcome.

        Parameters
        ----------
        function : function
            A function of a module that needs no Blender.
        *arguments
            Its arguments, which are pickled.

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
        """Read the messages of the helper process, without waiting for them.

        Returns
        -------
        callable or None
            None while the call runs. Once it is done, a function without arguments that returns the result of
            the call, or raises its error.

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
        """Reserve the helper process for a user (any object), if it is not reserved yet.

        Return whether it is now reserved for this user.
        """
        if self._user is None:
            self._user = user
        return self._user is user

    def release(self, user: object) -> None:
        """Give up the reservation of the helper process, if it is reserved for this user."""
        if self._user is user:
            self._user = None

    def close(self) -> None:
        """End the helper process, even during a call."""
        process, channel = self._process, self._channel
        self._process = self._channel = None
        if process is not None:
            process.kill()
            process.wait()
        if channel is not None:
            channel.connection.close()

    def wait(self, seconds: float) -> None:
        """Wait for a message of the helper process, or for its end, at most for some seconds."""
        if self.connection is not None:
            wait([self.connection], seconds)

    @property
    def connection(self) -> Connection | None:
        """Connection to the helper process; readable if it has sent a message or ended. None if none runs."""
        return None if self._channel is None else self._channel.connection

    @property
    def pid(self) -> int | None:
        """Process ID of the helper process; None if none was started."""
        return None if self._process is None else self._process.pid

    def _send_call(self) -> bool:
        """Send the call if the helper process is ready. Return whether it has been sent, now or before."""
        if not self._is_ready and self._channel.connection.poll():
            self._channel.receive()
            self._is_ready = True
        if not self._is_ready and time.monotonic() - self._start_time > START_SECONDS:
            raise EOFError
        if self._is_ready and self._call is not None:
            self._channel.send(self._call)
            self._call = None
        return self._call is None

    def _lost(self) -> HelperLostError:
        """End the helper process, and return the error that says why it is lost."""
        has_started, process = self._is_ready, self._process
        self.close()
        status = "" if process is None else f" (status {process.returncode})"
        what = "has ended" if has_started else "cannot be started"
        return HelperLostError(f"the helper process {what}{status}", has_started)


def _outcome(kind: str, answer: Any, traceback: str = "") -> Any:
    """Return the result of a function call in the helper process, or raise its error.

    Parameters
    ----------
    kind : {"result", "error"}
    answer : object
        The result, or the exception.
    traceback : str
        Traceback of the exception in the helper process. It becomes the ``__cause__`` of the exception.
    """
    if kind == "error":
        raise answer from _RemoteTracebackError(f"\n{traceback}")
    return answer


#: The helper process that all jobs in Blender's windows share.
HELPER = Helper()
