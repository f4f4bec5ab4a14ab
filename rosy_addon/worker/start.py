"""Start processes that run modules of this package. A process ends when the connection to it closes."""

import os
import signal
import subprocess
import sys
from collections.abc import Mapping, Sequence
from multiprocessing import connection
from multiprocessing.connection import Connection, Pipe
from pathlib import Path
from typing import Any

#: Name of this package in this process. It differs between Blender, a helper process and an installed wheel.
PACKAGE = __package__.rpartition(".")[0]

#: Name of this package in processes that `start_module` starts.
STARTED_PACKAGE = PACKAGE.rpartition(".")[2]


def start_module(
    module: str,
    *arguments: str,
    environment: Mapping[str, str] | None = None,
    group: int | None = None,
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
    group : int, optional
        Process group of the new process; 0: a new one. By default the group of this process. Windows has none.

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
                process_group=group,
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
