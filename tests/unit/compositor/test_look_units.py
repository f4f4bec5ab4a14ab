"""Looks in pixels of a frame: lengths, Blender units and samples."""

from dataclasses import replace

import numpy as np
import pytest
from shapes import instance_of, torus

from rosy_addon.compositor.flow import Drift
from rosy_addon.compositor.look import Look
from rosy_addon.compositor.look_units import in_percent, pixel_look, preview_look
from rosy_addon.core.settings import pixel_lengths
from rosy_addon.projection.camera import look_at, orthographic_camera

LOOK = Look(flow=1.0, arrows=20.0, overshoot=3.0, outline=2.0, unit="scene", unit_size=0.1)


@pytest.mark.parametrize("side", [2, 3])
def test_samples_have_the_same_lengths_in_the_picture(side):
    pixels = pixel_look(LOOK, drift=Drift(0.3, 0.5))
    samples = pixels.in_samples(side)
    for setting in pixel_lengths(Look):
        assert getattr(samples, setting.name) == side * getattr(pixels, setting.name)
    assert samples.flow_distance == side * pixels.flow_distance == side * 0.5 * LOOK.length
    assert samples.pixel_size * side == pytest.approx(pixels.pixel_size)
    assert samples.flow_phase == pixels.flow_phase == 0.3


def test_lengths_in_blender_units_do_not_depend_on_the_distance():
    instance = instance_of(torus(12, 6), 4, "axis")
    for scale in (2.0, 8.0):
        camera = orthographic_camera(look_at((0, -5, 0), (0, 0, 0)), 200, 200, scale=scale)
        drawn = pixel_look(LOOK, camera, [instance])
        # A pixel is rounded to a 32nd of an octave.
        assert drawn.line_width * scale / 200 == pytest.approx(1.5 * 0.1, rel=0.011)
        assert drawn.line_width * drawn.pixel_size == pytest.approx(1.5 * 0.1)


def test_lengths_in_percent_are_the_same_part_of_every_picture():
    look, camera = Look(unit="percent"), orthographic_camera(np.eye(4), 1920, 1080, scale=1.0)
    for width, supersampling in ((960, 1), (3840, 1), (3840, 2)):
        drawn = pixel_look(look, camera.resized(width, 540), supersampling=supersampling)
        assert drawn.line_width == pytest.approx(1.5 * width / 1920)
    # In a 3D view, the frame of a camera may fill a half of the width. A preview has fewer pixels.
    view = replace(camera, picture_share=0.5)
    assert pixel_look(look, view).line_width == pytest.approx(0.75)
    wide = replace(look, line_width=6.0)
    preview = pixel_look(preview_look(wide, 2), view.resized(960, 540))
    assert preview.line_width == pytest.approx(1.5)
    assert pixel_look(replace(look, unit_size=0.5), camera).line_width == pytest.approx(14.4)


def test_lengths_in_millimeters_follow_the_resolution_of_the_print():
    look = Look(unit="millimeters", unit_size=0.1, dpi=600.0)
    camera = orthographic_camera(np.eye(4), 1000, 800, scale=1.0)
    assert pixel_look(look, camera).line_width == pytest.approx(0.15 / 25.4 * 600)
    assert pixel_look(replace(look, unit_size=0.0), camera).line_width == pytest.approx(3.0)
    # A 3D view shows a picture of 4000 pixels on 1000.
    view = replace(camera, width=2000, picture_share=0.5)
    on_screen = pixel_look(in_percent(replace(look, line_width=9.0), 4000), view)
    assert on_screen.line_width == pytest.approx(0.9 / 25.4 * 600 / 4)


def test_automatic_scene_units_follow_the_size_of_the_meshes():
    look, mesh, widths = Look(unit="scene"), torus(12, 6), []
    for size in (1.0, 100.0):
        instance = instance_of(mesh.with_vertices(size * mesh.vertices), 4)
        pose = look_at((0, -5 * size, 0), (0, 0, 0))
        camera = orthographic_camera(pose, 2000, 2000, scale=4 * size)
        widths.append(pixel_look(look, camera, [instance]).line_width)
    assert widths[0] == widths[1]
    extent = np.linalg.norm(np.ptp(instance.world_bounds(), axis=0))
    assert widths[0] == pytest.approx(1.5 * extent / 1024 / 400 * 2000, rel=0.011)


def test_keys_of_lic_images_know_the_magnitudes_that_set_lengths():
    look = Look(magnitude_length=True)
    ranges = (0.0, 0.0), (0.0, 1.0), (0.5, 1.0)
    keys = {pixel_look(replace(look, color_range=ends)).lic_key() for ends in ranges}
    assert len(keys) == 3
    colored = replace(look, magnitude_length=False, hue="magnitude", color_range=(0.0, 1.0))
    assert pixel_look(colored).lic_key() == pixel_look(Look()).lic_key()
    assert pixel_look(Look(hue="noise")).lic_key() != pixel_look(Look()).lic_key()
