"""Running another program."""

from __future__ import annotations

import subprocess
import tempfile
from collections.abc import Sequence

from .progress import report

#: Seconds between two reports.
POLL_SECONDS = 0.05


def run_process(command: Sequence[str], label: str) -> tuple[int, str]:
    """Run a program and wait for its end. An exception, as of a listener that cancels, kills it.

    Parameters
    ----------
    command : sequence of str
        The program and its arguments.
    label : str
        What the program does, for the progress.

    Returns
    -------
    status : int
        Exit status.
    output : str
        What the program printed, errors included.
    """
    with tempfile.TemporaryFile() as log:
        process = subprocess.Popen(
            command, stdin=subprocess.DEVNULL, stdout=log, stderr=subprocess.STDOUT
        )
        try:
            while process.poll() is None:
                report(0.0, label)
                try:
                    process.wait(POLL_SECONDS)
                except subprocess.TimeoutExpired:
                    continue
        finally:
            if process.poll() is None:
                process.kill()
                process.wait()
        log.seek(0)
        return process.returncode, log.read().decode(errors="replace")
