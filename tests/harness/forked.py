"""Run the command line in a copy of this process, several times faster than Python is started."""

import os
import subprocess
import sys
import tempfile
import traceback
import warnings
from collections.abc import Callable, Sequence
from pathlib import Path

from rosy_addon.extras.command_line import main


def run_command(arguments: Sequence[str], folder: Path) -> subprocess.CompletedProcess:
    """Run ``python -m rosy_addon`` with arguments in a folder, and return its status and output."""
    command = [sys.executable, "-m", "rosy_addon", *arguments]
    if not hasattr(os, "fork"):
        return subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    with tempfile.TemporaryFile("w+") as stdout, tempfile.TemporaryFile("w+") as stderr:
        pid = fork_command(arguments, folder, (stdout.fileno(), stderr.fileno()))
        status = os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1])
        texts = []
        for stream in (stdout, stderr):
            stream.seek(0)
            texts.append(stream.read())
    return subprocess.CompletedProcess(command, status, *texts)


def fork_command(
    arguments: Sequence[str],
    folder: Path,
    descriptors: tuple[int, int],
    prepare: Callable[[], None] = lambda: None,
) -> int:
    """Start the command line in a fork, and return the number of the process.

    Parameters
    ----------
    arguments : sequence of str
    folder : Path
        The working directory.
    descriptors : (int, int)
        Open files for standard output and the error stream.
    prepare : callable
        Called in the new process before the command.
    """
    sys.stdout.flush()
    sys.stderr.flush()
    with warnings.catch_warnings():
        # Python 3.12 warns of threads, which here do nothing that the copy waits for.
        warnings.simplefilter("ignore", DeprecationWarning)
        pid = os.fork()
    if pid:
        return pid
    status = 1
    try:
        os.dup2(os.open(os.devnull, os.O_RDONLY), 0)
        for number, descriptor in enumerate(descriptors, 1):
            os.dup2(descriptor, number)
        # Those of a test run may be replaced.
        sys.stdin, sys.stdout, sys.stderr = sys.__stdin__, sys.__stdout__, sys.__stderr__
        os.chdir(folder)
        prepare()
        status = main(list(arguments))
    except SystemExit as end:
        status = end.code if isinstance(end.code, int) else 1
    except BaseException:
        traceback.print_exc()
    finally:
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(status)
