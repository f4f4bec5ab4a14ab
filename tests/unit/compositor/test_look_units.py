"""Looks in pixels of a frame: lengths, Blender units and samples."""

from dataclasses import replace

import pytest
from shapes import instance_of, torus

from rosy_addon.compositor.flow import Drift
from rosy_addon.compositor.look import Look
from rosy_addon.compositor.look_units import pixel_look
from rosy_addon.core.settings import pixel_lengths
from rosy_addon.projection.camera import look_at, orthographic_camera

LOOK = Look(flow=1.0, arrows=20.0, overshoot=3.0, outline=2.0, unit_size=0.1)


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


def test_keys_of_lic_images_know_the_magnitudes_that_set_lengths():
    look = Look(magnitude_length=True)
    ranges = (0.0, 0.0), (0.0, 1.0), (0.5, 1.0)
    keys = {pixel_look(replace(look, color_range=ends)).lic_key() for ends in ranges}
    assert len(keys) == 3
    colored = replace(look, magnitude_length=False, hue="magnitude", color_range=(0.0, 1.0))
    assert pixel_look(colored).lic_key() == pixel_look(Look()).lic_key()
    assert pixel_look(Look(hue="noise")).lic_key() != pixel_look(Look()).lic_key()
