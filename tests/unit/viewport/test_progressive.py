"""Previews and final pictures of views, with a renderer that only notes what it does."""

import time
from itertools import count, pairwise
from types import SimpleNamespace

import numpy as np
import pytest

from rosy_addon.compositor.look import Look
from rosy_addon.projection.camera import orthographic_camera
from rosy_addon.rendering.view_input import ViewInput
from rosy_addon.viewport import progressive as progressive_module
from rosy_addon.viewport.progressive import ProgressiveRenderer, Request
from rosy_addon.worker.helper import Helper
from rosy_addon.worker.job import Call, Step

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
    return ViewInput((), orthographic_camera(np.eye(4), 32, 32), Look())


def progressive_of(renderer, helper=None):
    return ProgressiveRenderer(renderer, helper or Helper(), lambda seconds: None, lambda: None)


@pytest.fixture
def progressive():
    return progressive_of(NotingRenderer())


def updated(progressive, key, view_input, until=lambda view: view.picture is None):
    """Update a view as Blender redraws, until something is so, and return it."""
    for _ in range(500):
        start = time.process_time()
        view = progressive.update(POINTERS, Request(key, key, view_input))
        assert time.process_time() - start < 0.1
        if until(view):
            return view
        while not progressive.poll():
            time.sleep(0.005)
    raise AssertionError("it was never so")


def has_picture(view):
    return view.texture is not None


def test_each_step_of_the_first_picture_is_named_before_it_begins(progressive, view_input):
    done = progressive.renderer.done
    for _ in range(20):
        view = progressive.update(POINTERS, Request("key", "key", view_input))
        if view.texture is not None:
            break
        assert view.progress.label not in done or view.progress.label == done[-1]
        assert len(done) <= 5
    assert view.texture == "texture" and view.progress is None
    assert done == ["compile", "compile", "upload a mesh", "visibility", "lines"]


def test_the_first_picture_is_completed_while_the_view_changes(progressive, view_input):
    requests = (Request(f"key {step}", f"key {step}", view_input) for step in range(20))
    assert any(progressive.update(POINTERS, request).texture for request in requests)


@pytest.mark.parametrize("failing", ["visibility", "upload a mesh"])
def test_a_picture_that_fails_is_not_tried_again(progressive, view_input, failing, error_of):
    renderer = progressive.renderer
    renderer.failing.add(failing)
    with pytest.raises(MemoryError):
        updated(progressive, "key", view_input, has_picture)
    done_count = len(renderer.done)
    for _ in range(3):
        message = error_of(progressive.update, POINTERS, Request("key", "key", view_input))
        assert "not enough memory" in message
    assert len(renderer.done) == done_count
    renderer.failing.clear()
    assert updated(progressive, "another key", view_input, has_picture), "it is tried again"


class SlowRenderer(NotingRenderer):
    """A renderer whose pictures have many steps and names of their own."""

    pictures = 0

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
    while slow.update(POINTERS, Request(("view", 0), "view", view_input)).texture is None:
        pass
    return slow


def test_streaks_that_drift_have_no_previews(slow, view_input):
    """Pictures are rendered to the end while the streaks drift on, in an image that is not shown."""
    shown = []
    for frame in range(1, 60):
        view = slow.update(POINTERS, Request(("view", frame), "view", view_input))
        assert view.shown.downscale == 1
        if view.texture not in shown:
            shown.append(view.texture)
    assert len(shown) >= 5 and {width for _, width, _ in shown} == {32}
    assert slow.renderer.pictures <= len(shown) + 1, "pictures were abandoned"
    assert all(one[2] != other[2] for one, other in pairwise(shown))


def test_a_view_that_turns_while_streaks_drift_has_previews(slow, view_input):
    for frame in range(1, 4):
        slow.update(POINTERS, Request(("view", frame), "view", view_input))
    view = slow.update(POINTERS, Request(("turned", 4), "turned", view_input))
    assert view.shown.downscale == 2 and view.shown.request.key == ("turned", 4)
    preview = view.texture
    view = slow.update(POINTERS, Request(("turned", 5), "turned", view_input))
    assert view.texture == preview, "previews do not drift"


def test_views_with_streaks_that_drift_take_turns(slow, view_input):
    slow.update((1, 3), Request(("view", 0), "view", view_input))
    for frame in range(1, 100):
        for pointers in (POINTERS, (1, 3)):
            slow.update(pointers, Request(("view", frame), "view", view_input))
    views = slow.views.values()
    assert min(view.shown.request.key[1] for view in views) > 80


class HelpedRenderer(NotingRenderer):
    """A renderer whose pictures, and whose meshes if they are long, are calls that a helper makes."""

    def __init__(self, picture=time.sleep, arguments=(0.2,)):
        super().__init__()
        self.picture, self.arguments, self.long_meshes = picture, arguments, set()

    def prepare_steps(self, instances, display):
        for mesh in instances:
            if mesh in self.long_meshes:
                yield Call(time.sleep, (0.1,), label=f"preparing {mesh}")
                self.long_meshes.discard(mesh)

    def texture_steps(self, items, view, target_key=None):
        yield Call(self.picture, self.arguments, label="drawing")
        return view.instances, view.camera.width


@pytest.mark.slow
def test_previews_are_finished_and_final_pictures_abandoned(helper, view_input, monkeypatch):
    monkeypatch.setattr(progressive_module, "FRAME_BUDGET_SECONDS", 0.0)
    progressive = progressive_of(HelpedRenderer(), helper)
    updated(progressive, "first", view_input)
    progressive.update(POINTERS, Request("second", "second", view_input))
    view = updated(
        progressive, "third", view_input, lambda view: view.shown.request.key == "second"
    )
    assert view.texture == ((), 16), "a preview is shown, though the view has changed again"
    view = updated(progressive, "third", view_input, lambda view: view.shown.request.key == "third")
    assert view.shown.downscale == 2
    updated(progressive, "third", view_input, lambda view: view.picture is not None)
    final = view.picture
    assert final.downscale == 1
    view = updated(progressive, "fourth", view_input, lambda view: view.picture is not final)
    assert view.shown.request.key == "third" and view.picture.downscale == 2
    view = updated(progressive, "fourth", view_input, lambda view: view.shown.downscale == 1)
    assert view.texture == ((), 32) and view.shown.request.key == "fourth"


@pytest.mark.slow
def test_meshes_that_change_faster_than_they_are_prepared_are_shown(helper, view_input):
    renderer = HelpedRenderer(len, ("ab",))
    progressive = progressive_of(renderer, helper)
    updated(progressive, "still", view_input)
    shown = []
    for frame in range(200):
        mesh = f"mesh {frame}"
        renderer.long_meshes = {mesh}
        moving = ViewInput((mesh,), view_input.camera, Look())
        view = progressive.update(POINTERS, Request(mesh, mesh, moving))
        if view.texture not in shown:
            shown.append(view.texture)
        progressive.poll()
        time.sleep(0.01)
    assert len(shown) > 4


def test_two_views_share_the_helper(helper, view_input):
    progressive = progressive_of(HelpedRenderer(), helper)

    def both_are_shown(view):
        other = progressive.update((1, 3), Request("key", "key", view_input))
        return view.texture == other.texture == ((), 32)

    updated(progressive, "key", view_input, both_are_shown)
    progressive.remove_space(POINTERS[0])
    assert not progressive.views and progressive.poll()
