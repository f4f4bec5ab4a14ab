"""Backdrops: paper behind everything that a camera sees."""

from __future__ import annotations

import bpy
import numpy as np
import pytest
from rosy.rosy_addon.compositor.look import Look
from rosy.rosy_addon.core.color import from_hex, to_linear
from rosy.rosy_addon.jobs.animation import bake_animation
from rosy.rosy_addon.jobs.bake import bake
from rosy.rosy_addon.scene.bake_records import remove_bakes
from rosy.rosy_addon.scene.camera_planes import frame_corners, update_backdrops
from rosy.rosy_addon.scene.cameras import camera_of_object
from rosy.rosy_addon.scene.look_properties import apply_look
from rosy.rosy_addon.scene.pictures import OutputSettings
from scenes import contents, pixels, render

PAPER = Look(ink="hatch", paper_color="#c08040")


def backdrops():
    return [obj for obj in bpy.data.objects if obj.get("rosy_backdrop")]


@pytest.fixture
def hatched(monkey, camera, scene):
    """A scene whose look has brown paper."""
    apply_look(scene.rosy, PAPER)
    return scene


@pytest.mark.parametrize("kind", ["PERSP", "ORTHO"])
def test_corners_are_those_of_the_frame(scene, camera, kind):
    camera.data.type, camera.data.shift_x, camera.data.shift_y = kind, 0.2, -0.1
    scene.render.resolution_x = 192
    view = camera_of_object(scene, bpy.context.evaluated_depsgraph_get(), camera)
    corners = frame_corners(view, 30.0)
    np.testing.assert_allclose(corners[:, 2], -30.0)
    clip = np.c_[corners, np.ones(4)] @ view.projection.T
    ndc = clip[:, :2] / clip[:, 3:]
    np.testing.assert_allclose(ndc, [(-1, -1), (1, -1), (1, 1), (-1, 1)], atol=1e-9)


def test_without_the_switch_or_without_paper_there_is_none(hatched):
    bake(hatched)
    assert not backdrops()
    apply_look(hatched.rosy, Look())
    hatched.rosy.backdrop = True
    bake(hatched)
    assert not backdrops()


def test_the_switch_shows_and_hides_the_backdrop(hatched):
    before = contents()
    bake(hatched)
    baked = contents()
    hatched.rosy.backdrop = True
    (obj,) = backdrops()
    assert obj.parent == hatched.camera and obj.hide_select and not obj.visible_shadow
    hatched.rosy.backdrop = False
    assert contents() == baked
    hatched.rosy.backdrop = True
    remove_bakes(hatched)
    update_backdrops(hatched)
    assert contents() == before


def test_animations_have_the_backdrop_of_the_active_camera(hatched, tmp_path):
    hatched.rosy.backdrop = True
    bake_animation(hatched, range(1, 2), settings=OutputSettings(folder=tmp_path))
    (obj,) = backdrops()
    assert obj.parent == hatched.camera


def test_pictures_do_not_depend_on_the_backdrop(hatched):
    (first,) = bake(hatched)
    hatched.rosy.backdrop = True
    (second,) = bake(hatched)
    assert len(backdrops()) == 1
    np.testing.assert_array_equal(first.picture.rgba, second.picture.rgba)


@pytest.mark.parametrize("kind", ["PERSP", "ORTHO"])
def test_renders_show_paper_all_over_the_background(hatched, tmp_path, kind):
    data = hatched.camera.data
    data.type, data.ortho_scale, data.shift_x, data.shift_y = kind, 6.0, 0.3, 0.1
    hatched.camera.scale = (2.0, 0.5, 3.0)
    hatched.render.resolution_x = 192
    hatched.rosy.backdrop = True
    (result,) = bake(hatched)
    rendered = render(hatched, tmp_path / "render.exr")
    background = pixels(result.image)[..., 3] == 0
    for axis in (0, 1):  # without the pixels at the edge of the object
        background &= np.roll(background, 1, axis) & np.roll(background, -1, axis)
    assert 0.3 < background.mean() < 0.95
    np.testing.assert_allclose(
        rendered[background],
        [*to_linear(from_hex(PAPER.paper_color)), 1.0] * np.ones((background.sum(), 1)),
        atol=1e-3,
    )
