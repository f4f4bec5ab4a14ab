"""Run the command line in a copy of this process, several times faster than Python is started."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import traceback
import warnings
from collections.abc import Sequence
from pathlib import Path

from rosy_addon.extras.command_line import main


def run_command(arguments: Sequence[str], folder: Path) -> subprocess.CompletedProcess:
    """Run ``python -m rosy_addon`` with arguments in a folder, and return its status and output."""
    command = [sys.executable, "-m", "rosy_addon", *arguments]
    if not hasattr(os, "fork"):
        return subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    with tempfile.TemporaryFile("w+") as stdout, tempfile.TemporaryFile("w+") as stderr:
        with warnings.catch_warnings():
            # Python 3.12 warns of threads, which here do nothing that the copy waits for.
            warnings.simplefilter("ignore", DeprecationWarning)
            pid = os.fork()
        if not pid:
            _run_and_exit(arguments, folder, (stdout.fileno(), stderr.fileno()))
        status = os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1])
        texts = []
        for stream in (stdout, stderr):
            stream.seek(0)
            texts.append(stream.read())
    return subprocess.CompletedProcess(command, status, *texts)


def _run_and_exit(arguments: Sequence[str], folder: Path, descriptors: tuple[int, int]) -> None:
    status = 1
    try:
        os.dup2(os.open(os.devnull, os.O_RDONLY), 0)
        for number, descriptor in enumerate(descriptors, 1):
            os.dup2(descriptor, number)
        sys.stdin = os.fdopen(0)
        sys.stdout, sys.stderr = os.fdopen(1, "w"), os.fdopen(2, "w")
        os.chdir(folder)
        status = main(list(arguments))
    except SystemExit as end:
        status = end.code if isinstance(end.code, int) else 1
    except BaseException:
        traceback.print_exc()
    finally:
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(status)
