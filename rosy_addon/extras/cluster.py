"""Running a command for many frames on the workers of a Dask cluster."""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from typing import Any

from ..core.errors import RosyError
from ..worker.frame_workers import error_line, format_frames

#: Frames of one task. Several, because starting Blender takes as long as several frames.
FRAMES_PER_TASK = 8

#: How many times Dask may run a task again that failed on a worker.
MAX_RETRIES = 3


#: Name of the package, which workers have as well.
PACKAGE = __package__.split(".")[0]


def run_on_cluster(arguments: Sequence[str], frames: Sequence[int], address: str) -> Iterator[str]:
    """Run a command of RoSy for all frames on the workers of a Dask cluster.

    Workers run it with their own Python, in which RoSy is installed. Files have the same paths on all
    machines. If a worker is lost, its frames are given to another one. If a task of several frames
    fails, its frames are run again one by one. If this process ends early, workers stop.

    Parameters
    ----------
    arguments : sequence of str
        Of the command, without ``--frames``, which is added.
    frames : sequence of int
    address : str
        Address of the scheduler.

    Yields
    ------
    str
        Lines of the output of each task that succeeded.

    Raises
    ------
    RosyError
        If Dask is not installed, the scheduler does not answer, or frames failed. Failed frames are
        reported after all others have ended, each with its number and its error.
    """
    try:
        from distributed import Client, as_completed
    except ImportError:
        raise RosyError("--scheduler needs Dask: pip install distributed") from None
    try:
        client = Client(address)
    except (OSError, ValueError) as reason:
        raise RosyError(f"--scheduler {address}: cannot connect: {reason}") from None
    failures = []

    # Dask sends a local function by value, so that the scheduler does not need RoSy.
    def run_chunk(package: str, arguments: list[str], key: str) -> tuple[int, str, str]:
        """Run the command on a worker, and return its exit status, output and errors."""
        import subprocess
        import sys

        from distributed import get_worker

        tasks = get_worker().state.tasks
        with subprocess.Popen(
            [sys.executable, "-m", package, *arguments],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            errors="replace",
        ) as process:
            # If the client ends, it does not want the result any more.
            while key in tasks and tasks[key].state != "cancelled":
                try:
                    output, errors = process.communicate(timeout=1.0)
                    return process.returncode, output, errors
                except subprocess.TimeoutExpired:
                    continue
            process.terminate()
            output, errors = process.communicate()
            return process.returncode, output, errors

    with client:
        frames = list(frames)
        pending = {}

        def submit(chunk: list[int]) -> Any:
            text = format_frames(chunk)
            key = f"rosy-{text}-{time.time_ns()}"
            future = client.submit(
                run_chunk,
                PACKAGE,
                [*arguments, f"--frames={text}"],
                key,
                key=key,
                retries=MAX_RETRIES,
                pure=False,
            )
            pending[future] = chunk
            return future

        chunks = [
            frames[start : start + FRAMES_PER_TASK]
            for start in range(0, len(frames), FRAMES_PER_TASK)
        ]
        futures = as_completed([submit(chunk) for chunk in chunks])
        for future in futures:
            chunk = pending.pop(future)
            worker_lost = future.status == "error"
            status, output, errors = (1, "", "") if worker_lost else future.result()
            if not status:
                yield from output.splitlines()
            elif len(chunk) > 1:
                # Run the frames one by one, to find the one that fails and to complete the others.
                for frame in chunk:
                    futures.add(submit([frame]))
            else:
                cause = repr(future.exception()) if worker_lost else error_line(errors.splitlines())
                failures.append((chunk[0], cause))
    if failures:
        raise RosyError("; ".join(f"frame {frame}: {cause}" for frame, cause in sorted(failures)))
