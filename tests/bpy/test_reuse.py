"""Reuse of results: a change runs the stages that it affects, and no others."""

from functools import partial

import numpy as np
import pytest
from objects import add_camera, add_field
from rosy.rosy_addon.compositor import stages
from rosy.rosy_addon.core.cache import BAKE_CACHE
from rosy.rosy_addon.jobs.bake import bake
from rosy.rosy_addon.projection import project as projection
from test_up_to_date import obj

ALL = ["project", "surface_pixel_field", "lic_lengths"]


@pytest.fixture
def run_stages(monkeypatch):
    """The names of the slow steps that were run, in their order."""
    names = []

    def noted(name, step, *arguments, **options):
        names.append(name)
        return step(*arguments, **options)

    for module, name in zip((projection, stages, stages), ALL, strict=True):
        monkeypatch.setattr(module, name, partial(noted, name, getattr(module, name)))
    return names


def draw(scene):
    return bake(scene)[0].picture.rgba


def move_vertex(scene):
    mesh = obj("Suzanne").data
    mesh.vertices[100].co.z += 0.2
    mesh.update()


def turn_field(scene):
    add_field(obj("Suzanne"), kind="axis", axis=(0.3, 1.0, 0.2))


def subdivide(scene):
    obj("Suzanne").modifiers.new("Subdivision", "SUBSURF").levels = 1


def move_camera(scene):
    scene.camera.location.x += 0.1


def look(name, value):
    return lambda scene: setattr(scene.rosy.look, name, value)


#: Changes, and the stages that depend on them.
CHANGES = {
    "vertex": (move_vertex, ALL),
    "field": (turn_field, ALL),
    "modifier": (subdivide, ALL),
    "camera": (move_camera, ALL),
    "flat faces": (look("display", "flat"), ALL),
    "supersampling": (look("supersampling", 2), ALL),
    "crease angle": (look("crease_angle", 0.05), ALL[1:]),
    "length": (look("length", 20), ALL[2:]),
    "seed": (look("seed", 3), ALL[2:]),
    "guiding angle": (look("guiding_angle", 0.4), ALL[2:]),
    "hue of noise": (look("hue", "noise"), ALL[2:]),
    "length by magnitude": (look("magnitude_length", True), ALL[2:]),
    "method": (look("method", "members"), ALL[2:]),
    "hue of magnitude": (look("hue", "magnitude"), []),
    "gain": (look("gain", 1.0), []),
    "shading": (look("shading", 0.2), []),
    "light": (look("light", "lamp"), []),
}


@pytest.mark.parametrize("name", CHANGES)
def test_a_change_runs_the_stages_that_depend_on_it(scene, camera, monkey, run_stages, name):
    change, stages_run = CHANGES[name]
    before = draw(scene)
    change(scene)
    run_stages.clear()
    after = draw(scene)
    assert run_stages == stages_run
    assert not np.array_equal(before, after)
    BAKE_CACHE.clear()
    np.testing.assert_array_equal(after, draw(scene))


def test_results_of_two_cameras_are_kept(scene, camera, monkey, run_stages):
    other = add_camera("Other", location=(3, -4, 2))
    cameras = [scene.camera, other]
    bake(scene, cameras=cameras)
    run_stages.clear()
    bake(scene, cameras=cameras)
    assert not run_stages
