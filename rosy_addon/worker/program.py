"""Run another program as part of a job."""

import subprocess
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path

from ..core.errors import RosyError
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


@job
def run_encoder(command: Sequence[str], failure: str, result: Path | None = None) -> Steps[None]:
    """Run a program that encodes a video, with `run_program`.

    Parameters
    ----------
    command : sequence of str
        The program and its arguments.
    failure : str
        Start of the error message if the program fails. It ends with the last line that the program printed.
    result : Path, optional
        The file that the program must have written.

    Raises
    ------
    RosyError
        If the program fails.
    """
    status, output = yield from run_program.begin(command, "encoding the video")
    if status or (result is not None and not result.is_file()):
        message = (output.strip().splitlines() or ["it failed"])[-1]
        raise RosyError(f"{failure}: {message}")
