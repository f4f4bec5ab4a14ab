"""Pictures that several processes draw together."""

import os
import signal
from dataclasses import replace

import pytest
from harness.processes import becomes_true, is_running
from shapes import instance_of, torus

from rosy_addon.compositor.look import Look
from rosy_addon.core.cache import BAKE_CACHE, Cache
from rosy_addon.core.errors import NothingInViewError
from rosy_addon.core.progress import listening
from rosy_addon.projection.camera import look_at, perspective_camera
from rosy_addon.rendering.draw import draw_picture, picture_groups
from rosy_addon.rendering.view_input import ViewInput
from rosy_addon.worker import start
from rosy_addon.worker.pool import POOL

#: Fields with many lines need many strips.
DEGREE, WIDTH, HEIGHT = 11, 160, 1216


def view_from(eye, **look) -> ViewInput:
    instance = instance_of(torus(24, 12), DEGREE, "axis")
    camera = perspective_camera(look_at(eye, (0, 0, 0)), WIDTH, HEIGHT, fov=0.9)
    return ViewInput((instance,), camera, Look(length=10, **look))


VIEW = view_from((0.0, -1.5, 5.0), supersampling=2, arrows=40.0)


def drawn(view: ViewInput, workers: int = 1) -> bytes:
    return draw_picture(view, workers=workers).rgba.tobytes()


@pytest.fixture(scope="module")
def expected():
    return drawn(VIEW)


@pytest.fixture(autouse=True)
def _no_helpers_stay():
    yield
    POOL.close()


@pytest.mark.slow
def test_the_number_of_processes_changes_nothing(expected):
    assert len(picture_groups(VIEW, 3)) == 3 and drawn(VIEW, 3) == expected
    assert len(POOL.helpers) == 2


@pytest.mark.slow
def test_nothing_is_kept_here_without_a_cache(expected):
    before, cache = len(BAKE_CACHE), Cache()
    assert drawn(VIEW, 2) == expected
    assert draw_picture(VIEW, cache, workers=2).rgba.tobytes() == expected
    assert len(BAKE_CACHE) == before and len(cache)


@pytest.mark.slow
def test_helpers_draw_one_picture_after_the_other(expected):
    other = replace(view_from((1.0, -2.0, 4.0), ink="hatch", outline=2.0), instances=VIEW.instances)
    drawn(VIEW, 2)
    pid = POOL.helpers[0].pid
    assert drawn(other, 2) == drawn(other) and drawn(VIEW, 2) == expected
    assert POOL.helpers[0].pid == pid


@pytest.mark.slow
@pytest.mark.parametrize("killed_at", [0.0, 0.3])
def test_what_a_killed_helper_has_not_drawn_is_drawn_here(killed_at, expected):
    killed = []

    def kill(fraction: float, _label: str) -> None:
        if fraction >= killed_at and not killed and all(helper.pid for helper in POOL.helpers):
            killed.extend(helper.pid for helper in POOL.helpers)
            for pid in killed:
                os.kill(pid, signal.SIGKILL)

    with listening(kill):
        assert drawn(VIEW, 3) == expected
    assert len(killed) == 2


@pytest.mark.slow
def test_without_helpers_all_is_drawn_here(expected, monkeypatch):
    monkeypatch.setattr(start.sys, "executable", "/bin/false")
    assert drawn(VIEW, 2) == expected


@pytest.mark.slow
def test_a_picture_that_is_stopped_ends_busy_helpers():
    pids = []

    def stop(fraction: float, _label: str) -> None:
        pids[:] = [helper.pid for helper in POOL.helpers]
        if fraction > 0.1:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt), listening(stop):
        drawn(VIEW, 2)
    assert becomes_true(lambda: not any(is_running(pid) for pid in pids if pid), 0.2)


@pytest.mark.slow
def test_a_picture_with_nothing_in_view_is_refused():
    away = perspective_camera(look_at((0.0, -9.0, 0.0), (0, -90, 0)), WIDTH, HEIGHT, fov=0.9)
    with pytest.raises(NothingInViewError, match="outside the frame"):
        drawn(replace(VIEW, camera=away), 2)


def test_small_pictures_start_no_process():
    drawn(replace(VIEW, camera=VIEW.camera.resized(100, 100)), 8)
    assert not POOL.helpers
