"""A picture is the same to the last bit, however its strips are grouped, and has no seams between them."""

from dataclasses import replace

import numpy as np
import pytest
from shapes import icosphere, instance_of, moved, plane, torus

from rosy_addon.compositor import strip_division
from rosy_addon.compositor.look import Look
from rosy_addon.compositor.strip_division import divide_into_strips, group_strips
from rosy_addon.compositor.strips import FADE_ROWS, Strip, join_strips
from rosy_addon.field.generate import axis_field
from rosy_addon.preset_files.store import load_preset
from rosy_addon.projection.camera import look_at, perspective_camera
from rosy_addon.projection.gbuffer import MeshInstance
from rosy_addon.rendering.draw import draw_picture
from rosy_addon.rendering.view_input import ViewInput

WIDTH, HEIGHT = 64, 320
CAMERA = perspective_camera(look_at((0.4, -6.0, 3.0), (0, 0, 0.5)), WIDTH, HEIGHT, fov=0.5)


@pytest.fixture(autouse=True)
def _many_strips(monkeypatch):
    """Small pictures have strips, too."""
    monkeypatch.setattr(strip_division, "STRIP_STATES", 1 << 14)
    monkeypatch.setattr(strip_division, "MIN_STRIP_MARGINS", 1)


def instances() -> tuple[MeshInstance, ...]:
    """A torus with a field of degree 4, and in front a ball with one of degree 3."""
    ball = instance_of(icosphere(3), 3, matrix=moved(0.2, -0.5, 1.0))
    return instance_of(torus(30, 15), 4, "axis"), ball


PAPER_GRAIN = {"anchor": "surface", "high_pass": 0.0, "ink": "hatch", "paper_grain": 0.8}

#: Looks that need each kind of rows around a strip.
LOOKS = {
    "default": Look(length=14),
    "color noise, by families": Look(length=14, hue="noise", supersampling=2),
    "cross-hatch": replace(load_preset("cross-hatch").look, length=14, overshoot=4.0),
    "wide paper grain": Look(length=6, line_width=10.0, supersampling=2, **PAPER_GRAIN),
    "flow": Look(length=10, flow=1.0, supersampling=2),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", LOOKS)
def test_strips_depend_on_their_context_alone(name, monkeypatch):
    view = ViewInput(instances(), CAMERA, LOOKS[name])
    strips = divide_into_strips(view.look, CAMERA, view.instances)
    assert len(strips) > 2 and (strips[0].start, strips[-1].stop) == (0, HEIGHT)
    together = draw_picture(view).rgba
    monkeypatch.setattr(strip_division, "MAX_GROUP_PIXELS", 1)
    groups = group_strips(strips, view.look, CAMERA, view.instances, 1)
    assert [len(group) for group in groups] == [1] * len(strips)
    assert draw_picture(view).rgba.tobytes() == together.tobytes()


@pytest.mark.parametrize(
    "look", [load_preset("engraving").look, Look(hue="magnitude"), Look(high_pass=1024.0)]
)
def test_pictures_that_depend_on_all_pixels_are_one_group(look):
    strips = divide_into_strips(look, CAMERA, instances())
    assert group_strips(strips, look, CAMERA, instances(), 2) == [strips]


@pytest.mark.parametrize("look", [Look(method="brute"), Look(length=200)])
def test_other_methods_and_long_streamlines_have_one_strip(look):
    assert divide_into_strips(look, CAMERA, instances()) == [Strip(0, HEIGHT, HEIGHT)]


def test_strips_leave_no_seam(monkeypatch):
    """Of vertical streaks: a seam would be a large change between two rows."""
    sheet = plane()
    field = axis_field(sheet, 2, (0.1, 1, 0))
    camera = perspective_camera(look_at((0.0, -0.1, 3.0), (0, 0, 0)), 64, 1024, fov=0.3)
    view = ViewInput((MeshInstance(sheet, np.eye(4), field),), camera, Look(shading=0.0))
    strips = divide_into_strips(view.look, camera, view.instances)
    assert len(strips) >= 4
    change = np.abs(np.diff(draw_picture(view).rgba[..., 0], axis=0)).mean(axis=1)
    borders = [strip.start + row for strip in strips[1:] for row in range(-4, FADE_ROWS + 4)]
    assert change[borders].mean() == pytest.approx(change.mean(), rel=0.15)


def test_joining_fades_from_one_strip_to_the_next():
    strips = [Strip(0, 20, 60), Strip(20, 40, 60)]
    low, high = (np.full((20 + FADE_ROWS, 3, 4), value, dtype=np.float32) for value in (0.2, 0.8))
    low[..., 3] = high[..., 3] = 1
    joined = join_strips([low, high], strips)
    assert joined.shape == (40 + FADE_ROWS, 3, 4)
    assert (joined[:21] == low[:21]).all() and (joined[20 + FADE_ROWS :] == 0.8).any()
    assert (np.diff(joined[20 : 21 + FADE_ROWS, 0, 0]) > 0).all() and (joined[..., 3] == 1).all()
