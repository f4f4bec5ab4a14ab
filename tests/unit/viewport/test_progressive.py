"""Previews and final pictures of views, with a renderer that only notes what it does."""

from __future__ import annotations

from itertools import count, pairwise
from types import SimpleNamespace

import numpy as np
import pytest

from rosy_addon.compositor.look import Look
from rosy_addon.errors import RosyError
from rosy_addon.projection.camera import orthographic_camera
from rosy_addon.rendering.view_input import ViewInput
from rosy_addon.viewport import progressive as progressive_module
from rosy_addon.viewport.progressive import ProgressiveRenderer
from rosy_addon.viewport.step_runner import SharedHelper
from rosy_addon.worker.job import Step

POINTERS = 1, 2


class NotingRenderer:
    """A `ViewportRenderer` that notes its steps in `done`, and fails in those named in `failing`."""

    downscale_factors = 2, 1
    needs_occluders = False

    def __init__(self):
        self.done, self.failing, self.is_prepared = [], set(), False

    def _step(self, name):
        self.done.append(name)
        if name in self.failing:
            raise MemoryError

    def prepare_steps(self, instances, display):
        if self.is_prepared:
            return
        for name in ("compile", "compile", "upload a mesh"):
            yield Step(0.0, name)
            self._step(name)
        self.is_prepared = True

    def upload(self, instances, display):
        return ["item"]

    def covered_pixels(self, items, camera):
        return camera.width * camera.height

    def texture_steps(self, items, view, target_key=None):
        for name in ("visibility", "lines"):
            yield Step(0.0, name)
            self._step(name)
        return "texture"

    def finish(self):
        pass

    def release(self):
        pass


@pytest.fixture
def view_input():
    camera = orthographic_camera(np.eye(4), 32, 32)
    return ViewInput((), camera, Look())


def progressive_of(renderer, helper=None):
    return ProgressiveRenderer(
        renderer, helper or SharedHelper(), lambda seconds: None, lambda: None
    )


@pytest.fixture
def progressive():
    return progressive_of(NotingRenderer())


def test_each_step_of_the_first_picture_is_named_before_it_begins(progressive, view_input):
    done = progressive.renderer.done
    for _ in range(20):
        view = progressive.update(POINTERS, "key", view_input)
        if view.texture is not None:
            break
        assert view.progress.label not in done or view.progress.label == done[-1]
        assert len(done) <= 5
    assert view.texture == "texture" and view.progress is None
    assert done == ["compile", "compile", "upload a mesh", "visibility", "lines"]


def test_the_first_picture_is_completed_while_the_view_changes(progressive, view_input):
    for step in range(20):
        if progressive.update(POINTERS, f"key {step}", view_input).texture is not None:
            return
    raise AssertionError("it was never completed")


@pytest.mark.parametrize("failing", ["visibility", "upload a mesh"])
def test_a_picture_that_fails_is_not_tried_again(progressive, view_input, failing):
    renderer = progressive.renderer
    renderer.failing.add(failing)
    with pytest.raises(MemoryError):
        for _ in range(20):
            progressive.update(POINTERS, "key", view_input)
    done_count = len(renderer.done)
    for _ in range(3):
        with pytest.raises(RosyError, match="not enough memory"):
            progressive.update(POINTERS, "key", view_input)
    assert len(renderer.done) == done_count
    renderer.failing.clear()
    for _ in range(20):
        if progressive.update(POINTERS, "another key", view_input).texture is not None:
            return
    raise AssertionError("it was not tried again")


class SlowRenderer(NotingRenderer):
    """A renderer whose pictures have many steps and names of their own."""

    def __init__(self):
        super().__init__()
        self.pictures = 0

    def texture_steps(self, items, view, target_key=None):
        self.pictures += 1
        name = self.pictures, view.camera.width, target_key[2]
        for _ in range(30):
            yield Step(0.0, "lines")
        return name


@pytest.fixture
def slow(monkeypatch, view_input):
    """A progressive renderer that has shown a final picture, and does a few steps in each redraw."""
    ticks = count()
    clock = SimpleNamespace(monotonic=lambda: 0.02 * next(ticks))
    monkeypatch.setattr(progressive_module, "time", clock)
    monkeypatch.setattr(progressive_module, "FRAME_BUDGET_SECONDS", 0.0)
    slow = progressive_of(SlowRenderer())
    while slow.update(POINTERS, ("view", 0), view_input, "view").texture is None:
        pass
    return slow


def test_streaks_that_drift_have_no_previews(slow, view_input):
    """Pictures are rendered to the end while the streaks drift on, in an image that is not shown."""
    shown = []
    for frame in range(1, 60):
        view = slow.update(POINTERS, ("view", frame), view_input, "view")
        assert view.downscale == 1
        if view.texture not in shown:
            shown.append(view.texture)
    assert len(shown) >= 5
    assert {width for _, width, _ in shown} == {32}
    assert slow.renderer.pictures <= len(shown) + 1, "pictures were abandoned"
    assert all(one[2] != other[2] for one, other in pairwise(shown))


def test_a_view_that_turns_while_streaks_drift_has_previews(slow, view_input):
    for frame in range(1, 4):
        slow.update(POINTERS, ("view", frame), view_input, "view")
    view = slow.update(POINTERS, ("turned", 4), view_input, "turned")
    assert view.downscale == 2 and view.texture_key == ("turned", 4)
    preview = view.texture
    view = slow.update(POINTERS, ("turned", 5), view_input, "turned")
    assert view.texture == preview, "previews do not drift"


def test_views_with_streaks_that_drift_take_turns(slow, view_input):
    slow.update((1, 3), ("view", 0), view_input, "view")
    for frame in range(1, 100):
        for pointers in (POINTERS, (1, 3)):
            slow.update(pointers, ("view", frame), view_input, "view")
    views = slow.views.values()
    assert all(view.texture_key[1] > 80 for view in views), [view.texture_key for view in views]
