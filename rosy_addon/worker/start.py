"""Start processes that end when the process that started them ends.

`start_module` starts a module of this package with one end of a connection. The new process ends when the
connection closes. Other programs and temporary folders are registered with a guard process. It kills or
removes them when this process ends for any reason.
"""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import sys
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from multiprocessing import connection
from multiprocessing.connection import Connection, Pipe
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

#: Name of this package in this process. It differs between Blender, a helper process and an installed wheel.
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
        Name of the module, relative to this package.
    *arguments : str
        Arguments of the program after the first one. The first one is added: the handle of the program's end
        of the connection, for `own_end`.
    environment : mapping of str to str, optional
        Variables for the new process, in addition to the environment of this process.

    Returns
    -------
    process : subprocess.Popen
    connection : Connection
        The end of the connection that belongs to this process.

    Raises
    ------
    OSError
        If no process can be started.
    """
    # The program searches the same folders for imports as this process, in the same order, and then this
    # package.
    folders = [*sys.path, str(Path(__file__).parents[2])]
    end, other_end = Pipe()
    try:
        with other_end:
            process = subprocess.Popen(
                [sys.executable, "-s", "-S", "-P", "-m", f"{STARTED_PACKAGE}.{module}"]
                + [str(other_end.fileno()), *arguments],
                env=os.environ | {"PYTHONPATH": os.pathsep.join(folders)} | (environment or {}),
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
                creationflags=getattr(subprocess, "CREATE_NO_WINDOW", 0),
                **inheriting([other_end.fileno()]),
            )
    except OSError:
        end.close()
        raise
    return process, end


def inheriting(handles: Sequence[int]) -> dict[str, Any]:
    """Return the keyword arguments of `subprocess.Popen` with which a process inherits handles.

    `handles` are file descriptors; on Windows, they are handles of the system.
    """
    if sys.platform != "win32":
        return {"pass_fds": tuple(handles)}
    for handle in handles:
        os.set_handle_inheritable(handle, True)
    return {"startupinfo": subprocess.STARTUPINFO(lpAttributeList={"handle_list": handles})}


def own_end(handle: str) -> Connection:
    """Return the end of the connection that belongs to this process, which `start_module` has started.

    `handle` is the first argument of the program.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C reaches all processes of a terminal
    kind = connection.PipeConnection if sys.platform == "win32" else connection.Connection
    return kind(int(handle))


@contextmanager
def guarded(process: subprocess.Popen[Any]) -> Iterator[None]:
    """Context manager: kill another process if it still runs after the block.

    It is also killed if this process ends during the block, for any reason.
    """
    _tell_guard("watch", process.pid)
    try:
        yield
    finally:
        process.kill()  # does nothing if it has ended
        process.wait()
        _tell_guard("leave", process.pid)


class GuardedFolder(TemporaryDirectory[str]):
    """A temporary folder. It is removed even if this process is killed."""

    def __init__(self) -> None:
        super().__init__(prefix="rosy-")
        _tell_guard("watch", self.name)

    def cleanup(self) -> None:
        """Remove the folder."""
        super().cleanup()
        _tell_guard("leave", self.name)


#: The connection to the guard process; None before the guard process is started.
_guard: Connection | None = None


def _tell_guard(what: str, item: int | str) -> None:
    """Tell the guard process to watch a process or a folder, or to stop watching it.

    The guard process is started if it does not run.

    Parameters
    ----------
    what : {"watch", "leave"}
    item : int or str
        ID of the process, or path of the folder.
    """
    global _guard
    with suppress(OSError):  # without a guard, cleanup still works unless this process is killed
        if _guard is None:
            _, _guard = start_module("worker.start")
        _guard.send((what, item))


def _watch(guard: Connection) -> None:
    """Run the guard process: note processes and folders until the parent ends, then kill and remove them."""
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
