"""Hatching: its tone, lines along the field, inks, and lines that overshoot."""

from dataclasses import replace

import numpy as np
import pytest
from conftest import mainly
from harness.planar import planar_pixel_field
from hatched import (
    BALL,
    INK,
    SIZE,
    camera_above,
    camera_before_wall,
    make_camera,
    make_instance,
    make_wall,
    ramp_error,
    render,
)
from scipy.ndimage import gaussian_filter
from shapes import plane

from rosy_addon.compositor.compose import compose
from rosy_addon.compositor.even_lines import EvenLines
from rosy_addon.compositor.family_hues import line_families
from rosy_addon.compositor.hatching import HatchedLines, line_ink_indices, line_shares
from rosy_addon.compositor.inks import LUMINANCE_WEIGHTS, inks_of
from rosy_addon.compositor.look import Look
from rosy_addon.compositor.look_units import pixel_look
from rosy_addon.core.color import from_hex, to_display, to_linear
from rosy_addon.field.rosy_field import RosyField
from rosy_addon.preset_files.store import load_preset, preset_keys
from rosy_addon.projection.gbuffer import MeshInstance
from rosy_addon.projection.project import project
from rosy_addon.projection.surface_tone import SurfaceTone

#: These tests draw many pictures and measure them.
pytestmark = pytest.mark.slow

PRESETS = {name: load_preset(name).look for name in preset_keys()}
HATCHED = {name: look for name, look in PRESETS.items() if look.ink != "soft"}

COLORED_INKS = {
    "ramp": {"hue": "tone", "ink_color": "#201848"},
    "ramp, light": {
        "hue": "tone",
        "ink_color": "#c08050",
        "ink_color_light": "#fff0c0",
        "paper_color": "#182028",
    },
    "families": {"hue": "families"},
    "families, light": {"hue": "families", "ink_color": "#f0e8d0", "paper_color": "#101418"},
}

#: Looks whose ink has the tone of the light.
RAMPS = {
    **HATCHED,
    **{name: replace(INK, layers=3, **inks) for name, inks in COLORED_INKS.items()},
    "broken": replace(INK, breaks=1.0),
    "wobble": replace(INK, wobble=1.0),
    "paper grain": replace(INK, paper_grain=1.0),
    "all uneven": replace(INK, breaks=0.6, wobble=0.6, paper_grain=0.6),
    "overshoot": replace(INK, overshoot=12.0),
}


@pytest.mark.parametrize(
    "name",
    mainly(["cross-hatch", "engraving", "families, light", "ramp, light", "all uneven"], RAMPS),
)
def test_looks_reproduce_a_ramp(name):
    """A blur contains few lines, so that its tone has a random error, which is 0.03 in the mean."""
    assert ramp_error(RAMPS[name]) <= 0.04


@pytest.mark.parametrize("name", mainly(["pencil", "families", "ramp"], RAMPS))
def test_undefined_faces_keep_the_tone(name):
    """Without a direction, hatching draws an undirected texture of the tone of the light."""
    assert ramp_error(RAMPS[name], RosyField(4, np.zeros((BALL.face_count, 3)))) <= 0.03


def test_detail_shows_the_tone_of_small_features():
    """A ball of 20 pixels is drawn better, and a large one stays the same."""
    fine = replace(INK, detail=0.6)
    assert ramp_error(fine, zoom=0.12, sigma=2) < ramp_error(INK, zoom=0.12, sigma=2)
    instance, camera = make_instance(BALL), make_camera(zoom=12).resized(160, 160)
    np.testing.assert_array_equal(render(instance, camera, fine), render(instance, camera, INK))


@pytest.mark.parametrize("degree", [1, 2, 3, 4, 6, 7])
@pytest.mark.parametrize("layers", [1, 2, 3])
def test_shares_of_families_sum_to_one_and_are_continuous(degree, layers):
    """Shares sum to 1, and have no jumps as the field rotates relative to the guiding angle."""
    angles = np.linspace(-1, 1, 40001)[None]
    field = planar_pixel_field(angles, degree)
    look = Look(ink="hatch", layers=layers, guiding_angle=0.3)
    for tone in (0.02, 0.3, 0.7, 0.98):
        transmittance = np.full((1, angles.size), tone, dtype=np.float32)
        shares = np.array(line_shares(field, HatchedLines(pixel_look(look)), transmittance))
        np.testing.assert_allclose(shares.sum(axis=0), 1, atol=1e-5)
        # Members jump where two are equally near the guiding angle, but the sorted shares do not.
        assert np.abs(np.diff(np.sort(shares, axis=0), axis=1)).max() < 0.03
        # Where two families swap ranks, both are drawn, and possibly a third one.
        assert np.median((shares > 0.02).sum(axis=0)) <= min(layers, field.line_count)
        if layers >= field.line_count and tone < 0.1:
            # All lines are drawn, whatever their angle to the guiding angle.
            np.testing.assert_allclose(shares, 1 / field.line_count, atol=0.02)


def test_crowded_even_lines_are_drawn_last():
    """Where a surface turns away across the first lines, the ink of light tones is in the others."""
    field = planar_pixel_field(np.zeros((1, 3)), 4)
    look = Look(ink="even", line_distance=5.0, layers=2, layering=0.5)
    period = np.array([[5.0, 1.5, 1.5], [5.0, 5.0, 1.5]], dtype=np.float32)
    lines = EvenLines(np.zeros((2, 3), dtype=np.float32), period, None)
    tone = np.full((1, 3), 0.9, dtype=np.float32)
    first, second = line_shares(field, HatchedLines(pixel_look(look), even_lines=lines), tone)
    np.testing.assert_allclose(first + second, 1, atol=1e-6)
    assert first[0] > 0.95 and second[1] > 0.95 and abs(first[2] - first[0]) < 1e-6


def test_lines_run_along_the_field():
    """The mean orientation on a wall that faces the eye is that of the field within 2 degrees."""
    angle = np.radians(25)
    rgba = render(make_wall(angle), camera_before_wall(6), replace(INK, shading=0.8))
    up, right = (gaussian_filter(rgba[..., 1], 2.0, order=order) for order in ((1, 0), (0, 1)))
    across = np.angle(((right + 1j * up) ** 2).mean()) / 2
    along = (across + np.pi / 2 - angle + np.pi / 2) % np.pi - np.pi / 2
    assert abs(np.degrees(along)) < 2


def test_lone_pixels_of_undefined_faces_have_ink_or_not():
    """A face of one pixel has no neighbors to average, whatever its tone."""
    instance = MeshInstance(plane(1, 1, 1.0), np.eye(4), RosyField(4, np.zeros((1, 3))))
    gbuffer = project([instance], camera_above(41.0, 41))
    assert len(gbuffer.pixel) == 1
    with np.errstate(all="raise"):
        rgba = compose(gbuffer, Look(ink="hatch", line_width=10.0, length=4)).rgba
    assert np.isfinite(rgba).all()


def test_inks_of_tones_are_interpolated():
    look = Look(ink="hatch", hue="tone")
    dark, light = (to_linear(from_hex(code)) for code in (look.ink_color, look.ink_color_light))
    tones = np.array([0.0, 0.125, 0.25, 0.625, 1.0], dtype=np.float32)
    actual = inks_of(look).ink_at_tone(np.zeros(5), tones)
    np.testing.assert_allclose(actual, dark + tones[:, None] * (light - dark), atol=1e-6)


@pytest.mark.parametrize("kind", COLORED_INKS)
def test_required_coverage_has_the_target_luminance(kind):
    """Paper with the required coverage of ink has the target luminance."""
    look = replace(INK, **COLORED_INKS[kind])
    inks = inks_of(look, 4 if look.hue == "families" else 1)
    tone = np.linspace(0, 1, 101)
    expected = inks.target_transmittance(1 - tone if inks.is_light else tone)
    for index in range(len(inks.dark)):
        ink = inks.ink_at_tone(np.full(101, float(index)), tone)
        mixed = inks.paper + inks.required_coverage(expected, ink)[:, None] * (ink - inks.paper)
        np.testing.assert_allclose(inks.luminance_transmittance(mixed), expected, atol=2e-3)


def test_inks_of_families_differ_visibly():
    for code, paper in (("#101010", "#ffffff"), ("#8a2020", "#ffffff"), ("#f4f0e8", "#000000")):
        inks = inks_of(replace(INK, ink_color=code, paper_color=paper, hue="families"), 6)
        np.testing.assert_array_equal(inks.dark[0], to_linear(from_hex(code)))
        display = to_display(inks.dark)
        difference = np.linalg.norm(display[:, None] - display, axis=2)
        assert difference[np.triu_indices(6, 1)].min() > 0.15
        luminance = inks.dark[1:] @ LUMINANCE_WEIGHTS
        assert luminance.max() / luminance.min() < 2


@pytest.mark.parametrize("degree", [3, 4, 6, 7])
def test_inks_swap_ranks_without_a_seam(degree):
    """As the field rotates relative to the guiding angle, ink indices change without a jump."""
    field = planar_pixel_field(np.linspace(-1, 1, 40001)[None], degree)
    look = replace(INK, hue="families", guiding_angle=0.3)
    ink_indices = np.sort(np.array(line_ink_indices(field, pixel_look(look))), axis=0)
    assert np.abs(np.diff(ink_indices, axis=1)).max() < 0.03
    assert np.abs(ink_indices - np.arange(field.line_count)[:, None]).max() <= 0.5 + 1e-3
    for hue in ("one", "magnitude"):
        assert line_ink_indices(field, pixel_look(replace(look, hue=hue))) is None


def test_families_keep_their_inks_at_any_guiding_angle():
    """The guiding angle determines the order of the lines, not their inks."""
    field = planar_pixel_field(np.linspace(-1, 1, 101)[None], 4)
    field = replace(field, channels={("family", 2): np.exp(2j * np.linspace(-1, 1, 101))})
    for guide in (0.0, 0.6, -1.2):
        look = replace(INK, hue="families", guiding_angle=guide)
        actual = line_ink_indices(field, pixel_look(look))
        np.testing.assert_array_equal(actual, line_families(field, pixel_look(look)))
        assert {0, 1} == set(np.unique(actual))


def test_clear_paper_shows_only_ink():
    instance, camera = make_instance(BALL), make_camera().resized(160, 160)

    def on_paper(alpha):
        look = replace(INK, paper_color="#ffffff" + alpha, ink_color="#204060")
        return render(instance, camera, look)

    clear, full = on_paper("00"), on_paper("")
    inked = clear[clear[..., 3] > 0][:, :3]
    np.testing.assert_allclose(inked, to_linear(from_hex("#204060")) + 0 * inked, rtol=1e-3)
    whole = full[..., 3] == 1
    for alpha in ("40", "c0"):
        part = on_paper(alpha)
        opacity = int(alpha, 16) / 255
        alpha_of_all = 1 - (1 - clear[..., 3]) * (1 - opacity)
        np.testing.assert_allclose(part[whole][:, 3], alpha_of_all[whole], atol=1e-5)
        ink = clear[..., :3] * clear[..., 3:]
        mixed = ink + opacity * (full[..., :3] - ink)
        np.testing.assert_allclose((part[..., :3] * part[..., 3:])[whole], mixed[whole], atol=1e-5)
    on_white = clear[..., :3] * clear[..., 3:] + 1 - clear[..., 3:]
    np.testing.assert_allclose(on_white[whole], full[whole][:, :3], atol=2e-3)


# --- overshoot -----------------------------------------------------------------------------------

#: Half the side of the wall of `render_half_dark_wall`, Blender units.
HALF = 4.0


def render_half_dark_wall(overshoot):
    """(H, W - 1) lightness of a wall of horizontal lines, the left half dark, the right white."""
    wall = make_wall(half=HALF)
    points = wall.surface.vertices[wall.surface.corner_vertex]
    image = np.repeat([[0.3, 1.0]], 2, axis=0).repeat(256, axis=1).astype(np.float32)
    uv = (points[:, [0, 2]] / (2 * HALF) + 0.5).astype(np.float32)
    instance = replace(wall, tone=SurfaceTone(uv, image))
    look = replace(INK, tone="image", overshoot=overshoot, seed=5, ink_color="#000000")
    # The image of tones repeats, so the last column is dark and is left out.
    return render(instance, camera_before_wall(2 * HALF), look)[..., :-1, 0]


def test_lines_overshoot_the_border_of_a_tone():
    """The mean of a column is a ramp across the border, twice as wide as the overshoot."""
    overshoot = 24.0
    light = render_half_dark_wall(overshoot)
    from_border = np.arange(SIZE - 1) + 0.5 - SIZE / 2
    expected = 0.3 + 0.7 * np.clip(0.5 + from_border / (2 * overshoot), 0, 1)
    error = np.abs(gaussian_filter(light.mean(axis=0), 3) - expected)
    inner = np.abs(from_border) < SIZE / 2 - 20
    assert error[inner].mean() < 0.03 and error[inner].max() < 0.12
    beyond = (from_border > overshoot + 2) & (from_border < SIZE / 2 - overshoot - 4)
    assert (light[:, beyond] > 0.999).all()
    # Lines end at different distances from the border.
    is_dark = (light[:, SIZE // 2 - 4 : SIZE // 2] < 0.5).all(axis=1)
    dark_beyond_border = light[is_dark, SIZE // 2 :] < 0.5
    ends = np.argmin(dark_beyond_border, axis=1)
    assert ends.max() > 0.5 * overshoot and np.std(ends) > 0.1 * overshoot


def test_without_overshoot_lines_end_with_the_tone():
    light = render_half_dark_wall(0.0)
    assert (light[:, SIZE // 2 + 2 :] > 0.999).all()
    assert abs(light[:, 20 : SIZE // 2 - 2].mean() - 0.3) < 0.04
