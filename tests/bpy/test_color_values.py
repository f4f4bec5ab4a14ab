"""Attributes whose numbers are colors: how they are read, their pictures, and mistakes."""

from __future__ import annotations

import numpy as np
import pytest
from objects import add_uv, set_attribute
from rosy.rosy_addon.compositor.look import Look
from rosy.rosy_addon.jobs.bake import bake
from rosy.rosy_addon.jobs.bake_texture import bake_texture
from rosy.rosy_addon.scene.bake_records import list_bakes
from rosy.rosy_addon.scene.look_inputs import ReadRequest
from rosy.rosy_addon.scene.read_view import read_turntable
from rosy.rosy_addon.scene.scene_reader import read_scene
from scenes import depsgraph, expect_error


def set_values(mesh, values, name="Angle"):
    set_attribute(mesh, values, name, kind="FLOAT")


def values_of(name, obj):
    scene_data = read_scene(depsgraph(), None, ReadRequest(color_attribute=name))
    return scene_data.instances[scene_data.objects.index(obj)].color_values


def test_numbers_that_are_not_finite_are_none(wall, monkey):
    set_values(wall.data, [np.nan, np.inf, 2.0, 3.0])
    expected = np.repeat([np.nan, np.nan, 2.0, 3.0], 4)
    np.testing.assert_array_equal(values_of("Angle", wall), expected)
    assert values_of("Angle", monkey) is None


def test_mistakes_are_one_line_that_lists_the_attributes(wall):
    set_values(wall.data, np.zeros(4), name="Error")
    only = "'Error'$"
    expect_error(f"^'Plane': there is no attribute 'Angel' .*only {only}", values_of, "Angel", wall)
    expect_error(f"^'Plane': choose an attribute for the colors.*: {only}", values_of, "", wall)
    expect_error("object 'Plane', attribute 'rosy': expected a number", values_of, "rosy", wall)


@pytest.fixture
def colored(scene, wall):
    """The wall with a number on each face, drawn in flat colors."""
    set_values(wall.data, [0.0, 1.0, 2.0, np.nan])
    look = scene.rosy.look
    look.hue, look.gain, look.shading, scene.rosy.color_attribute = "values", 0.0, 0.0, "Angle"
    return wall


def test_turntables_have_the_numbers(scene, colored):
    instance, _ = read_turntable(scene, depsgraph(), colored, Look(hue="values"))
    assert np.isfinite(instance.color_values).sum() == 12


def test_textures(scene, colored):
    add_uv(colored.data)
    scene.rosy.texture_size, scene.rosy.texture_margin = 64, 0
    bake_texture(scene, [colored])
    (info,) = list_bakes(scene)
    assert info.stale_reason == ""
    set_values(colored.data, [0.0, 1.5, 2.0, 0.0])
    (info,) = list_bakes(scene)
    assert "'Plane' was changed" in info.stale_reason
    bake_texture(scene, [colored])
    scene.rosy.color_attribute = ""
    expect_error("choose an attribute", bake_texture, scene, [colored])
    # The thresholds of hatching have no color.
    scene.rosy.look.ink = "hatch"
    bake_texture(scene, [colored])


def test_relit_hatching_needs_no_numbers(scene, colored):
    scene.rosy.color_attribute = "none"
    scene.rosy.look.ink = "hatch"
    expect_error("no attribute 'none'", bake, scene)
    scene.rosy.relight = True
    bake(scene)
