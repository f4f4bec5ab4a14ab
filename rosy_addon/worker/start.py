"""Processes that end with the process that started them.

A module of this package is started with one end of a connection, and ends when the connection closes
(`start_module`). Other programs and temporary folders are guarded: a guard process kills or removes them when
this process ends for any reason.
"""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import sys
from collections.abc import Mapping
from contextlib import suppress
from multiprocessing import connection
from multiprocessing.connection import Connection, Pipe
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

#: Name of this package in this process. It differs between Blender, a helper and an installed wheel.
PACKAGE = __package__.rpartition(".")[0]

#: Name of this package in processes that `start_module` starts.
STARTED_PACKAGE = PACKAGE.rpartition(".")[2]


def start_module(
    module: str, *arguments: str, environment: Mapping[str, str] | None = None
) -> tuple[subprocess.Popen[bytes], Connection]:
    """Start a module of this package as a program, with one end of a connection.

    Parameters
    ----------
    module : str
        Relative to this package.
    *arguments : str
        Further arguments of the program. The first is the handle of its end of the connection; see `own_end`.
    environment : mapping of str to str, optional
        Variables that are added to the environment of this process.

    Returns
    -------
    process : subprocess.Popen
    connection : Connection
        The other end.

    Raises
    ------
    OSError
        If no process can be started.
    """
    # The program imports what this process imports, in the same order, and this package.
    folders = [*sys.path, str(Path(__file__).parents[2])]
    end, other_end = Pipe()
    options: dict[str, Any] = {}
    if sys.platform == "win32":
        os.set_handle_inheritable(other_end.fileno(), True)
        handles = {"handle_list": [other_end.fileno()]}
        options["startupinfo"] = subprocess.STARTUPINFO(lpAttributeList=handles)
        options["creationflags"] = subprocess.CREATE_NO_WINDOW
    else:
        options["pass_fds"] = [other_end.fileno()]
    try:
        with other_end:
            process = subprocess.Popen(
                [sys.executable, "-s", "-S", "-P", "-m", f"{STARTED_PACKAGE}.{module}"]
                + [str(other_end.fileno()), *arguments],
                env=os.environ | {"PYTHONPATH": os.pathsep.join(folders)} | (environment or {}),
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
                **options,
            )
    except OSError:
        end.close()
        raise
    return process, end


def own_end(handle: str) -> Connection:
    """Return this end of the connection of a program that `start_module` has started."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C reaches all processes of a terminal
    kind = connection.PipeConnection if sys.platform == "win32" else connection.Connection
    return kind(int(handle))


class Guarded:
    """A ``with`` block during which a process is killed if this one ends for any reason.

    Parameters
    ----------
    process : subprocess.Popen
    """

    def __init__(self, process: subprocess.Popen[Any]) -> None:
        self._pid = process.pid

    def __enter__(self) -> None:
        _tell_guard("watch", self._pid)

    def __exit__(self, *_: object) -> None:
        _tell_guard("leave", self._pid)


class GuardedFolder(TemporaryDirectory[str]):
    """A temporary folder that is removed even if this process is killed."""

    def __init__(self) -> None:
        super().__init__(prefix="rosy-")
        _tell_guard("watch", self.name)

    def cleanup(self) -> None:
        """Remove the folder."""
        super().cleanup()
        _tell_guard("leave", self.name)


#: The connection to the guard process; None before there is one.
_guard: Connection | None = None


def _tell_guard(what: str, item: int | str) -> None:
    """Send a message about a process or a folder to the guard, which is started when it is first needed."""
    global _guard
    with suppress(OSError):  # without a guard, signals that can be handled still end what there is
        if _guard is None:
            _, _guard = start_module("worker.start")
        _guard.send((what, item))


def _watch(guard: Connection) -> None:
    """Receive processes and folders until the other process ends; then kill and remove what is left."""
    if hasattr(signal, "SIGHUP"):
        signal.signal(signal.SIGHUP, signal.SIG_IGN)
    watched: set[int | str] = set()
    with suppress(EOFError, OSError):
        while True:
            what, item = guard.recv()
            (watched.add if what == "watch" else watched.discard)(item)
    for item in watched:
        if isinstance(item, str):
            shutil.rmtree(item, ignore_errors=True)
            continue
        with suppress(OSError):
            os.kill(item, getattr(signal, "SIGKILL", signal.SIGTERM))


if __name__ == "__main__":
    _watch(own_end(sys.argv[1]))
