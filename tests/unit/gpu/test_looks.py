"""Looks, lights, tones and colors: pictures of the card and of numpy, of the same pixels by brute force.

These tests are skipped without moderngl or without a context (EGL; software OpenGL is enough).
"""

from dataclasses import replace

import numpy as np
import pytest
from harness.gpu_parity import draw_pair
from harness.gpu_scenes import (
    BALL,
    FREE,
    LOOK,
    assert_parity,
    ball,
    card_rgba,
    draw,
    field_of,
    shown,
    smooth_field,
    view,
)
from shapes import plane

from rosy_addon.compositor.flow import NO_DRIFT, Drift
from rosy_addon.compositor.shading import Light
from rosy_addon.compositor.target_tone import ReferenceRender
from rosy_addon.field.frames import normalize
from rosy_addon.field.rosy_field import RosyField
from rosy_addon.preset_files.store import load_preset
from rosy_addon.projection.surface_tone import SurfaceTone


@pytest.mark.parametrize("perspective", [True, False])
@pytest.mark.parametrize("degree", [1, 3, 4, 12])
def test_all_degrees(card, degree, perspective):
    assert_parity(card, [ball(degree)], view(perspective=perspective))


BOTH = {"hue": "magnitude", "magnitude_length": True}
ON_SURFACE = {"anchor": "surface"}
HATCH = {"ink": "hatch", "shading": 0.9, "line_width": 2.5}
LIGHT_INK = HATCH | {"ink_color": "#ffd060", "paper_color": "#101020"}
EVEN = {"ink": "even", "shading": 0.9, "line_width": 3.0, "line_distance": 6.0}
UNEVEN = {"wobble": 0.7, "breaks": 0.4, "paper_grain": 0.5}
UNEVEN_IN_UNITS = ON_SURFACE | UNEVEN | {"unit": "scene", "unit_size": 0.012, "overshoot": 5.0}
#: Streaks that drift, at a phase at which no kernel is where it is at rest.
DRIFTING = {"flow": 2.0, "drift": Drift(0.2)}

#: These looks have every part of the shaders.
LOOKS = {
    "color noise": {"hue": "noise"},
    "magnitude as both, with an inverted range": BOTH | {"color_range": (1.1, 0.6)},
    "magnitude as both": BOTH | {"color_map": "magma"},
    "families, of a field without families": {"hue": "families"},
    "oriented, three directions": {"fade": "tail", "degree": 3, "density": 0.03, "seed": 1},
    "supersampled color noise": {"supersampling": 2, "hue": "noise", "degree": 3},
    "guided, five directions": {"guiding_angle": -2.5, "degree": 5},
    "shaded": {"shading": 0.7},
    "on the surface, supersampled": ON_SURFACE | {"supersampling": 2, "seed": 3},
    "on the surface, color noise": ON_SURFACE | {"hue": "noise", "high_pass": 0.0},
    "in Blender units": ON_SURFACE | {"unit": "scene", "unit_size": 0.007},
    "fine on small features": ON_SURFACE | {"detail": 0.7, "line_width": 2.5},
    "hatched": {"ink": "hatch", "shading": 1.0, "line_width": 3.0},
    "hatched, oriented": HATCH | {"fade": "tail", "degree": 5, "breaks": 0.4},
    "hatched, breaks and length by magnitude": HATCH | BOTH | {"breaks": 0.8, "degree": 3},
    "hatched on paper grain, supersampled": HATCH
    | {"paper_grain": 0.6, "supersampling": 2, "crispness": 0.3, "seed": 5},
    "hatched, an ink per family": HATCH | {"hue": "families", "degree": 6, "layering": 0.1},
    "hatched, ink ramp, light on dark": LIGHT_INK | {"hue": "tone", "ink_color_light": "#fff0f0"},
    "hatched in Blender units, uneven": HATCH | UNEVEN_IN_UNITS,
    "hatched, overshoot": HATCH | {"light": "lamp", "shadows": True, "overshoot": 9.0, "length": 7},
    "hatched, all effects": HATCH
    | ON_SURFACE
    | UNEVEN
    | {"hue": "families", "degree": 5, "guiding_angle": 0.5, "supersampling": 2},
    "even lines, supersampled": EVEN
    | {"light": "lamp", "supersampling": 2, "degree": 6, "layers": 2, "guiding_angle": 0.5},
    "even lines of an odd degree, soft": EVEN | {"degree": 3, "crispness": 0.3, "hue": "families"},
    "even lines in Blender units, uneven": EVEN | UNEVEN_IN_UNITS,
    "the method members": {"method": "members", "weights": "none", "view_plane": False},
    "drifting": DRIFTING,
    "drifting, oriented": DRIFTING | {"fade": "tail", "degree": 1, "density": 0.03},
    "drifting, three directions": DRIFTING
    | {"fade": "ends", "degree": 3, "drift": Drift(0.2, 0.4)},
    "drifting on the surface": DRIFTING | ON_SURFACE,
    "drifting, hatched, breaks and length by magnitude": DRIFTING
    | HATCH
    | {"breaks": 0.8, "magnitude_length": True, "degree": 3, "overshoot": 15.0},
    "drifting breaks of even lines": DRIFTING | EVEN | {"breaks": 0.7, "degree": 2},
}


def look_of(look_settings):
    """Return a look, the degree of its field, and how far its streaks have drifted."""
    look_settings = {"degree": 4, "drift": NO_DRIFT, **look_settings}
    degree, drift = look_settings.pop("degree"), look_settings.pop("drift")
    return LOOK.with_settings(look_settings), degree, drift


@pytest.mark.parametrize("name", LOOKS)
def test_looks(card, name):
    look, degree, drift = look_of(LOOKS[name])
    assert_parity(card, [ball(degree)], look=look, drift=drift)


def test_a_constant_magnitude_has_one_color(card):
    """Also around singularities, where directions cancel."""
    field = RosyField(4, normalize(smooth_field(BALL, 4).vectors))
    look = replace(LOOK, hue="magnitude", gain=0.0)
    rgba = card_rgba(card, [shown(BALL, field)], look)
    color = rgba[rgba[..., 3] == 1][:, :3]
    assert len(color) > 1000 and np.ptp(color, axis=0).max() < 0.005


UNDEFINED_LOOKS = {
    "soft": {},
    "hatched": HATCH,
    "hatched, all effects": LOOKS["hatched, all effects"],
    "drifting, hatched": DRIFTING | HATCH | {"fade": "ends"},
    "magnitude, left out": {"hue": "magnitude"},
    "families, left out": {"hue": "families", "undefined": "hidden"},
    "paper": {"undefined": "paper"},
    "magnitude, paper": {"hue": "magnitude", "undefined": "paper"},
    "magnitude, texture": {"hue": "magnitude", "undefined": "texture"},
    "hatched, left out": HATCH | {"undefined": "hidden"},
    "even": EVEN,
    "even, paper": EVEN | UNEVEN | {"undefined": "paper"},
}


@pytest.mark.parametrize("name", UNDEFINED_LOOKS)
def test_where_the_field_is_undefined(card, name):
    look, _, drift = look_of(UNDEFINED_LOOKS[name])
    center = BALL.face_center
    is_undefined = (center[:, :1] > 0.2) | (center[:, 2:] > 0.6)
    vectors = np.where(is_undefined, 0.0, smooth_field(BALL, 3).vectors)
    field = RosyField(3, vectors, family_count=3)
    assert_parity(card, [shown(BALL, field)], look=look, drift=drift)


@pytest.mark.parametrize(
    "look_settings", [{}, BOTH | {"undefined": "paper"}, {"hue": "families"}], ids=str
)
def test_a_field_that_is_undefined_everywhere(card, look_settings):
    field = RosyField(4, np.zeros((BALL.face_count, 3)))
    rgba = card_rgba(card, [shown(BALL, field)], replace(LOOK, **look_settings))
    assert np.isfinite(rgba).all() and rgba[..., 3].any()


def test_subpixels(card):
    """Borders have the color of their covered part."""
    pair = assert_parity(card, [ball(2)], look=replace(LOOK, supersampling=3, line_width=3.0))
    border = (pair.numpy[..., 3] > 0) & (pair.numpy[..., 3] < 1) & (pair.card[..., 3] > 0)
    assert border.sum() > 100
    colors = (picture[border][:, :3].mean() for picture in (pair.card, pair.numpy))
    np.testing.assert_allclose(*colors, atol=0.01)


@pytest.mark.parametrize("preset", ["default", "plaid", "cross-hatch", "charcoal"])
def test_samples_show_what_numpy_draws(card, preset):
    """Tone and contrast of the default method, whose streaks are smooth in another way."""
    look = replace(load_preset(preset).look, supersampling=2)
    drawn = [draw(each, [ball()], look, view((240, 216))).rgba for each in (card, None)]
    inside = np.logical_and(*(rgba[..., 3] == 1 for rgba in drawn))
    of_card, of_numpy = (rgba[inside][:, :3] for rgba in drawn)
    assert inside.sum() > 10_000
    np.testing.assert_allclose(of_card.mean(), of_numpy.mean(), rtol=0.01)
    np.testing.assert_allclose(of_card.std(), of_numpy.std(), rtol=0.03)
    assert np.corrcoef(of_card.ravel(), of_numpy.ravel())[0, 1] > 0.93


@pytest.mark.parametrize("paper", ["#ffffff00", "#e0c08080"])
@pytest.mark.parametrize("hue", ["one", "families"])
def test_ink_on_paper_that_is_not_opaque(card, hue, paper):
    hatched = LOOK.with_settings(LOOKS["hatched"])
    look = replace(hatched, paper_color=paper, hue=hue, light="headlight")
    pair = draw_pair(card, [ball()], view(), look)
    card_alpha, numpy_alpha = (picture[..., 3] for picture in (pair.card, pair.numpy))
    assert 0.2 < numpy_alpha[numpy_alpha > 0].mean() < 0.8
    assert np.corrcoef(card_alpha.ravel(), numpy_alpha.ravel())[0, 1] > 0.98
    both = (card_alpha > 0.2) & (numpy_alpha > 0.2)
    medians = (np.median(picture[both], axis=0) for picture in (pair.card, pair.numpy))
    np.testing.assert_allclose(*medians, atol=0.01)


# --- light ---------------------------------------------------------------------------------------

SUN = Light("sun", np.array([0.6, 0.0, 0.8]), np.array([1.0, 0.6, 0.3]), 0.9)
POINT = Light("point", np.array([-1.0, 0.5, -2.0]), np.array([0.2, 0.5, 1.0]), 3.0)


@pytest.mark.parametrize("lights", [[], [SUN], [POINT], [SUN, POINT]])
@pytest.mark.parametrize("perspective", [True, False])
def test_lights_of_the_scene(card, lights, perspective):
    look = replace(LOOK, shading=0.8, light="scene")
    assert_parity(card, [ball()], view(perspective=perspective), look, lights=lights)


def test_a_headlight_ignores_lights(card):
    look = replace(LOOK, shading=0.8, light="headlight")
    dark, lit = (card_rgba(card, [ball()], look, lights=lights) for lights in ((), (SUN,)))
    np.testing.assert_array_equal(dark, lit)


@pytest.mark.parametrize("ink", ["soft", "hatch"])
def test_shadows(card, ink):
    """On the ground, on each other, and of an occluder; with one shadow map of a light or six."""
    ground = plane(4, 4)
    instances = [
        shown(ground, field_of(ground, 4), 2.0, (0, 0, -0.6)),
        ball(4, 0.5, (-0.5, 0.2, 0)),
        shown(BALL, None, 0.3, (0.6, -0.3, 0.1)),
    ]
    look = replace(LOOK, light="scene", shading=0.9, ink=ink)
    shaded = assert_parity(card, instances, look=look, lights=[SUN, POINT], agreement=0.995)
    without = [replace(light, has_shadow=False) for light in (SUN, POINT)]
    bare = card_rgba(card, instances, look, lights=tuple(without))
    assert shaded.card[..., :3].mean() < 0.98 * bare[..., :3].mean()


# --- tones and numbers ---------------------------------------------------------------------------

TONED = {
    "unchanged": {},
    "lit": {"tone_lit": True, "light": "lamp", "shading": 0.8},
    "tone curve": {"tone_levels": (0.2, 0.7, 1.8)},
    "inverted": {"tone_levels": (1.0, 0.0, 1.0)},
    "hatched": {"ink": "hatch", "line_width": 3.0},
}


def toned(tone, field=None, linear=1.0, shift=(0, 0, 0)):
    """Return a ball with a surface tone."""
    return replace(shown(BALL, field or field_of(BALL, 4), linear, shift), tone=tone)


def waves():
    """Return a tone of waves, as numbers at corners."""
    values = 0.5 + 0.4 * np.sin(3 * BALL.vertices[BALL.corner_vertex] @ (1.0, 0.3, 0.5))
    return SurfaceTone(values[:, None].astype(np.float32))


def checkerboard(repeat):
    """Return a checkerboard image and a UV map of the ball, on which some texels are very small."""
    x, y, z = BALL.vertices[BALL.corner_vertex].T
    uv = np.stack([0.5 + 0.5 * x + 0.1 * z, 0.5 + 0.5 * z - 0.1 * y], axis=1) * repeat
    row, column = np.indices((200, 230))
    board = 0.2 + 0.6 * ((row // 11 + column // 13) % 2)
    return SurfaceTone(uv.astype(np.float32), board.astype(np.float32))


def reference_of(resolution):
    luminance = np.random.default_rng(1).random((18 * resolution, 20 * resolution))
    return ReferenceRender(luminance.astype(np.float32), view(azimuth=0.5))


@pytest.mark.parametrize("name", TONED)
@pytest.mark.parametrize(("tone", "scale"), [("image", 0.5), ("image", 3), ("picture", 1)])
def test_tones(card, name, tone, scale):
    """Of images and of pictures, of more texels or fewer than the picture has pixels."""
    look = replace(LOOK, tone=tone, **TONED[name])
    instance = toned(checkerboard(scale) if tone == "image" else None)
    reference = reference_of(scale) if tone == "picture" else None
    assert_parity(card, [instance], look=look, reference=reference)


@pytest.mark.parametrize(
    ("name", "perspective"), [*((name, True) for name in TONED), ("unchanged", False)]
)
def test_tones_of_attributes(card, name, perspective):
    look = replace(LOOK, tone="attribute", **TONED[name])
    assert_parity(card, [toned(waves())], view(perspective=perspective), look)


def test_meshes_without_a_tone_use_the_light(card):
    instances = [toned(waves(), None, 0.5, (-0.6, 0, 0)), ball(4, 0.5, (0.6, 0, 0))]
    look = replace(LOOK, tone="attribute", tone_levels=(0.0, 1.0, 1.5), shading=0.8)
    assert_parity(card, instances, look=look)


COLORED = {
    "soft": {},
    "hatched": {"ink": "hatch", "line_width": 3.0, "outline": 2.0},
    "light ink": {"ink": "hatch", "ink_color": "#f0f0e0", "paper_color": "#101018", "layers": 1},
    "inks that are nearly paper": {"ink": "hatch", "shading": 0.95, "light": "lamp"}
    | {"line_width": 3.0, "color_range": (-1.0, 1.0), "color_map": "gray"},
    "a range, inverted": {"color_range": (0.8, 0.2), "color_map": "magma"},
    "with tones": {"tone": "attribute", "tone_levels": (0.0, 1.0, 1.5)},
}


def numbered(tone=None, field=None, linear=1.0, shift=(0, 0, 0)):
    """Return a ball with numbers of waves, and without some of them on one side."""
    x = BALL.vertices[BALL.corner_vertex, 0]
    values = np.where(x > 0.3, np.nan, waves().values[:, 0]).astype(np.float32)
    return replace(toned(tone, field, linear, shift), color_values=values)


@pytest.mark.parametrize("name", COLORED)
def test_colors_of_numbers(card, name):
    look = replace(LOOK, hue="values", **COLORED[name])
    assert_parity(card, [numbered(waves() if look.tone == "attribute" else None)], look=look)


def test_numbers_beside_meshes_without_them(card):
    """The numbers that are out of view count for the range."""
    hidden = numbered(linear=0.5, shift=(0, 0, 90))
    hidden = replace(hidden, color_values=3 * hidden.color_values)
    instances = [numbered(linear=0.5, shift=(-0.6, 0, 0)), ball(4, 0.5, (0.6, 0, 0)), hidden]
    assert_parity(card, instances, look=replace(LOOK, hue="values"))


@pytest.mark.parametrize("hue", ["one", "values"])
def test_tones_and_numbers_with_free_directions(card, hue):
    """The records then contain channels as well."""
    field = FREE["two lines"](BALL)
    instance = toned(waves(), field) if hue == "one" else numbered(waves(), field)
    look = replace(LOOK, tone="attribute", hue=hue, anchor="surface" if hue == "one" else "picture")
    assert_parity(card, [instance], look=look)
