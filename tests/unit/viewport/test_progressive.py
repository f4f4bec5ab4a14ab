"""Previews and final pictures of views, with a renderer that only notes what it does."""

from __future__ import annotations

import numpy as np
import pytest

from rosy_addon.compositor.look import Look
from rosy_addon.errors import RosyError
from rosy_addon.progress import Progress
from rosy_addon.projection.camera import orthographic_camera
from rosy_addon.rendering.view_input import ViewInput
from rosy_addon.viewport.progressive import ProgressiveRenderer

POINTERS = 1, 2


class NotingRenderer:
    """A `ViewportRenderer` that notes its steps in `done`, and fails in those named in `failing`."""

    downscale_factors = 2, 1
    needs_occluders = False

    def __init__(self):
        self.done, self.failing = [], set()

    def _step(self, name):
        self.done.append(name)
        if name in self.failing:
            raise MemoryError

    def prepare_task(self, instances, display):
        for name in ("compile", "compile", "upload a mesh"):
            yield Progress(0.0, name)
            self._step(name)

    def upload(self, instances, display):
        return ["item"]

    def covered_pixels(self, items, camera):
        return camera.width * camera.height

    def render_texture_task(self, items, view, target_key=None):
        for name in ("visibility", "lines"):
            yield Progress(0.0, name)
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


@pytest.fixture
def progressive():
    return ProgressiveRenderer(NotingRenderer(), lambda seconds: None)


def test_each_step_of_the_first_picture_is_named_before_it_begins(progressive, view_input):
    done = progressive.renderer.done
    for _ in range(20):
        view = progressive.update(POINTERS, "key", view_input)
        if view.texture is not None:
            break
        count = len(done)
        assert view.progress.label not in done or view.progress.label == done[-1]
        assert count <= 5
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
    count = len(renderer.done)
    for _ in range(3):
        with pytest.raises(RosyError, match="not enough memory"):
            progressive.update(POINTERS, "key", view_input)
    assert len(renderer.done) == count
    renderer.failing.clear()
    for _ in range(20):
        if progressive.update(POINTERS, "another key", view_input).texture is not None:
            return
    raise AssertionError("it was not tried again")
