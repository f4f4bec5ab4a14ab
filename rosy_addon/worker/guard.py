"""The program of a guard process: kill programs and remove a folder when the parent process has ended.

It imports as little as possible, because each `Lifeline` has a guard process.
"""

import os
import shutil
import signal
import sys
import time
from contextlib import suppress
from multiprocessing.connection import Connection

from .start import own_end

#: Seconds for which a folder is removed again and again if processes that were killed still write to it.
REMOVE_SECONDS = 1.0


def main(handle: str) -> None:
    """Wait until the parent ends. Then kill the process group of this process, and remove folders.

    The parent sends the paths of folders (str) and, on Windows, where there are no groups, the IDs of processes
    (int). It may interrupt the group as soon as this process has sent a message.

    Parameters
    ----------
    handle : str
        Handle of this process's end of the connection to the parent.
    """
    end = own_end(handle)
    for name in ("SIGHUP", "SIGTERM"):
        if hasattr(signal, name):
            signal.signal(getattr(signal, name), signal.SIG_IGN)
    items = _items_until_the_end(end)
    if sys.platform != "win32":
        group = os.getpgrp()
        if os.fork():
            os.wait()  # the child kills this process with its group
            return
        os.setpgid(0, 0)
        kill_group(group)
    for item in items:
        if isinstance(item, str):
            remove_folder(item)
        else:
            with suppress(OSError):
                os.kill(item, signal.SIGTERM)


def _items_until_the_end(end: Connection) -> list[int | str]:
    """Wait until the parent ends, and return the items that it has sent (see `main`)."""
    items: list[int | str] = []
    with suppress(OSError):  # the parent has ended already, but what it has sent is still there
        end.send("ready")
    with suppress(EOFError, OSError):
        while True:
            items.append(end.recv())
    return items


def kill_group(group: int) -> None:
    """Kill all processes of a group. Windows has no groups."""
    if sys.platform != "win32":
        with suppress(OSError):  # there is none
            os.killpg(group, signal.SIGKILL)


def remove_folder(folder: str) -> None:
    """Remove a folder. Processes that were killed may still write to it for some milliseconds."""
    deadline = time.monotonic() + REMOVE_SECONDS
    while os.path.exists(folder) and time.monotonic() < deadline:
        shutil.rmtree(folder, ignore_errors=True)


if __name__ == "__main__":
    main(*sys.argv[1:])
