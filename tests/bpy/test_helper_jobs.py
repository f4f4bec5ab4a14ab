"""Jobs whose calls a helper process makes give what they give in place."""

import numpy as np
import pytest
from harness.steps import finished
from objects import add_field, set_attribute
from rosy.rosy_addon.field.combing import GuideBrush
from rosy.rosy_addon.jobs.animation import bake_animation
from rosy.rosy_addon.jobs.bake import bake
from rosy.rosy_addon.jobs.bake_texture import bake_texture
from rosy.rosy_addon.jobs.comb_field import CombStroke
from rosy.rosy_addon.jobs.draw_strokes import draw_strokes
from rosy.rosy_addon.jobs.render_turntable import render_turntable
from rosy.rosy_addon.line_drawing.style import StrokeStyle
from rosy.rosy_addon.scene.computed_attributes import store_difference
from rosy.rosy_addon.scene.pictures import OutputSettings
from rosy.rosy_addon.worker.helper import Helper
from rosy.rosy_addon.worker.job import run
from rosy.rosy_addon.worker.step_runner import StepRunner
from scenes import member_vectors, pixels


@pytest.fixture(scope="module")
def helper():
    helper = Helper()
    yield helper
    helper.close()


@pytest.fixture
def run_with(helper):
    """A function that runs the steps of a job, given "in place" or "helper"."""

    def run_beside(steps):
        return finished(StepRunner(steps, helper), helper)

    return lambda where, steps: run(steps) if where == "in place" else run_beside(steps)


def picture(run_with, where, scene, monkey):
    return pixels(run_with(where, bake.begin(scene, workers=1))[0].image)


def texture(run_with, where, scene, monkey):
    scene.rosy.texture_size = 64
    monkey.data.uv_layers.new(name="UVMap")
    return pixels(run_with(where, bake_texture.begin(scene, [monkey]))[0].image)


def strokes(run_with, where, scene, monkey):
    style = StrokeStyle(spacing=20)
    result = run_with(where, draw_strokes.begin(scene, kind="CURVES", style=style))
    return result.drawing.strokes.points


def difference(run_with, where, scene, monkey):
    set_attribute(monkey.data, member_vectors(monkey.data), "other")
    add_field(monkey, kind="axis")
    return run_with(where, store_difference.begin(monkey.data, "other"))[2].difference.angle


def combed_field(run_with, where, scene, monkey):
    vectors = []
    for x in (-0.3, 0.3):  # the second stroke uses what the helper has kept
        stroke = CombStroke(monkey.data, GuideBrush(0.4, 1.0, "comb", False, True), 0.1)
        points = np.stack([np.linspace(x - 0.1, x + 0.1, 5), np.full(5, -0.8), np.full(5, 0.3)])
        stroke.extend(points.T, np.ones(5))
        stroke.lift()
        run_with(where, stroke.settle())
        vectors.append(stroke.store().vectors)
    return np.stack(vectors)


@pytest.mark.parametrize(
    "job", [picture, texture, strokes, difference, combed_field], ids=lambda job: job.__name__
)
def test_a_helper_computes_the_same(scene, camera, monkey, run_with, job):
    scene.render.resolution_x, scene.render.resolution_y = 80, 60
    original = monkey.data.copy()
    results = []
    for where in ("in place", "helper"):
        monkey.data = original.copy()
        results.append(job(run_with, where, scene, monkey))
    np.testing.assert_array_equal(*results)


def test_files_are_the_same(scene, camera, monkey, run_with, tmp_path):
    """Frames and a .gif."""
    scene.render.resolution_x, scene.render.resolution_y = 80, 60
    files = {}
    for where in ("in place", "helper"):
        folder = tmp_path / where
        settings = OutputSettings(folder=folder / "frames")
        run_with(where, bake_animation.begin(scene, [1, 2], settings=settings, workers=1))
        turntable = render_turntable.begin(
            scene, monkey, folder / "a.gif", count=3, rate=10.0, size=(64, 48), view_angles=(0, 20)
        )
        run_with(where, turntable)
        paths = [path for path in folder.rglob("*") if path.is_file()]
        files[where] = {path.relative_to(folder): path.read_bytes() for path in paths}
    assert len(files["helper"]) == 5 and files["in place"] == files["helper"]
