"""Run a command for many frames on the workers of a Dask cluster."""

from collections.abc import Callable, Generator, Iterator, Sequence
from typing import Any

from ..core.errors import RosyError
from ..worker.frame_workers import error_line, format_frames

#: Number of frames per task. There are several, because to start Blender takes as long as several frames.
FRAMES_PER_TASK = 8

#: How often Dask may repeat a task whose worker was lost.
MAX_RETRIES = 3

#: Name of the package, which is also installed on workers.
PACKAGE = __package__.split(".")[0]


def run_on_cluster(arguments: Sequence[str], frames: Sequence[int], address: str) -> Iterator[str]:
    """Run a command of RoSy for all frames on the workers of a Dask cluster.

    Workers run the command with their own Python, in which RoSy must be installed. Files must have the
    same paths on all machines. If a worker is lost, another worker gets its frames. If a task fails, its
    frames are repeated one by one, so that only bad frames are missing. If this process ends early, the
    workers stop.

    Parameters
    ----------
    arguments : sequence of str
        Arguments of the command. ``--frames`` is added to them.
    frames : sequence of int
    address : str
        Address of the scheduler.

    Yields
    ------
    str
        Lines of output of the tasks that succeeded.

    Raises
    ------
    RosyError
        If Dask is not installed, the scheduler does not answer, or frames failed. Failed frames are
        reported after all others have ended, each with its number and its error.
    """
    try:
        from distributed import Client
    except ImportError:
        raise RosyError("--scheduler needs Dask: pip install distributed") from None
    try:
        client = Client(address)
    except (OSError, ValueError) as reason:
        raise RosyError(f"--scheduler {address}: cannot connect: {reason}") from None
    starts = range(0, len(frames), FRAMES_PER_TASK)
    tasks = [tuple(frames[start : start + FRAMES_PER_TASK]) for start in starts]
    with client:
        failed = yield from _run_tasks(client, arguments, tasks)
        single_frames = [(frame,) for task in failed for frame in task]
        failed = yield from _run_tasks(client, arguments, single_frames)
    if failed:
        causes = [f"frame {frame}: {cause}" for (frame,), cause in sorted(failed.items())]
        raise RosyError("; ".join(causes))


def _run_tasks(
    client: Any, arguments: Sequence[str], tasks: Sequence[tuple[int, ...]]
) -> Generator[str, None, dict[tuple[int, ...], str]]:
    """Run a command for the frames of each task, and yield its lines of output.

    `tasks` has the frames of each task. Return the error messages of failed tasks, by their frames.
    """
    from distributed import as_completed

    commands = [["-m", PACKAGE, *arguments, f"--frames={format_frames(task)}"] for task in tasks]
    futures = client.map(_python_runner(), commands, retries=MAX_RETRIES, pure=False)
    task_of = dict(zip(futures, tasks, strict=True))
    failed = {}
    for future in as_completed(futures):
        if future.status == "error":
            failed[task_of[future]] = repr(future.exception())
            continue
        status, output, errors = future.result()
        if status:
            failed[task_of[future]] = error_line(errors.splitlines())
        else:
            yield from output.splitlines()
    return failed


def _python_runner() -> Callable[[list[str]], tuple[int, str, str]]:
    """Return a function that runs Python with a list of arguments on a worker.

    The returned function returns the exit status, the standard output and the standard error as text. It is
    a local function, because Dask pickles local functions by value: so the scheduler, which may not have RoSy,
    can unpickle it.
    """
    package = PACKAGE

    def run_python(words: list[str]) -> tuple[int, str, str]:
        """Run Python with some arguments, and return its exit status, standard output and standard error."""
        import importlib
        import subprocess
        import sys

        from distributed import get_worker

        lifeline = importlib.import_module(f"{package}.worker.lifeline").Lifeline()
        worker = get_worker()
        tasks, key = worker.state.tasks, worker.get_current_task()
        streams = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE}
        with lifeline:
            process = lifeline.start(
                [sys.executable, *words], text=True, errors="replace", **streams
            )
            # If the client has ended, nobody needs the result.
            while key in tasks and tasks[key].state != "cancelled":
                try:
                    output, errors = process.communicate(timeout=1.0)
                    return process.returncode, output, errors
                except subprocess.TimeoutExpired:
                    continue
            lifeline.interrupt(1.0)
            return process.returncode, "", ""

    return run_python
