"""Parse frame ranges, and run a command for many frames in several processes.

Each process runs the same command for some of the frames. It must be safe to run the command again, or twice
at the same time. This module does not depend on what the command does.
"""

import re
import reprlib
import subprocess
import time
from collections.abc import Iterator, Sequence
from pathlib import Path

from ..core.errors import RosyError
from .lifeline import Lifeline

#: Largest frame number in Blender.
MAX_FRAME = 1_048_574

#: Seconds between two looks at the output of the processes.
POLL_SECONDS = 0.05

#: Seconds after an interrupt until a process that still runs is killed.
STOP_SECONDS = 1.0


def parse_frames(text: str) -> Sequence[int]:
    """Parse frame numbers written as ``A``, ``A-B`` or ``A-B:STEP``, or several of these with commas between.

    Returns
    -------
    sequence of int
        Frame numbers in ascending order, without duplicates.

    Raises
    ------
    RosyError
        If the text has another form, or a range is empty.

    Examples
    --------
    >>> parse_frames("1-3")
    range(1, 4)
    >>> parse_frames("1-9:4,2")
    [1, 2, 5, 9]
    """
    parts = [_parse_range(part.strip(), text) for part in text.split(",")]
    return parts[0] if len(parts) == 1 else sorted(set().union(*parts))


def _parse_range(part: str, text: str) -> range:
    """Parse one ``A``, ``A-B`` or ``A-B:STEP``. `text` is the whole text of the user, for messages."""
    match = re.fullmatch(r"(?a)(-?\d{1,7})(?:-(-?\d{1,7}))?(?::(\d{1,7}))?", part)
    if match:
        first, last, step = int(match[1]), int(match[2] or match[1]), int(match[3] or 1)
        if -MAX_FRAME <= first <= last <= MAX_FRAME and step:
            return range(first, last + 1, step)
    raise RosyError(
        f"frames {reprlib.repr(text)}: expected A, A-B or A-B:STEP, such as 1-250 or 1-250:10, "
        f"with B from A to {MAX_FRAME}"
    )


def run_local(command: Sequence[str], frames: Sequence[int], process_count: int) -> Iterator[str]:
    """Run a command for all frames, in several processes of this machine.

    Process i of n gets the frames with the indices i, i + n, i + 2 n and so on, so that slow parts of an
    animation are shared evenly. If the generator is closed, the processes are interrupted.

    Parameters
    ----------
    command : sequence of str
        The command and its arguments. An argument ``--frames=...`` is added.
    frames : sequence of int
        Frame numbers.
    process_count : int
        Number of processes. At least one is started, and no more than there are frames.

    Yields
    ------
    str
        Lines of the output of all processes, in the order in which they arrive.

    Raises
    ------
    RosyError
        If a process failed. It is raised after all processes have ended, with the error of each.
    """
    process_count = max(min(process_count, len(frames)), 1)
    workers: list[_Worker] = []
    with Lifeline() as lifeline:
        try:
            for index in range(process_count):
                log = lifeline.folder / f"{index}.log"
                workers.append(_Worker(lifeline, command, frames[index::process_count], log))
            running = list(workers)
            while running:
                # Output is read after this check, so the output of an ended process is complete.
                ended = [worker for worker in running if worker.process.poll() is not None]
                for worker in running:
                    yield from worker.new_lines()
                running = [worker for worker in running if worker not in ended]
                time.sleep(POLL_SECONDS if running else 0.0)
        except BaseException:
            lifeline.interrupt(STOP_SECONDS)
            raise
        finally:
            for worker in workers:
                worker.log.close()
    failures = [
        f"frames {format_frames(worker.frames)}: {error_line(worker.lines)}"
        for worker in workers
        if worker.process.returncode
    ]
    if failures:
        raise RosyError("; ".join(failures))


class _Worker:
    """A process that runs a command for some frames, and writes its output and errors to a file.

    A file can be read without blocking on every operating system. Pipes would need threads on some.

    Attributes
    ----------
    frames : sequence of int
        Frame numbers that the process works on.
    process : subprocess.Popen
    log : binary file
    lines : list of str
        Lines of output that were read so far.
    """

    def __init__(
        self, lifeline: Lifeline, command: Sequence[str], frames: Sequence[int], log: Path
    ) -> None:
        self.frames, self.lines = frames, []
        with log.open("wb") as output:
            self.process = lifeline.start(
                [*command, f"--frames={format_frames(frames)}"],
                stdout=output,
                stderr=subprocess.STDOUT,
                env={"OMP_NUM_THREADS": "1"},
            )
        self.log = log.open("rb")
        self._partial_line = b""

    def new_lines(self) -> list[str]:
        """Return the lines that the process has printed since the last call.

        Once the process has ended, this includes a last line without a line break.
        """
        *lines, self._partial_line = (self._partial_line + self.log.read()).split(b"\n")
        if self.process.returncode is not None and self._partial_line:
            lines.append(self._partial_line)
            self._partial_line = b""
        texts = [line.decode(errors="replace").rstrip("\r") for line in lines]
        self.lines += texts
        return texts


def format_frames(frames: Sequence[int]) -> str:
    """Write frames in the form that `parse_frames` reads."""
    if len(frames) == 1 or not isinstance(frames, range):
        return ",".join(map(str, frames))
    return f"{frames[0]}-{frames[-1]}" + (f":{frames.step}" if frames.step > 1 else "")


def error_line(output: Sequence[str]) -> str:
    """Return the error message in the output of a failed command.

    It is the last line that begins with ``rosy:``. If there is none, it is the last line that is not empty.
    """
    lines = [line for line in output if line.strip()]
    error_lines = [line for line in lines if line.startswith("rosy: ")]
    message = (error_lines or lines or ["ended without output"])[-1].removeprefix("rosy: ")
    return re.sub(r"^frame -?\d+: ", "", message)
