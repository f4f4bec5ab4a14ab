"""Processes of this machine, as Linux lists them."""

import os
import time
from collections.abc import Callable
from pathlib import Path

#: Seconds within which processes end after the one that started them, if they have a core.
END_SECONDS = 2.0


def is_running(pid: int) -> bool:
    """Whether a process exists and is not a zombie."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


def marked_processes(mark: str) -> dict[int, str]:
    """Return the processes whose environment contains a text: the command of each number."""
    found = {}
    for folder in Path("/proc").iterdir():
        try:
            if mark.encode() in (folder / "environ").read_bytes() and is_running(int(folder.name)):
                words = (folder / "cmdline").read_bytes().split(b"\0")
                found[int(folder.name)] = b" ".join(words).decode(errors="replace")
        except (OSError, ValueError):
            continue
    return found


def becomes_true(condition: Callable[[], bool], seconds: float = END_SECONDS) -> bool:
    """Wait until a condition is true, but not for longer than some seconds. Return whether it is.

    If more processes run than there are cores, it waits longer in proportion.
    """
    share = max(os.getloadavg()[0] / (os.cpu_count() or 1), 1.0)
    deadline = time.monotonic() + seconds * share
    while not (is_true := condition()) and time.monotonic() < deadline:
        time.sleep(0.02)
    return is_true


def all_end(mark: str) -> bool:
    """Wait for the end of all processes whose environment contains a text. Return whether they have ended.

    They are listed twice, as the list may lack a process that was started while it was made.
    """
    return becomes_true(lambda: not (marked_processes(mark) or marked_processes(mark)))
