"""Pictures that several processes draw together."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from dataclasses import replace

import numpy as np
import pytest
from conftest import ROOT, long
from shapes import torus

from rosy_addon.compositor.look import Look
from rosy_addon.errors import NothingInViewError
from rosy_addon.field.generate import axis_field
from rosy_addon.progress import run_to_completion
from rosy_addon.projection.camera import look_at, perspective_camera
from rosy_addon.projection.gbuffer import MeshInstance
from rosy_addon.rendering import band_workers
from rosy_addon.rendering.band_workers import BandWorkers
from rosy_addon.rendering.draw import draw_picture
from rosy_addon.rendering.view_input import ViewInput

#: Fields with many lines need many strips.
DEGREE, WIDTH, HEIGHT = 11, 320, 1216


def view_from(eye, **look) -> ViewInput:
    ring = torus(24, 12)
    instance = MeshInstance(ring, np.eye(4), axis_field(ring, DEGREE, (0, 0, 1)))
    camera = perspective_camera(look_at(eye, (0, 0, 0)), WIDTH, HEIGHT, fov=0.9)
    return ViewInput((instance,), camera, Look(length=10, **look))


VIEW = view_from((0.0, -1.5, 5.0), supersampling=2)


def drawn(view: ViewInput, workers: BandWorkers | None = None) -> np.ndarray:
    return run_to_completion(CpuRenderer(workers=workers).render_task(view)).rgba


@pytest.fixture(scope="module")
def expected():
    return drawn(VIEW)


@pytest.fixture(autouse=True)
def _folder(tmp_path, monkeypatch):
    """Files are made here, and are gone at the end."""
    monkeypatch.setattr(band_workers.tempfile, "tempdir", str(tmp_path))
    yield
    assert not list(tmp_path.glob("rosy-*"))


@pytest.mark.slow
@pytest.mark.parametrize("count", [3, *long(2, 8)])
def test_the_number_of_processes_changes_nothing(count, expected):
    with BandWorkers(count) as workers:
        assert len(workers.divide(VIEW)) == count
        assert drawn(VIEW, workers).tobytes() == expected.tobytes()


@pytest.mark.slow
def test_processes_draw_one_picture_after_the_other(expected):
    other = replace(view_from((1.0, -2.0, 4.0), ink="hatch", outline=2.0), instances=VIEW.instances)
    with BandWorkers(2) as workers:
        drawn(VIEW, workers)
        processes = list(workers._processes)
        assert drawn(other, workers).tobytes() == drawn(other).tobytes()
        assert drawn(VIEW, workers).tobytes() == expected.tobytes()
        assert workers._processes == processes
        moved = replace(VIEW.instances[0], matrix=np.diag([1.1, 1.1, 1.1, 1.0]))
        drawn(replace(VIEW, instances=(moved,)), workers)
        assert len(list(workers._folder.iterdir())) == 1


@pytest.mark.slow
@pytest.mark.parametrize("steps", [1, 40])
def test_a_band_whose_process_is_killed_is_drawn_here(steps, expected):
    with BandWorkers(3) as workers:
        task = CpuRenderer(workers=workers).render_task(VIEW)
        for _ in range(steps):
            next(task)
        for process in workers._processes:
            process.kill()
        assert run_to_completion(task).rgba.tobytes() == expected.tobytes()


@pytest.mark.slow
@pytest.mark.parametrize(
    "program",
    [
        "import sys; sys.exit(1)",
        "import resource; resource.setrlimit(resource.RLIMIT_AS, (1 << 27, 1 << 27))\n"
        + band_workers.WORKER_PROGRAM,
    ],
    ids=["fails", "has no memory"],
)
def test_a_band_whose_process_fails_is_drawn_here(program, expected, monkeypatch):
    monkeypatch.setattr(band_workers, "WORKER_PROGRAM", program)
    with BandWorkers(2) as workers:
        assert drawn(VIEW, workers).tobytes() == expected.tobytes()


@pytest.mark.slow
def test_without_permission_to_start_processes_all_is_drawn_here(expected, monkeypatch):
    def refuse(*_, **__):
        raise PermissionError("not allowed")

    monkeypatch.setattr(band_workers.subprocess, "Popen", refuse)
    with BandWorkers(2) as workers:
        assert drawn(VIEW, workers).tobytes() == expected.tobytes()


def test_nothing_is_left_of_a_picture_that_is_stopped():
    workers = BandWorkers(2)
    task = CpuRenderer(workers=workers).render_task(VIEW)
    for _ in range(10):
        next(task)
    (process,) = workers._processes
    task.close()
    assert process.returncode is not None and workers._folder is None


def test_a_picture_with_nothing_in_view_is_refused():
    away = perspective_camera(look_at((0.0, -9.0, 0.0), (0, -90, 0)), WIDTH, HEIGHT, fov=0.9)
    with BandWorkers(2) as workers, pytest.raises(NothingInViewError, match="outside the frame"):
        drawn(replace(VIEW, camera=away), workers)


def test_small_pictures_start_no_process():
    with BandWorkers(8) as workers:
        small = replace(VIEW, camera=VIEW.camera.resized(100, 100))
        assert len(workers.divide(small)) == 1
        drawn(small, workers)
        assert not workers._processes


@pytest.mark.slow
@pytest.mark.skipif(os.name != "posix", reason="reads the list of processes")
def test_processes_end_if_the_one_that_asks_is_killed(tmp_path):
    program = """
import sys
sys.path[:0] = ["tests/unit"]
import test_band_workers as t
t.band_workers.tempfile.tempdir = sys.argv[1]
with t.BandWorkers(3) as workers:
    while True:
        t.drawn(t.VIEW, workers)
        print("drawn", flush=True)
"""
    process = subprocess.Popen(
        [sys.executable, "-c", program, str(tmp_path)], cwd=ROOT, stdout=subprocess.PIPE
    )
    assert process.stdout.readline() == b"drawn\n"
    time.sleep(0.3)
    process.send_signal(signal.SIGKILL)
    process.wait()
    process.stdout.close()
    deadline = time.monotonic() + 20
    while list(tmp_path.glob("rosy-*")) and time.monotonic() < deadline:
        time.sleep(0.1)
