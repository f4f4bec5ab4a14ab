"""Strokes that follow a look have its distances, widths, light, outline and colors."""

import re

import numpy as np
import pytest
from shapes import instance_of, torus

import rosy_addon as rf
from rosy_addon.compositor.look import Look
from rosy_addon.compositor.look_units import pixel_look
from rosy_addon.line_drawing.from_look import SETTINGS_OF_LOOK, strokes_of_look
from rosy_addon.line_drawing.style import StrokeStyle
from rosy_addon.line_drawing.svg import Pen
from rosy_addon.projection.camera import orthographic_camera

INK = Look(ink="even", line_distance=6.0, outline=2.0, overshoot=3.0, shading=0.5, light="lamp")
CAMERA = orthographic_camera(np.eye(4), 1920, 1080, scale=1.0)


@pytest.mark.parametrize(("width", "factor"), [(960, 0.5), (1920, 1.0), (3840, 2.0)])
def test_strokes_and_pictures_have_the_same_lengths(width, factor):
    look = pixel_look(INK.with_settings({"unit": "percent"}), CAMERA.resized(width, 540))
    style, pen = strokes_of_look(look, StrokeStyle(), Pen())
    assert style.spacing == pytest.approx(6 * factor) and pen.width == pytest.approx(4 * factor)
    assert style.outline * pen.width == pytest.approx(2 * factor)
    assert style.overshoot == pytest.approx(3 * factor)
    assert (style.light, style.swell, style.layering) == ("lamp", 1.0, INK.layering)


def test_the_panel_knows_which_settings_a_look_sets():
    look = INK.with_settings({"unit": "scene", "arrows": 9.0, "singularity_dots": "all"})
    look = look.with_settings({"singularity_size": 5.0, "layering": 0.1})
    instance = instance_of(torus(12, 6), 4, "axis")
    style, _ = strokes_of_look(pixel_look(look, CAMERA, [instance]), StrokeStyle(), Pen())
    changed = {name for name, value in vars(style).items() if value != getattr(StrokeStyle(), name)}
    assert changed == {*SETTINGS_OF_LOOK}


def test_soft_streaks_set_neither_spacing_nor_ink():
    look = pixel_look(Look(shading=0.0, outline=3.0))
    style, pen = strokes_of_look(look, StrokeStyle(spacing=11.0, gaps=0.5), Pen(colors=["navy"]))
    assert (style.spacing, style.gaps, style.light, style.outline) == (11.0, 0.5, "none", 1.0)
    assert pen == Pen(colors=["navy"])


def test_drawings_take_what_is_not_given_from_the_preset():
    square = rf.Surface([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], [[0, 1, 2, 3]])
    picture = {"view": (0, 90), "size": (200, 200), "preset": "engraving", "light": "none"}
    svg = rf.strokes(square, rf.along_axis(square, (1, 0, 0), 2), taper=0.0, **picture).svg
    assert 'stroke="#1c140c"' in svg and 'fill="#f6efdf"' in svg
    assert set(re.findall(r'stroke-width="([\d.]+)"', svg)) == {f"{5.6 / 1.5:.3g}"}
    svg = rf.strokes(square, width=3.0, colors=["navy"], paper=None, **picture).svg
    assert 'stroke="navy"' in svg and 'stroke-width="3"' in svg and "<rect" not in svg
