"""`BandWorkers`: processes that draw the bands of a picture side by side.

They are started for the first picture that is large enough, and end with the pool. Jobs and results
are files in a folder of their own. A band whose process fails is drawn here. If this process is
killed, the others notice, end and remove the folder.
"""

from __future__ import annotations

import json
import os
import pickle
import shutil
import subprocess
import sys
import tempfile
import time
from collections import deque
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from operator import is_
from pathlib import Path
from types import TracebackType

import numpy as np

from ..cache import Cache
from ..compositor.band_division import context_rows, divide_rows
from ..progress import Progress, Task, as_task, report, run_with_report
from ..projection.gbuffer import MeshInstance
from ..projection.project import raise_nothing_in_view
from .band_jobs import POLL_SECONDS, BandJob, FileExchange, draw_band, result_path
from .view_input import ViewInput

#: The program of a worker. It imports `rendering.band_worker`, but no module of the packages above it.
WORKER_PROGRAM = """
import importlib, json, sys, types
sys.path[:], package, root, folder = json.loads(sys.argv[1])
name = ""
for part in package.split("."):
    name = f"{name}.{part}".lstrip(".")
    sys.modules[name] = types.ModuleType(name)
sys.modules[package].__path__ = [root]
importlib.import_module(package + ".rendering.band_worker").main(folder)
"""

#: Environment of the workers. Each has one core.
ENVIRONMENT = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1", "MKL_NUM_THREADS": "1"}

#: Number of pixels that a process draws at a time, at most, if a picture can be divided so far. Bounds
#: the memory.
MAX_PIXELS_AT_A_TIME = 1 << 21

#: Label of the progress while other processes still draw.
WAITING_LABEL = "waiting for the other processes"


def core_count() -> int:
    """Return the number of processor cores that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def _are_same(first: Sequence[MeshInstance], second: Sequence[MeshInstance]) -> bool:
    """Return whether two sequences have the same objects."""
    return len(first) == len(second) and all(map(is_, first, second))


class BandWorkers:
    """Processes that draw the bands of a picture side by side, this one included.

    Use it in a ``with`` block, or call `close`.

    Parameters
    ----------
    count : int
        Number of processes. With 1, no other is started; 0 is one for each core.

    Attributes
    ----------
    count : int
        Number of bands that are drawn at a time.
    """

    def __init__(self, count: int = 0) -> None:
        self.count = count or core_count()
        self._folder: Path | None = None
        self._processes: list[subprocess.Popen[bytes]] = []
        self._instances: tuple[MeshInstance, ...] = ()
        self._scene_count = 0
        self._picture_count = 0

    def __enter__(self) -> BandWorkers:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()

    def close(self) -> None:
        """End the processes, and remove their files."""
        processes, self._processes = self._processes, []
        for process in processes:
            process.kill()
        for process in processes:
            process.wait()
            process.stdin.close()
            process.stdout.close()
        if self._folder is not None:
            shutil.rmtree(self._folder, ignore_errors=True)
        self._folder, self._instances = None, ()

    def divide(self, view: ViewInput) -> list[tuple[int, int]]:
        """Return the rows of the bands in which a picture is drawn; see `divide_rows`."""
        camera = view.shaded_camera
        bands_of_each = -(-camera.width * camera.height // (MAX_PIXELS_AT_A_TIME * self.count))
        return divide_rows(view.look, camera, view.instances, self.count * bands_of_each)

    def draw(
        self, view: ViewInput, rows: Sequence[tuple[int, int]], cache: Cache | None = None
    ) -> np.ndarray | None:
        """Draw a picture in bands. If the task is closed, the processes end.

        Parameters
        ----------
        view : ViewInput
        rows : sequence of (int, int)
            From `divide`.
        cache : Cache, optional
            Stores what does not depend on the camera, for the band that is drawn here.

        Returns
        -------
        (H, W, 4) float32 ndarray
            Linear RGBA, not premultiplied. None if the files cannot be written.

        Raises
        ------
        RosyError
            As of `Renderer.render_task`.
        """
        try:
            return run_with_report(self._draw_task(view, rows, cache), report)
        except OSError:
            self.close()
            return None
        except BaseException:
            self.close()
            raise

    def _draw_task(
        self, view: ViewInput, rows: Sequence[tuple[int, int]], cache: Cache | None
    ) -> Task[np.ndarray]:
        camera = view.shaded_camera
        context = context_rows(view.look, camera, view.instances)
        self._picture_count += 1
        jobs = [BandJob(self._picture_count, *entry, context) for entry in enumerate(rows)]
        rgba = np.zeros((camera.height, camera.width, 4), dtype=np.float32)
        self._start(min(self.count, len(jobs)) - 1)
        self._write_scene(view.instances)
        # Bands are begun from the bottom, in the next process that is free. A band only waits for the one
        # below, so the lowest that is not done never waits.
        waiting = deque(jobs)
        given: dict[subprocess.Popen[bytes], BandJob] = {}
        own: dict[BandJob, Task[np.ndarray]] = {}
        finished, is_visible = 0, False
        while finished < len(jobs):
            done, begun = self._collect(given)
            if waiting and not own and not begun:
                begun.append(waiting.popleft())
            for process in self._processes:
                if waiting and process not in given and process.poll() is None:
                    given[process] = waiting.popleft()
                    self._send(process, view, given[process])
            for job in begun:
                own[job] = as_task(draw_band, view, job, FileExchange(self._folder, job), cache)
            progress = Progress(0.0, WAITING_LABEL)
            if own:
                job = min(own)
                try:
                    progress = next(own[job])
                except StopIteration as end:
                    done.append((job, end.value))
                    del own[job]
            else:
                time.sleep(POLL_SECONDS)
            for job, band in done:
                finished += 1
                if len(band):
                    rgba[slice(*job.rows)] = band
                    is_visible = True
            yield Progress((finished + progress.fraction) / (len(jobs) + 1), progress.label)
        if not is_visible:
            raise_nothing_in_view(view.instances, camera)
        for path in self._folder.glob(f"{self._picture_count}-*"):
            path.unlink()
        return rgba

    def _collect(
        self, given: dict[subprocess.Popen[bytes], BandJob]
    ) -> tuple[list[tuple[BandJob, np.ndarray]], list[BandJob]]:
        """Take the bands out of `given` that processes have drawn, and those whose process has ended.

        Returns
        -------
        done : list of (BandJob, ndarray)
        failed : list of BandJob
        """
        done, failed = [], []
        for process, job in list(given.items()):
            has_ended = process.poll() is not None
            path = result_path(self._folder, job)
            if path.exists():
                done.append((job, np.load(path)))
                path.unlink()
            elif has_ended:
                failed.append(job)
            else:
                continue
            del given[process]
        return done, failed

    def _start(self, count: int) -> None:
        """Make the folder, and start processes until so many run."""
        if self._folder is None:
            self._folder = Path(tempfile.mkdtemp(prefix="rosy-"))
        package = __package__.rpartition(".")[0]
        arguments = [
            list(map(str, sys.path)),
            package,
            str(Path(__file__).parents[1]),
            str(self._folder),
        ]
        command = [sys.executable, "-I", "-S", "-c", WORKER_PROGRAM, json.dumps(arguments)]
        self._processes = [process for process in self._processes if process.poll() is None]
        # An embedded Python may name another program.
        can_start = "python" in Path(sys.executable or "").name.lower()
        while can_start and len(self._processes) < count:
            try:
                process = subprocess.Popen(
                    command,
                    stdin=subprocess.PIPE,
                    stdout=subprocess.PIPE,
                    stderr=subprocess.DEVNULL,
                    env=os.environ | ENVIRONMENT,
                    # No console in Windows.
                    creationflags=getattr(subprocess, "CREATE_NO_WINDOW", 0),
                )
            except OSError:
                return
            self._processes.append(process)

    @property
    def _scene_path(self) -> Path:
        """The file of the mesh instances of the current picture."""
        return self._folder / f"scene-{self._scene_count}"

    def _write_scene(self, instances: tuple[MeshInstance, ...]) -> None:
        """Write the mesh instances of a picture, unless they are those of the last one."""
        if not _are_same(instances, self._instances):
            # No process needs the meshes of the pictures before.
            self._scene_path.unlink(missing_ok=True)
            self._instances = instances
            self._scene_count += 1
            self._scene_path.write_bytes(pickle.dumps(instances, pickle.HIGHEST_PROTOCOL))

    def _send(self, process: subprocess.Popen[bytes], view: ViewInput, job: BandJob) -> None:
        """Send a job to a process."""
        name = f"{job.picture}-{job.index}-job"
        rest = replace(view, instances=())
        (self._folder / name).write_bytes(pickle.dumps((rest, job), pickle.HIGHEST_PROTOCOL))
        # A process that has ended is noticed later.
        with suppress(OSError):
            process.stdin.write(f"{self._scene_path.name} {name}\n".encode())
            process.stdin.flush()
