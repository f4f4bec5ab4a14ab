"""Frames spread over processes of this machine, or over the workers of a Dask cluster.

Both run the very command that a user would run for some frames, which may be run again, or twice at
once, without harm. Nothing here knows how a frame is made.
"""

from __future__ import annotations

import os
import queue
import re
import subprocess
import sys
import threading
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from .errors import RosyError

#: Frames that one worker does in one go: a Blender takes as long to start as for several frames.
CHUNK = 8

#: How often a worker may be lost with a frame before the frame counts as failed.
RETRIES = 3


def frame_range(text: str) -> Sequence[int]:
    """The frames of ``A``, ``A-B`` or ``A-B:STEP``, or of several of these with commas between.

    Raises
    ------
    RosyError
        If it is none of these, or holds no frame.
    """
    parts = [_one_range(part.strip(), text) for part in text.split(",")]
    return parts[0] if len(parts) == 1 else sorted(set().union(*parts))


def _one_range(part: str, text: str) -> range:
    match = re.fullmatch(r"(-?\d+)(?:-(-?\d+))?(?::(\d+))?", part)
    first = int(match[1]) if match else 0
    last = int(match[2]) if match and match[2] else first
    step = int(match[3]) if match and match[3] else 1
    if match is None or last < first or not step:
        raise RosyError(f"frames '{text}': A, A-B or A-B:STEP is wanted, such as 1-250 or 1-250:10")
    return range(first, last + 1, step)


def own_command(blender: str, scene: Path) -> list[str]:
    """How this program is started on a Blender file: in Blender if it has one, else in Python.

    Parameters
    ----------
    blender : str
        Path of Blender's program; empty in Python.
    scene : Path
    """
    if blender:
        return [blender, "-b", str(scene), "--command", "rosy", "bake"]
    return [sys.executable, "-m", "rosy_addon", "bake", str(scene)]


def environment() -> dict[str, str]:
    """That of the processes: they find this package, and keep to one thread each."""
    inside = str(Path(__file__).resolve().parents[1])
    paths = [inside, *filter(None, [os.environ.get("PYTHONPATH")])]
    return {**os.environ, "PYTHONPATH": os.pathsep.join(paths), "OMP_NUM_THREADS": "1"}


def run_here(command: Sequence[str], frames: Sequence[int], count: int) -> Iterator[str]:
    """Run a command for every frame, on so many processes at once.

    Each has every count-th frame, so that slow stretches are shared.

    Yields
    ------
    str
        What the processes say, line by line.

    Raises
    ------
    RosyError
        If one of them fails, after all have ended, with what it said.
    """
    count = max(min(count, len(frames)), 1)
    running = []
    for number in range(count):
        own = frames[number::count]
        running.append((own, _start([*command, "--frames", frames_text(own)])))
    # All of them are listened to at once: one whose words nobody takes would wait.
    said: queue.Queue[tuple[int, str | None]] = queue.Queue()
    for number, (_, process) in enumerate(running):
        threading.Thread(target=_listen, args=(number, process, said), daemon=True).start()
    words: list[list[str]] = [[] for _ in running]
    speaking = len(running)
    try:
        while speaking:
            number, line = said.get()
            if line is None:
                speaking -= 1
            else:
                words[number].append(line)
                yield line
        failed = [
            f"frames {frames_text(own)}: {_last_line(words[number])}"
            for number, (own, process) in enumerate(running)
            if process.wait()
        ]
    finally:
        for _, process in running:
            if process.poll() is None:
                process.terminate()
    if failed:
        raise RosyError("; ".join(failed))


def _listen(number: int, process: subprocess.Popen, said: queue.Queue) -> None:
    """Pass on what a process says, and None when it is done."""
    for line in process.stdout:
        said.put((number, line.rstrip("\n")))
    said.put((number, None))


def run_on_cluster(command: Sequence[str], frames: Sequence[int], address: str) -> Iterator[str]:
    """Run a command for every frame on the workers of a Dask cluster.

    Workers need the same program and files under the same paths. A frame whose worker is lost goes to
    another one.

    Parameters
    ----------
    command : sequence of str
    frames : sequence of int
    address : str
        Of the scheduler.

    Yields
    ------
    str
        What each frame's process says.

    Raises
    ------
    RosyError
        If Dask is not installed, there is no scheduler, or frames failed, after all others have
        ended: each with its number and reason.
    """
    try:
        from distributed import Client, as_completed
    except ImportError:
        raise RosyError("--scheduler needs Dask: pip install distributed") from None
    try:
        client = Client(address, timeout="20s")
    except (OSError, ValueError) as reason:
        raise RosyError(f"--scheduler {address}: no answer: {reason}") from None
    failed = []
    with client:
        frames = list(frames)
        waiting = {}

        def submit(some: list[int]) -> Any:
            text = frames_text(some)
            task = client.submit(
                subprocess.run,
                [*command, "--frames", text],
                capture_output=True,
                text=True,
                key=f"rosy-{text}-{time.time_ns()}",
                retries=RETRIES,
                pure=False,
            )
            waiting[task] = some
            return task

        chunks = [frames[start : start + CHUNK] for start in range(0, len(frames), CHUNK)]
        running = as_completed([submit(chunk) for chunk in chunks])
        for done in running:
            some = waiting.pop(done)
            broken = done.status == "error"
            if not broken and not done.result().returncode:
                yield from done.result().stdout.splitlines()
            elif len(some) > 1:
                # Which of them it was, and the others.
                for frame in some:
                    running.add(submit([frame]))
            else:
                why = (
                    repr(done.exception())
                    if broken
                    else _last_line(done.result().stderr.splitlines())
                )
                failed.append((some[0], why))
    if failed:
        raise RosyError("; ".join(f"frame {frame}: {why}" for frame, why in sorted(failed)))


def frames_text(frames: Sequence[int]) -> str:
    """Frames as the command line takes them."""
    if len(frames) == 1 or not isinstance(frames, range):
        return ",".join(map(str, frames))
    return f"{frames[0]}-{frames[-1]}" + (f":{frames.step}" if frames.step > 1 else "")


def _start(command: list[str]) -> subprocess.Popen:
    return subprocess.Popen(
        command,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        env=environment(),
        stdin=subprocess.DEVNULL,
    )


def _last_line(said: Sequence[str]) -> str:
    """What an error is, of all that a process has said."""
    lines = [line for line in said if line.strip()]
    said = [line for line in lines if line.startswith("rosy: ")]
    last = (said or lines or ["ended without a word"])[-1].removeprefix("rosy: ")
    return re.sub(r"^frame -?\d+: ", "", last)
