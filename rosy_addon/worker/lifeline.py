"""`Lifeline`: programs and a temporary folder that end with this process."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from contextlib import suppress
from functools import cached_property
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

from ..core.errors import RosyError
from ..core.file_io import os_error_text, remove_leftovers, temporary_name
from .guard import kill_group, remove_folder
from .start import start_module

#: Longest wait in seconds until the guard process has started. It takes some ten milliseconds.
START_SECONDS = 1.0


class Lifeline:
    """Programs and a temporary folder that end with this process, even if it is killed.

    A guard process has one end of a connection to this process, and leads a process group. Programs join the
    group while they are started, and the programs that these start are in it too. When this process ends, for
    whatever reason, the connection closes, and the guard process kills the group and removes the folder. So does
    `close`. On Windows, which has no groups, only the programs themselves are killed.

    Examples
    --------
    >>> with Lifeline() as lifeline:
    ...     with open(lifeline.folder / "log", "wb") as log:
    ...         status = lifeline.start([sys.executable, "--version"], stdout=log).wait()
    >>> status
    0
    """

    def __init__(self) -> None:
        self._guard: tuple[subprocess.Popen[bytes], Connection] | None = None
        self._processes: list[subprocess.Popen[bytes]] = []
        self._folder: Path | None = None

    def __enter__(self) -> Lifeline:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    @cached_property
    def group(self) -> int:
        """ID of the process group, for `start_module`; 0 if the guard process cannot be started."""
        with suppress(OSError):
            self._guard = start_module("worker.guard", group=0)
            return self._guard[0].pid
        return 0

    @property
    def folder(self) -> Path:
        """The temporary folder. It is created when it is first used. Programs use it as theirs.

        Raises
        ------
        RosyError
            If it cannot be created.
        """
        if self._folder is not None:
            return self._folder
        try:
            parent = tempfile.gettempdir()
            remove_leftovers(parent)
            self._folder = Path(parent, temporary_name())
            self._tell_guard(str(self._folder))
            self._folder.mkdir(mode=0o700)
        except OSError as error:
            reason = os_error_text(error)
            raise RosyError(
                f"no temporary folder can be created: {reason}: set TMPDIR to a folder that can be written to"
            ) from error
        return self._folder

    def start(self, command: Sequence[str], **options: Any) -> subprocess.Popen[bytes]:
        """Start a program, without input, and return its process.

        Parameters
        ----------
        command : sequence of str
            The program and its arguments.
        **options
            Further arguments of `subprocess.Popen`. ``env`` contains only variables that are added to the
            environment of this process.

        Raises
        ------
        OSError
            If the program cannot be started.
        RosyError
            If the temporary folder cannot be created.
        """
        options["env"] = os.environ | {"TMPDIR": str(self.folder)} | options.get("env", {})
        options |= {"stdin": subprocess.DEVNULL, "process_group": self.group}
        process = subprocess.Popen(command, **options)
        self._processes.append(process)
        if sys.platform == "win32":
            self._tell_guard(process.pid)
        return process

    def interrupt(self, seconds: float) -> None:
        """Interrupt the programs, as Ctrl-C does, and wait up to some seconds for their end."""
        if sys.platform != "win32":  # there, Ctrl-C has reached the programs already
            if self._guard is not None:
                self._guard[1].poll(START_SECONDS)  # until the guard process ignores interrupts
            for group in self._groups():
                with suppress(OSError):
                    os.killpg(group, signal.SIGINT)
        deadline = time.monotonic() + seconds
        with suppress(subprocess.TimeoutExpired, KeyboardInterrupt):
            for process in self._processes:
                process.wait(max(deadline - time.monotonic(), 0.0))

    def close(self) -> None:
        """Kill the programs that still run, and remove the folder."""
        processes = list(self._processes)
        if self._guard is not None:
            processes.append(self._guard[0])
            self._guard[1].close()
        for process in processes:
            process.kill()  # does nothing if it has ended
            process.wait()
        if sys.platform != "win32":
            for group in self._groups():
                kill_group(group)
        if self._folder is not None:
            remove_folder(str(self._folder))

    def _groups(self) -> list[int]:
        """Return the process groups of the programs. Without a guard process, each program has its own."""
        return [process.pid for process in self._processes] if self._guard is None else [self.group]

    def _tell_guard(self, item: int | str) -> None:
        """Let the guard process end a program or remove a folder, given its ID or path, with this process."""
        with suppress(OSError):  # without a guard process, `close` still does so
            if self.group and self._guard is not None:
                self._guard[1].send(item)


#: The lifeline of the helper processes of this process. It is never closed.
PROCESS_LIFELINE = Lifeline()
