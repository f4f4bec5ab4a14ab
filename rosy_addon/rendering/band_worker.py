"""A process that draws bands of pictures for another one; see `band_workers`.

It imports RoSy without the extension's own module, and so without Blender.
"""

from __future__ import annotations

import os
import pickle
import shutil
import signal
import sys
import time
from dataclasses import replace
from functools import partial
from pathlib import Path

from ..cache import Cache
from .band_jobs import FileExchange, draw_band, result_path, write_array

#: Seconds between two signs of life. Writing one fails once the other process has ended.
BEAT_SECONDS = 2.0


def main(folder: str) -> None:
    """Draw the bands that are named on the standard input, until the process that asks ends.

    Parameters
    ----------
    folder : str
        Of the jobs and their results. It is removed.
    """
    # Ctrl-C in a terminal reaches all processes. The one that asks ends this one.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        _draw_bands(Path(folder))
    except EOFError:
        shutil.rmtree(folder, ignore_errors=True)


def _draw_bands(folder: Path) -> None:
    """Draw bands without end.

    A line of the standard input names a file with the mesh instances and one with the rest of the
    view and the job. The instances are often those of the band before.

    Raises
    ------
    EOFError
        If the process that asks has ended.
    """
    known_name, instances, cache = "", (), Cache()
    while line := sys.stdin.readline():
        scene_name, job_name = line.split()
        if scene_name != known_name:
            known_name, cache = scene_name, Cache()
            instances = pickle.loads((folder / scene_name).read_bytes())
        view, job = pickle.loads((folder / job_name).read_bytes())
        view = replace(view, instances=instances)
        task = partial(draw_band, view, job, FileExchange(folder, job), cache)
        last_beat = time.monotonic()
        while True:
            try:
                next(task)
            except StopIteration as end:
                write_array(result_path(folder, job), end.value)
                break
            if time.monotonic() - last_beat > BEAT_SECONDS:
                _beat()
                last_beat = time.monotonic()
    raise EOFError


def _beat() -> None:
    """Write a sign of life.

    Raises
    ------
    EOFError
        If nobody can read it.
    """
    try:
        os.write(1, b".")
    except OSError:
        raise EOFError from None
