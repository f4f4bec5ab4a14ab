"""`run_program`: runs another program as part of a job."""

from __future__ import annotations

import subprocess
from collections.abc import Sequence
from contextlib import suppress

from .job import Step, Steps, job
from .lifeline import Lifeline

#: Longest wait for the end of the program in each step of the job, in seconds.
WAIT_SECONDS = 0.02


@job
def run_program(command: Sequence[str], label: str) -> Steps[tuple[int, str]]:
    """Run a program and wait for its end. It is killed if the job is cancelled.

    Parameters
    ----------
    command : sequence of str
        The program and its arguments.
    label : str
        Text for the progress bar.

    Returns
    -------
    status : int
        Exit status of the program.
    output : str
        Standard output and standard error of the program.
    """
    with Lifeline() as lifeline, open(lifeline.folder / "log", "w+b") as log:
        process = lifeline.start(command, stdout=log, stderr=subprocess.STDOUT)
        while process.poll() is None:
            yield Step(0.0, label)
            with suppress(subprocess.TimeoutExpired):
                process.wait(WAIT_SECONDS)
        log.seek(0)
        return process.returncode, log.read().decode(errors="replace")
