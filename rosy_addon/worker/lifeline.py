"""`Lifeline`: programs and a temporary folder that end with this process."""

import os
import secrets
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from contextlib import AbstractContextManager, ExitStack, suppress
from functools import cached_property
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

from ..core.errors import RosyError
from ..core.file_io import folder_lock, os_error_text
from .guard import kill_group, remove_folder
from .start import start_module

#: Age in seconds from which a folder that is not locked counts as abandoned. It is locked right after it is created.
ABANDONED_SECONDS = 60.0

#: Longest wait in seconds until the guard process has started. It takes some ten milliseconds.
START_SECONDS = 1.0


class Lifeline(AbstractContextManager["Lifeline"]):
    """Programs and a temporary folder that end with this process, even if it is killed.

    A guard process has one end of a connection to this process, and leads a process group. Programs join the
    group while they are started, and the programs that these start are in it too. When this process ends, for
    whatever reason, the connection closes, and the guard process kills the group and removes the folder. The end
    of the block does so too. On Windows, which has no groups, only the programs themselves are killed.

    Examples
    --------
    >>> with Lifeline() as lifeline:
    ...     with open(lifeline.folder / "log", "wb") as log:
    ...         status = lifeline.start([sys.executable, "--version"], stdout=log).wait()
    >>> status
    0
    """

    def __init__(self) -> None:
        self._processes: list[subprocess.Popen[bytes]] = []
        self._folder: Path | None = None
        self._lock = ExitStack()

    @cached_property
    def _guard(self) -> tuple[subprocess.Popen[bytes], Connection]:
        """The guard process, which is started when it is first needed, and the connection to it."""
        return start_module("worker.guard", group=0)

    @property
    def group(self) -> int:
        """ID of the process group, for `start_module`. An `OSError` is raised if there can be no guard process."""
        return self._guard[0].pid

    @property
    def folder(self) -> Path:
        """The temporary folder, created on first access. Programs use it, too (environment variable TMPDIR).

        Raises
        ------
        RosyError
            If it cannot be created.
        """
        if self._folder is not None:
            return self._folder
        try:
            parent = Path(tempfile.gettempdir())
            _remove_abandoned_folders(parent)
            self._folder = parent / f"rosy-{secrets.token_hex(8)}"
            self._tell_guard(str(self._folder))
            self._folder.mkdir(mode=0o700)
            self._lock.enter_context(folder_lock(self._folder, exclusive=True))
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
            self._guard[1].poll(START_SECONDS)  # until the guard process ignores interrupts
            with suppress(OSError):
                os.killpg(self.group, signal.SIGINT)
        deadline = time.monotonic() + seconds
        with suppress(subprocess.TimeoutExpired, KeyboardInterrupt):
            for process in self._processes:
                process.wait(max(deadline - time.monotonic(), 0.0))

    def __exit__(self, *_: object) -> None:
        """Kill the programs that still run, and remove the folder."""
        if "_guard" not in vars(self):  # nothing was started
            return
        self._guard[1].close()
        for process in (*self._processes, self._guard[0]):
            process.kill()  # does nothing if it has ended
            process.wait()
        kill_group(self.group)
        if self._folder is not None:
            remove_folder(str(self._folder))
        self._lock.close()

    def _tell_guard(self, item: int | str) -> None:
        """Tell the guard process what to clean up when this process ends.

        `item` is the ID of a process to kill, or the path of a folder to remove.
        """
        connection = self._guard[1]
        with suppress(OSError):  # without a guard process, only `__exit__` cleans up
            connection.send(item)


def _remove_abandoned_folders(parent: Path) -> None:
    """Remove the temporary folders of processes that were killed together with their guard processes."""
    for folder in parent.glob("rosy-" + 16 * "[0-9a-f]"):
        with suppress(OSError):  # another process may remove it, or it is of another user
            if time.time() - folder.stat().st_mtime > ABANDONED_SECONDS:
                with folder_lock(folder, exclusive=True) as is_abandoned:
                    if is_abandoned:
                        remove_folder(str(folder))


#: The lifeline of the helper processes, and of a temporary folder that exists as long as this process.
PROCESS_LIFELINE = Lifeline()
