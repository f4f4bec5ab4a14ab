"""Reuse of results: a change runs the stages that it affects, and no others."""

from __future__ import annotations

import numpy as np
import pytest
from objects import add_camera, add_field
from rosy.rosy_addon.compositor import stages
from rosy.rosy_addon.core.cache import BAKE_CACHE
from rosy.rosy_addon.jobs.bake import bake
from rosy.rosy_addon.projection import project as projection


@pytest.fixture
def run_stages(monkeypatch):
    """The names of the slow steps that were run, in their order."""
    names = []

    def watch(module, name):
        real = getattr(module, name)

        def watched(*arguments, **options):
            names.append(name)
            return real(*arguments, **options)

        monkeypatch.setattr(module, name, watched)

    watch(projection, "project")
    watch(stages, "surface_pixel_field")
    watch(stages, "lic_lengths")
    return names


def draw(scene):
    return bake(scene)[0].picture.rgba


def draw_uncached(scene):
    BAKE_CACHE.clear()
    return draw(scene)


def move_vertex(scene, obj):
    obj.data.vertices[100].co.z += 0.2
    obj.data.update()


def turn_field(scene, obj):
    add_field(obj, kind="axis", axis=(0.3, 1.0, 0.2))


def subdivide(scene, obj):
    obj.modifiers.new("Subdivision", "SUBSURF").levels = 1


def move_camera(scene, obj):
    scene.camera.location.x += 0.1


def show_faces(scene, obj):
    scene.rosy.look.display = "flat"


@pytest.mark.parametrize("change", [move_vertex, turn_field, subdivide, move_camera, show_faces])
def test_a_change_runs_all_stages(scene, camera, monkey, run_stages, change):
    before = draw(scene)
    change(scene, monkey)
    run_stages.clear()
    after = draw(scene)
    assert run_stages == ["project", "surface_pixel_field", "lic_lengths"]
    assert not np.array_equal(before, after)
    np.testing.assert_array_equal(after, draw_uncached(scene))


@pytest.mark.parametrize(
    ("setting", "value", "stages_run"),
    [
        ("gain", 1.0, []),
        ("shading", 0.2, []),
        ("light", "scene", []),
        ("length", 20, ["lic_lengths"]),
        ("seed", 3, ["lic_lengths"]),
        ("guiding_angle", 0.4, ["lic_lengths"]),
        ("hue", "noise", ["lic_lengths"]),
        ("hue", "magnitude", []),
        ("magnitude_length", True, ["lic_lengths"]),
        ("method", "members", ["lic_lengths"]),
        ("crease_angle", 0.05, ["surface_pixel_field", "lic_lengths"]),
        ("supersampling", 2, ["project", "surface_pixel_field", "lic_lengths"]),
    ],
)
def test_a_setting_runs_the_stages_that_depend_on_it(
    scene, camera, monkey, run_stages, setting, value, stages_run
):
    before = draw(scene)
    setattr(scene.rosy.look, setting, value)
    run_stages.clear()
    after = draw(scene)
    assert run_stages == stages_run
    assert not np.array_equal(before, after)
    np.testing.assert_array_equal(after, draw_uncached(scene))


def test_results_of_two_cameras_are_kept(scene, camera, monkey, run_stages):
    other = add_camera("Other", location=(3, -4, 2))
    cameras = [scene.camera, other]
    bake(scene, cameras=cameras)
    run_stages.clear()
    bake(scene, cameras=cameras)
    assert not run_stages
