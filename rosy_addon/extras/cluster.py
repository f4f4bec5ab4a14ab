"""Running a command for many frames on the workers of a Dask cluster."""

from __future__ import annotations

import subprocess
import time
from collections.abc import Iterator, Sequence
from typing import Any

from ..errors import RosyError
from ..frame_workers import error_line, format_frames

#: Frames of one task. Several, because starting Blender takes as long as several frames.
FRAMES_PER_TASK = 8

#: How many times Dask may run a task again that failed on a worker.
MAX_RETRIES = 3


def run_on_cluster(command: Sequence[str], frames: Sequence[int], address: str) -> Iterator[str]:
    """Run a command for all frames on the workers of a Dask cluster.

    Workers need the same program and files under the same paths. If a worker is lost, its frames
    are given to another one. If a task of several frames fails, its frames are run again one by
    one.

    Parameters
    ----------
    command : sequence of str
        Without ``--frames``, which is added.
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
    with client:
        frames = list(frames)
        pending = {}

        def submit(chunk: list[int]) -> Any:
            text = format_frames(chunk)
            future = client.submit(
                subprocess.run,
                [*command, f"--frames={text}"],
                capture_output=True,
                text=True,
                key=f"rosy-{text}-{time.time_ns()}",
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
            if not worker_lost and not future.result().returncode:
                yield from future.result().stdout.splitlines()
            elif len(chunk) > 1:
                # Run the frames one by one, to find the one that fails and to complete the others.
                for frame in chunk:
                    futures.add(submit([frame]))
            else:
                cause = (
                    repr(future.exception())
                    if worker_lost
                    else error_line(future.result().stderr.splitlines())
                )
                failures.append((chunk[0], cause))
    if failures:
        raise RosyError("; ".join(f"frame {frame}: {cause}" for frame, cause in sorted(failures)))
