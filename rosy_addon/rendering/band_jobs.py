"""Bands of a picture as jobs for several processes, which share a folder."""

from __future__ import annotations

import hashlib
import time
from collections.abc import Hashable
from pathlib import Path
from typing import NamedTuple

import numpy as np

from ..cache import Cache
from ..compositor.band import Band
from ..compositor.compose import compose
from ..errors import NothingInViewError
from ..progress import report
from ..projection.project import project
from .view_input import ViewInput

#: Seconds between two looks for a file.
POLL_SECONDS = 0.002


class BandJob(NamedTuple):
    """A band of a picture.

    Attributes
    ----------
    picture : int
        Number of the picture.
    index : int
        Number of the band, from the bottom.
    rows : (int, int)
        The first row, and the row after the last one.
    context : int
        As of `Band`.
    """

    picture: int
    index: int
    rows: tuple[int, int]
    context: int


class FileExchange:
    """A `BandExchange` through the files of a folder.

    Parameters
    ----------
    folder : Path
    job : BandJob
        Of the band.
    """

    def __init__(self, folder: Path, job: BandJob) -> None:
        self._folder, self._job = folder, job

    def put(self, key: Hashable, values: np.ndarray) -> None:
        """Store an array for the band above."""
        write_array(self._path(self._job.index + 1, key), values)

    def get(self, key: Hashable) -> np.ndarray | None:
        """Wait for an array of the band below, and return it; None if that band ends without it."""
        path, end = self._path(self._job.index, key), self._end_path(self._job.index)
        while True:
            has_ended = end.exists()
            if path.exists():
                return np.load(path)
            if has_ended:
                return None
            report(1.0, "tracing streamlines")
            time.sleep(POLL_SECONDS)

    def end(self) -> None:
        """Tell the band above that nothing more comes."""
        self._end_path(self._job.index + 1).touch()

    def _path(self, receiver: int, key: Hashable) -> Path:
        digest = hashlib.sha1(repr(key).encode(), usedforsecurity=False).hexdigest()
        return self._folder / f"{self._job.picture}-{receiver}-{digest}.npy"

    def _end_path(self, receiver: int) -> Path:
        return self._folder / f"{self._job.picture}-{receiver}-end"


def draw_band(
    view: ViewInput, job: BandJob, exchange: FileExchange, cache: Cache | None = None
) -> np.ndarray:
    """Draw a band of a picture.

    Parameters
    ----------
    view : ViewInput
    job : BandJob
    exchange : FileExchange
    cache : Cache, optional
        Stores what does not depend on the camera.

    Returns
    -------
    (rows, W, 4) float32 ndarray
        Linear RGBA, not premultiplied. 0 rows if nothing is visible in the band or its context.
    """
    camera, look = view.shaded_camera, view.look
    band = Band(*job.rows, job.context, exchange)
    try:
        gbuffer = project(
            view.instances,
            camera,
            look.display,
            cache,
            view.samples_per_side,
            band.rows(camera.height),
        )
    except NothingInViewError:
        exchange.end()
        return np.zeros((0, camera.width, 4), dtype=np.float32)
    picture = compose(gbuffer, look, view.lights, view.reference, mesh_cache=cache, band=band)
    exchange.end()
    return picture.rgba


def result_path(folder: Path, job: BandJob) -> Path:
    """Return the file of the pixels of a band."""
    return folder / f"{job.picture}-{job.index}.npy"


def write_array(path: Path, values: np.ndarray) -> None:
    """Write a file that is either whole or not there."""
    partial = path.with_suffix(".part")
    with open(partial, "wb") as file:
        np.save(file, values)
    partial.replace(path)
