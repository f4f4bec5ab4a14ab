"""Reuse of results: a change runs the stages that it affects, and no others."""

from __future__ import annotations

from unittest.mock import Mock

import numpy as np
import pytest
from objects import add_camera, add_field
from rosy.rosy_addon.compositor import stages
from rosy.rosy_addon.core.cache import BAKE_CACHE
from rosy.rosy_addon.jobs.bake import bake
from rosy.rosy_addon.projection import project as projection
from test_up_to_date import obj, put

ALL = ["project", "surface_pixel_field", "lic_lengths"]


@pytest.fixture
def watched(monkeypatch):
    """A mock that notes the calls of the slow steps, in their order."""
    watched = Mock()
    for module, name in zip((projection, stages, stages), ALL, strict=True):
        watched.attach_mock(Mock(wraps=getattr(module, name)), name)
        monkeypatch.setattr(module, name, getattr(watched, name))
    return watched


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


#: Changes, and the stages that depend on them.
CHANGES = {
    "vertex": (move_vertex, ALL),
    "field": (turn_field, ALL),
    "modifier": (subdivide, ALL),
    "camera": (put("Camera:location", (0.1, -5.0, 0.5)), ALL),
    "flat faces": (put("rosy.look.display", "flat"), ALL),
    "supersampling": (put("rosy.look.supersampling", 2), ALL),
    "crease angle": (put("rosy.look.crease_angle", 0.05), ALL[1:]),
    "length": (put("rosy.look.length", 20), ALL[2:]),
    "seed": (put("rosy.look.seed", 3), ALL[2:]),
    "guiding angle": (put("rosy.look.guiding_angle", 0.4), ALL[2:]),
    "hue of noise": (put("rosy.look.hue", "noise"), ALL[2:]),
    "length by magnitude": (put("rosy.look.magnitude_length", True), ALL[2:]),
    "method": (put("rosy.look.method", "members"), ALL[2:]),
    "hue of magnitude": (put("rosy.look.hue", "magnitude"), []),
    "gain": (put("rosy.look.gain", 1.0), []),
    "shading": (put("rosy.look.shading", 0.2), []),
    "light": (put("rosy.look.light", "scene"), []),
}


@pytest.mark.parametrize("name", CHANGES)
def test_a_change_runs_the_stages_that_depend_on_it(scene, camera, monkey, watched, name):
    change, stages_run = CHANGES[name]
    before = draw(scene)
    change(scene)
    watched.reset_mock()
    after = draw(scene)
    assert [name for name, *_ in watched.mock_calls] == stages_run
    assert not np.array_equal(before, after)
    BAKE_CACHE.clear()
    np.testing.assert_array_equal(after, draw(scene))


def test_results_of_two_cameras_are_kept(scene, camera, monkey, watched):
    other = add_camera("Other", location=(3, -4, 2))
    cameras = [scene.camera, other]
    bake(scene, cameras=cameras)
    watched.reset_mock()
    bake(scene, cameras=cameras)
    assert not watched.mock_calls
