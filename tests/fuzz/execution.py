"""Run a case in a process of its own, with limits, and record all that it did."""

import os
import resource
import shutil
import signal
import stat
import subprocess
import sys
import time
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path

from rosy_addon.core.file_io import remove_leftovers

from ..harness.forked import fork_command
from ..harness.processes import all_end, marked_processes
from .cases import Case

#: Seconds of the processor after which a run counts as hanging; seconds after which it does so even
#: if it only waits; and bytes of address space that it may take beyond those of this process.
CPU_LIMIT, TIME_LIMIT, MEMORY_LIMIT = 60, 240.0, 3 << 30

ROOT = Path(__file__).resolve().parents[2]


@dataclass
class Run:
    """What a case did.

    Attributes
    ----------
    status : int or None
        Exit status, negative if a signal ended it; None if it took longer than a limit.
    stdout, stderr : bytes
    before, after : dict of str to str
        Contents of the folder of the case: see `listing`.
    seconds : float
        Of the processor.
    peak_bytes : int
        Largest resident memory.
    left : str
        Processes and temporary folders that are left, if the case has a process of its own: processes
        `END_SECONDS` after it, and folders.
    """

    status: int | None
    stdout: bytes
    stderr: bytes
    before: dict[str, str]
    after: dict[str, str]
    seconds: float
    peak_bytes: int
    left: str


def execute(case: Case, folder: Path) -> Run:
    """Run a case in its folder. Standard output and error stream go to files next to the folder."""
    before = listing(folder)
    streams = [folder.with_suffix(suffix) for suffix in (".stdout", ".stderr")]
    pid = (_start_process if case.own_process else _fork)(case, folder, streams)
    status, usage = _wait(pid, case)
    left = _left_over(folder, status is not None and status < 0) if case.own_process else ""
    seconds = usage.ru_utime + usage.ru_stime
    stdout, stderr = (path.read_bytes() for path in streams)
    for path in streams:
        path.unlink()
    peak = usage.ru_maxrss * (1 if sys.platform == "darwin" else 1024)
    return Run(status, stdout, stderr, before, listing(folder), seconds, peak, left)


def _left_over(folder: Path, was_killed: bool) -> str:
    """Return which processes and temporary folders a run has left.

    If it was killed, remove its temporary files, as the next start does.
    """
    temporary = folder.with_suffix(".tmp")
    left = {} if all_end(str(temporary)) else marked_processes(str(temporary))
    for pid in left:
        os.kill(pid, signal.SIGKILL)
    for place in (folder, *filter(Path.is_dir, folder.iterdir())) if was_killed else ():
        remove_leftovers(place)
    found = [*left.values(), *(path.name for path in temporary.iterdir())]
    shutil.rmtree(temporary)
    return ", ".join(found)


def listing(folder: Path) -> dict[str, str]:
    """Return the contents of a folder: the hash of each file, the kind of what is not one."""
    contents = {}
    for path in sorted(folder.rglob("*")):
        mode = path.lstat().st_mode
        if stat.S_ISREG(mode):
            text = sha256(path.read_bytes()).hexdigest()
        elif stat.S_ISLNK(mode):
            text = f"link to {os.readlink(path)}"
        else:
            text = f"kind {stat.S_IFMT(mode):o}"
        contents[str(path.relative_to(folder))] = text
    return contents


def _fork(case: Case, folder: Path, streams: list[Path]) -> int:
    """Start a case in a copy of this process, which has imported all modules. Return its number."""

    def prepare() -> None:
        os.environ.update(case.environment)
        _set_limits()

    with streams[0].open("wb") as stdout, streams[1].open("wb") as stderr:
        return fork_command(case.arguments, folder, (stdout.fileno(), stderr.fileno()), prepare)


def _start_process(case: Case, folder: Path, streams: list[Path]) -> int:
    """Start a case as ``python -m rosy_addon``. Return the number of the process."""
    temporary = folder.with_suffix(".tmp")
    temporary.mkdir()
    with streams[0].open("wb") as stdout, streams[1].open("wb") as stderr:
        output = stdout
        if case.stdout == "closed":
            read_end, output = os.pipe()
            os.close(read_end)
        elif case.stdout == "full":
            output = os.open("/dev/full", os.O_WRONLY)
        environment = os.environ | {"PYTHONPATH": str(ROOT), "PYTHONDONTWRITEBYTECODE": "1"}
        process = subprocess.Popen(
            [sys.executable, "-m", "rosy_addon", *case.arguments],
            cwd=folder,
            stdin=subprocess.DEVNULL,
            stdout=output,
            stderr=stderr,
            env=environment | case.environment | {"TMPDIR": str(temporary)},
            preexec_fn=_set_limits,
            start_new_session=True,
        )
        if isinstance(output, int):
            os.close(output)
    process.returncode = 0  # this module waits for it
    return process.pid


def _set_limits() -> None:
    with open("/proc/self/statm") as file:
        used = int(file.read().split()[0]) * resource.getpagesize()
    resource.setrlimit(resource.RLIMIT_AS, (used + MEMORY_LIMIT,) * 2)
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    resource.setrlimit(resource.RLIMIT_CPU, (CPU_LIMIT, CPU_LIMIT + 5))


def _wait(pid: int, case: Case) -> tuple[int | None, resource.struct_rusage]:
    """Wait for a process, and stop it when the case says so."""
    start, pause, was_stopped, timed_out = time.perf_counter(), 0.001, False, False
    while True:
        done, status, usage = os.wait4(pid, os.WNOHANG)
        if done:
            status = os.waitstatus_to_exitcode(status)
            return None if timed_out or status == -signal.SIGXCPU else status, usage
        seconds = time.perf_counter() - start
        if case.stop_after is not None and seconds > case.stop_after and not was_stopped:
            was_stopped = True
            (os.killpg if case.stops_group else os.kill)(pid, case.stop_signal)
        elif seconds > TIME_LIMIT and not timed_out:
            timed_out = True
            os.kill(pid, signal.SIGKILL)
        time.sleep(pause)
        pause = min(pause * 1.2, 0.02)
