"""Starting processes, none of which outlives the one that started it.

A module of this package is started with one end of a connection, and ends with it (`start_module`). Other programs
are guarded (`guarded`): if this process ends, however it ends, a process that it has told of them kills them.
"""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from multiprocessing import connection
from multiprocessing.connection import Connection, Pipe
from pathlib import Path
from typing import Any

#: The name of this package, which differs between Blender, a helper and an installed wheel.
PACKAGE = __package__.rpartition(".")[0]

#: The same where a module of it is started.
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
        Of the program, after the handle of its end of the connection; see `own_end`.
    environment : mapping of str to str, optional
        Added to that of this process.

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


@contextmanager
def guarded(process: subprocess.Popen[Any]) -> Iterator[None]:
    """Have a process killed if this one ends within the ``with`` block, however it ends."""
    with suppress(OSError):  # without a guard, signals that can be handled still end it
        if _guard is None:
            _start_guard()
        _guard.send(("watch", process.pid))
    try:
        yield
    finally:
        with suppress(OSError, AttributeError):
            _guard.send(("leave", process.pid))


#: The connection to the process that watches others, once there are any.
_guard: Connection | None = None


def _start_guard() -> None:
    """Start the process that watches others. It ends with this one."""
    global _guard
    _, _guard = start_module("worker.start")


def _watch(guard: Connection) -> None:
    """Be told of processes until the other process ends, and kill those that are left."""
    if hasattr(signal, "SIGHUP"):
        signal.signal(signal.SIGHUP, signal.SIG_IGN)
    watched: set[int] = set()
    try:
        while True:
            what, pid = guard.recv()
            (watched.add if what == "watch" else watched.discard)(pid)
    except (EOFError, OSError):
        for pid in watched:
            with suppress(OSError):
                os.kill(pid, getattr(signal, "SIGKILL", signal.SIGTERM))


if __name__ == "__main__":
    _watch(own_end(sys.argv[1]))
