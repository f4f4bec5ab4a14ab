"""Hatching: target tones, lines along the field, inks, outlines, and stability under motion."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache
from itertools import product

import numpy as np
import pytest
from conftest import long, mainly
from harness.planar import planar_pixel_field
from scipy.ndimage import gaussian_filter, map_coordinates
from shapes import cube

from rosy_addon.compositor.compose import compose
from rosy_addon.compositor.even_lines import EvenLines
from rosy_addon.compositor.family_hues import line_families
from rosy_addon.compositor.fast_lic import fast_lic
from rosy_addon.compositor.hatching import (
    HatchedLines,
    line_ink_indices,
    line_shares,
    render_hatching,
)
from rosy_addon.compositor.image_noise import image_noise
from rosy_addon.compositor.inks import LUMINANCE_WEIGHTS, inks_of
from rosy_addon.compositor.lic import look_noise
from rosy_addon.compositor.look import Look
from rosy_addon.compositor.look_units import pixel_look
from rosy_addon.compositor.outline import outline_coverage
from rosy_addon.compositor.paper_grain import picture_paper_grain
from rosy_addon.compositor.shading import diffuse
from rosy_addon.compositor.streak_statistics import (
    break_steps,
    look_streak_statistics,
)
from rosy_addon.compositor.surface_noise import instance_hashes, surface_noise
from rosy_addon.compositor.wobble import WOBBLE_STD, rotate_pixel_field, wobble_angle
from rosy_addon.core.color import from_hex, to_display, to_linear
from rosy_addon.field.generate import axis_field
from rosy_addon.field.rosy_field import RosyField
from rosy_addon.field.surface import Surface, build_surface
from rosy_addon.preset_files.store import load_preset, preset_keys
from rosy_addon.projection.camera import Camera, look_at, orthographic_camera, perspective_camera
from rosy_addon.projection.gbuffer import MeshInstance
from rosy_addon.projection.project import project
from rosy_addon.projection.rest_coordinates import rest_coordinates
from rosy_addon.projection.surface_tone import SurfaceTone

#: These tests draw many pictures and measure them.
pytestmark = pytest.mark.slow

SIZE = 384
PRESETS = {name: load_preset(name).look for name in preset_keys()}
HATCHED = [name for name, look in PRESETS.items() if look.ink != "soft"]

INK = Look(
    fade="ends",
    ink="hatch",
    anchor="surface",
    light="lamp",
    shading=1.0,
    line_width=2.5,
    supersampling=2,
)


@lru_cache(maxsize=4)
def tube(around=160, along=120, bend=0.0):
    """A tube along z with radius 0.5; its rest shape is straight if it is bent."""
    angle = np.arange(around) * 2 * np.pi / around
    height = np.linspace(-1.5, 1.5, along + 1)
    rest = np.stack(
        [
            np.tile(0.5 * np.cos(angle), along + 1),
            np.tile(0.5 * np.sin(angle), along + 1),
            np.repeat(height, around),
        ],
        axis=1,
    )
    left = np.arange(along)[:, None] * around + np.arange(around)
    right = np.roll(left, -1, axis=1)
    faces = np.stack([left, right, right + around, left + around], axis=-1).reshape(-1, 4)
    points = rest if not bend else bent(rest, bend)
    return build_surface(
        points,
        faces.ravel(),
        np.arange(0, 4 * len(faces) + 1, 4),
        name="tube",
        rest_vertices=rest,
    )


def bent(points, angle):
    """Rotate points about the x axis by angles that grow with z, like an armature."""
    local_angle = angle * np.clip(0.5 + points[:, 2], 0, 1)
    cos, sin = np.cos(local_angle), np.sin(local_angle)
    y, z = points[:, 1], points[:, 2]
    return np.stack([points[:, 0], cos * y - sin * z, sin * y + cos * z], axis=1)


@lru_cache(maxsize=4)
def ball(rows=70):
    polar = np.linspace(0, np.pi, rows + 1)[:, None]
    azimuth = np.arange(2 * rows) * np.pi / rows
    points = np.stack(
        [
            np.sin(polar) * np.cos(azimuth),
            np.sin(polar) * np.sin(azimuth),
            np.cos(polar) + 0 * azimuth,
        ],
        axis=-1,
    ).reshape(-1, 3)
    left = np.arange(rows)[:, None] * 2 * rows + np.arange(2 * rows)
    right = np.roll(left, -1, axis=1)
    corners = np.concatenate(
        [
            np.stack([left, left + 2 * rows, right + 2 * rows], axis=-1).reshape(-1, 3),
            np.stack([left, right + 2 * rows, right], axis=-1).reshape(-1, 3),
        ]
    )
    return build_surface(points, corners.ravel(), np.arange(0, corners.size + 1, 3), name="ball")


def make_instance(surface: Surface, degree=4, matrix=None):
    field = axis_field(surface.in_rest_shape(), degree, (0.3, 0.2, 1.0))
    return MeshInstance(surface, np.eye(4) if matrix is None else matrix, field)


def make_camera(azimuth=0.0, zoom=1.0, distance=4.0):
    position = distance * np.array([np.sin(azimuth), -np.cos(azimuth), 0.3])
    return perspective_camera(
        look_at(position, (0, 0, 0)), SIZE, SIZE, fov=2 * np.arctan(np.tan(0.28) / zoom)
    )


def supersampled(camera, factor):
    return Camera(
        camera.view,
        np.array(camera.projection),
        camera.width * factor,
        camera.height * factor,
        "fine",
    )


def render(instance, camera, look, lights=()):
    return compose(project([instance], supersampled(camera, look.supersampling)), look, lights).rgba


# --- tone ------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", mainly(["cross-hatch"], HATCHED))
def test_presets_reproduce_a_ramp(name):
    """A ball under one light, with tones from 0 to 1: the blurred picture has the target tone."""
    look = PRESETS[name]
    instance, camera = make_instance(ball()), make_camera()
    rgba = render(instance, camera, look)
    gbuffer = project([instance], camera)
    target_tone = np.clip(diffuse(gbuffer, look).mean(axis=1), 0, 1)
    assert target_tone.min() < 1 - look.shading + 0.05 and target_tone.max() > 0.97
    paper, ink = (to_linear(from_hex(code)) for code in (look.paper_color, look.ink_color))
    # Lightness from the darker of ink and paper to the lighter, in the channel of largest contrast.
    channel = int(np.argmax(np.abs(paper - ink)))
    darker, lighter = sorted((paper[channel], ink[channel]))
    lightness = (rgba[..., channel] - darker) / (lighter - darker)
    visible = np.zeros(SIZE * SIZE)
    visible[gbuffer.pixel] = 1
    expected = np.zeros(SIZE * SIZE)
    expected[gbuffer.pixel] = target_tone
    visible, expected = visible.reshape(SIZE, SIZE), expected.reshape(SIZE, SIZE)
    fraction = gaussian_filter(visible, 16)
    inner = fraction > 0.98
    rendered = gaussian_filter(np.where(visible > 0, lightness, 0), 16)[inner] / fraction[inner]
    error = np.abs(rendered - gaussian_filter(expected, 16)[inner] / fraction[inner])
    assert error.mean() <= 0.04


@pytest.mark.parametrize("crispness", [0.0, 0.5, 1.0])
def test_thresholds_decrease_and_half_coverage_is_near_the_mean(crispness):
    """Higher coverages have lower thresholds, and half coverage is near the mean."""
    look = Look(length=40, line_width=2.0, density=0.5, high_pass=16.0, crispness=crispness)
    threshold, deviation, *_ = look_streak_statistics(pixel_look(look))
    assert (np.diff(threshold) < 0).all() and deviation > 0
    middle = threshold[len(threshold) // 2]
    assert abs(middle) < 0.1  # the distribution of streaks of dense noise is nearly symmetric


@pytest.mark.parametrize("degree", [1, 2, 3, 4, 6, 7])
@pytest.mark.parametrize("layers", [1, 2, 3])
def test_shares_of_families_sum_to_one_and_are_continuous(degree, layers):
    """Shares sum to 1, and have no jumps as the field rotates relative to the guiding angle."""
    angles = np.linspace(-1, 1, 40001)[None]
    field = planar_pixel_field(angles, degree)
    look = Look(ink="hatch", layers=layers, guiding_angle=0.3)
    for tone in (0.02, 0.3, 0.7, 0.98):
        transmittance = np.full((1, angles.size), tone, dtype=np.float32)
        shares = np.array(line_shares(field, pixel_look(look), transmittance))
        np.testing.assert_allclose(shares.sum(axis=0), 1, atol=1e-5)
        # Members jump where two are equally near the guiding angle, but the sorted shares do not.
        ordered = np.sort(shares, axis=0)
        assert np.abs(np.diff(ordered, axis=1)).max() < 0.03
        # Where two families swap ranks, both are drawn, and possibly a third one.
        typical_count = np.median((shares > 0.02).sum(axis=0))
        assert typical_count <= min(layers, field.line_count)
        if layers >= field.line_count and tone < 0.1:
            # All lines are drawn, whatever their angle to the guiding angle.
            np.testing.assert_allclose(shares, 1 / field.line_count, atol=0.02)


def test_crowded_even_lines_are_drawn_last():
    """Where a surface turns away across the first lines, the ink of light tones is in the others."""
    field = planar_pixel_field(np.zeros((1, 3)), 4)
    look = Look(ink="even", line_distance=5.0, layers=2, layering=0.5)
    period = np.array([[5.0, 1.5, 1.5], [5.0, 5.0, 1.5]], dtype=np.float32)
    lines = EvenLines(np.zeros((2, 3), dtype=np.float32), period, None)
    first, second = line_shares(
        field, pixel_look(look), np.full((1, 3), 0.9, dtype=np.float32), lines
    )
    np.testing.assert_allclose(first + second, 1, atol=1e-6)
    assert first[0] > 0.95 and second[1] > 0.95
    assert abs(first[2] - first[0]) < 1e-6


@pytest.mark.parametrize("name", mainly(["pen-and-ink"], HATCHED))
def test_lines_run_along_the_field(name):
    """The mean orientation on a wall that faces the eye is that of the field within 2 degrees."""
    points = np.array([[-9, 0, -9], [9, 0, -9], [9, 0, 9], [-9, 0, 9]], dtype=float)
    wall = build_surface(points, [0, 1, 2, 3], [0, 4], name="wall")
    angle = np.radians(25)
    field = axis_field(wall, 2, (np.cos(angle), 0, np.sin(angle)))
    camera = orthographic_camera(look_at((0, -5, 0), (0, 0, 0)), SIZE, SIZE, scale=6)
    look = replace(PRESETS[name], shading=0.8)
    rgba = render(MeshInstance(wall, np.eye(4), field), camera, look)
    picture = rgba[..., 1] * rgba[..., 3]
    up, right = (gaussian_filter(picture, 2.0, order=order) for order in ((1, 0), (0, 1)))
    across = np.angle(((right + 1j * up) ** 2).mean()) / 2
    along = (across + np.pi / 2 - angle + np.pi / 2) % np.pi - np.pi / 2
    assert abs(np.degrees(along)) < 2


# --- small features -----------------------------------------------------------------------------------


def tone_detail_error(look, radius_pixels):
    """Mean error of the tone of a ball, blurred by a tenth of its radius."""
    zoom = radius_pixels / (SIZE / 2) / 0.86
    instance, camera = make_instance(ball()), make_camera(zoom=zoom)
    gbuffer = project([instance], camera)
    assert np.ptp(gbuffer.pixel % SIZE) == pytest.approx(2 * radius_pixels, rel=0.15)
    visible, expected = np.zeros((2, SIZE * SIZE))
    visible[gbuffer.pixel] = 1
    expected[gbuffer.pixel] = np.clip(diffuse(gbuffer, look).mean(axis=1), 0, 1)
    visible, expected = visible.reshape(SIZE, SIZE), expected.reshape(SIZE, SIZE)
    rgba = render(instance, camera, look)
    rendered = np.where(visible > 0, inks_of(look).luminance_transmittance(rgba[..., :3]), 0)
    sigma = 0.1 * radius_pixels
    inner = gaussian_filter(visible, sigma) > 0.98
    return np.abs(gaussian_filter(rendered, sigma) - gaussian_filter(expected, sigma))[inner].mean()


def test_detail_shows_the_tone_of_small_features():
    """A ball of 20 pixels is drawn better by a third, and a large one stays the same."""
    fine = replace(INK, detail=0.6)
    assert tone_detail_error(fine, 20) <= 0.67 * tone_detail_error(INK, 20)
    instance, camera = make_instance(ball()), make_camera(zoom=12)
    np.testing.assert_array_equal(render(instance, camera, fine), render(instance, camera, INK))


# --- uneven lines ------------------------------------------------------------------------------------

UNEVEN_LINES = {
    "broken": {"breaks": 1.0},
    "wobble": {"wobble": 1.0},
    "paper grain": {"paper_grain": 1.0},
    "all three": {"breaks": 0.6, "wobble": 0.6, "paper_grain": 0.6},
}


def plane_coverage(look, tone, degree=2, angle=0.3, side=320):
    """(H, W) coverage by lines of a constant field in the plane, for a constant tone."""
    look = pixel_look(replace(look, anchor="picture", paper_color="#ffffff00"))
    field = planar_pixel_field(np.full((side, side), angle), degree)
    noise = look_noise(field, look)
    break_images = paper_grain = None
    if look.breaks or look.wobble:
        break_look = look.with_length(break_steps(look))
        (break_images,) = fast_lic(field, [break_look], noise)
    if look.paper_grain:
        paper_grain = picture_paper_grain(
            field.pixel, field.width, look.line_width, look.seed, 1, field.line_count
        )
    (images,) = fast_lic(field, [look], noise)
    tones = np.full(len(field.pixel), tone, dtype=np.float32)
    _, alpha = render_hatching(field, HatchedLines(look, images, break_images, paper_grain), tones)
    # Streamlines end at the frame.
    return alpha.reshape(side, side)[40:-40, 40:-40]


@pytest.mark.parametrize(
    ("crispness", "kind"),
    mainly(
        [(0.1, "broken"), (0.9, "wobble"), (0.1, "paper grain"), (0.9, "all three")],
        product([0.1, 0.9], UNEVEN_LINES),
    ),
)
def test_uneven_lines_have_the_same_coverage(kind, crispness):
    """The mean coverage is that of even lines, from dark to light tones."""
    look = Look(ink="hatch", line_width=2.0, length=30, crispness=crispness, **UNEVEN_LINES[kind])
    for tone in (0.1, 0.3, 0.5, 0.7, 0.9):
        assert plane_coverage(look, tone).mean() == pytest.approx(1 - tone, abs=0.03)


@pytest.mark.parametrize("kind", mainly(["all three"], UNEVEN_LINES))
def test_uneven_lines_reproduce_a_ramp(kind):
    assert ramp_error(replace(INK, **UNEVEN_LINES[kind])) <= 0.04


def mean_run_length(ink):
    """Mean length of the runs of ink along the rows."""
    ink = ink > 0.5
    begins = ink[:, 1:] & ~ink[:, :-1]
    return ink.sum() / begins.sum()


def test_lines_break_in_light_tones_first():
    look = Look(ink="hatch", line_width=2.0, length=60, crispness=1.0)
    broken = replace(look, breaks=1.0)
    shorter = [
        mean_run_length(plane_coverage(broken, tone, angle=0.0))
        / mean_run_length(plane_coverage(look, tone, angle=0.0))
        for tone in (0.9, 0.5, 0.2)
    ]
    assert shorter[0] < 0.5
    assert shorter[0] < shorter[1] < shorter[2]


def test_paper_grain_breaks_lines():
    look = Look(ink="hatch", line_width=2.0, length=60, crispness=0.8)
    plain, rough = (plane_coverage(replace(look, paper_grain=fraction), 0.6) for fraction in (0, 1))
    assert mean_run_length(rough) < 0.6 * mean_run_length(plain)


@pytest.mark.parametrize("line_width", [1.5, 3.0, 8.0])
def test_statistics_of_paper_grain(line_width):
    """Mean 0, standard deviation 1, no low frequencies, independent of other lines and streaks."""
    side = 512
    pixel = np.arange(side * side, dtype=np.int32)
    first_grain, second_grain = picture_paper_grain(
        pixel, side, line_width, 0, line_count=2
    ).reshape(2, side, side)
    assert abs(np.corrcoef(first_grain.ravel(), second_grain.ravel())[0, 1]) < 0.03
    assert abs(first_grain.mean()) < 0.02 and first_grain.std() == pytest.approx(1, abs=0.03)
    assert gaussian_filter(first_grain, 16).std() < 0.12
    streaks = image_noise(pixel, side, line_width, 0, 1)
    assert abs(np.corrcoef(first_grain.ravel(), streaks[:, 0])[0, 1]) < 0.02


def test_paper_grain_depends_only_on_the_pixel():
    """A height does not depend on the other visible pixels, and is equal at all subpixels."""
    full_frame = picture_paper_grain(np.arange(700 * 300, dtype=np.int32), 700, 2.0, 3).reshape(
        300, 700
    )
    column, row = np.meshgrid(np.arange(310, 330), np.arange(250, 280))
    part = picture_paper_grain((row * 700 + column).ravel().astype(np.int32), 700, 2.0, 3)
    np.testing.assert_allclose(part.reshape(30, 20), full_frame[250:280, 310:330], atol=1e-5)
    fine = picture_paper_grain(np.arange(1400 * 600, dtype=np.int32), 1400, 2.0, 3, 2)
    np.testing.assert_allclose(
        fine.reshape(300, 2, 700, 2),
        np.broadcast_to(full_frame[:, None, :, None], (300, 2, 700, 2)),
    )
    other = picture_paper_grain(np.arange(700 * 300, dtype=np.int32), 700, 2.0, 4)
    assert abs(np.corrcoef(other[0], full_frame.ravel())[0, 1]) < 0.02


@pytest.mark.parametrize("anchor", ["surface", "picture"])
@pytest.mark.parametrize("distance", [4.0, 30.0])
def test_statistics_of_the_wobble(anchor, distance):
    """Mean 0, standard deviation `WOBBLE_STD`, small differences of neighbors, at any distance."""
    gbuffer = project([make_instance(tube())], make_camera(distance=distance, zoom=distance / 4))
    actual = wobble_angle(gbuffer, pixel_look(replace(INK, anchor=anchor, line_width=1.5)))
    assert abs(actual.mean()) < 0.25 * WOBBLE_STD
    assert 0.75 < actual.std() / WOBBLE_STD < 1.25
    right = np.flatnonzero((np.diff(gbuffer.pixel) == 1) & (np.diff(gbuffer.triangle) == 0))
    assert np.abs(np.diff(actual)[right]).mean() < 0.15 * WOBBLE_STD


@pytest.mark.parametrize("degree", [2, 3, 4])
def test_wobble_rotates_all_directions(degree):
    field = planar_pixel_field(np.linspace(-2, 2, 90).reshape(9, 10), degree)
    angle = np.linspace(-0.3, 0.3, 90).astype(np.float32)
    harmonics = {("deviation", j): np.full(90, c) for j, c in ((-1, 0.1j), (0, 1), (1, 0.2 + 0j))}
    field = replace(field, channels=harmonics)
    turned = rotate_pixel_field(field, angle)
    member = np.exp(1j * np.angle(field.representation) / degree)
    before = field.member_direction(member)
    after = turned.member_direction(member * np.exp(1j * angle))
    np.testing.assert_allclose(after, before * np.exp(1j * angle), atol=1e-5)
    np.testing.assert_allclose(
        turned.representation, field.representation * np.exp(1j * degree * angle), atol=1e-5
    )


# --- inks --------------------------------------------------------------------------------------------


def ramp_error(look, field=None):
    """Mean error of the blurred luminance transmittance of a ball, relative to the target."""
    instance, camera = make_instance(ball(), degree=6), make_camera()
    if field is not None:
        instance = replace(instance, field=field)
    rgba = render(instance, camera, look)
    gbuffer = project([instance], camera)
    target_tone = np.clip(diffuse(gbuffer, look).mean(axis=1), 0, 1)
    inks = inks_of(look, 3 if look.hue == "families" else 1)
    target_light = target_tone if not inks.is_light else 1 - target_tone
    visible, expected = np.zeros(SIZE * SIZE), np.zeros(SIZE * SIZE)
    visible[gbuffer.pixel], expected[gbuffer.pixel] = 1, inks.target_transmittance(target_light)
    visible, expected = visible.reshape(SIZE, SIZE), expected.reshape(SIZE, SIZE)
    fraction = gaussian_filter(visible, 16)
    inner = fraction > 0.98
    rendered = np.where(visible > 0, inks.luminance_transmittance(rgba[..., :3]), 0)
    error = gaussian_filter(rendered, 16)[inner] - gaussian_filter(expected, 16)[inner]
    return np.abs(error / fraction[inner]).mean()


@pytest.mark.parametrize("name", mainly(["cross-hatch", "pencil"], HATCHED))
def test_undefined_faces_keep_the_tone(name):
    """Without a direction, hatching draws an undirected texture of the tone of the light."""
    undefined = RosyField(4, np.zeros((ball().face_count, 3)))
    assert ramp_error(PRESETS[name], undefined) <= 0.03


def test_lone_pixels_of_undefined_faces_have_ink_or_not():
    """A face of one pixel has no neighbors to average, whatever its tone."""
    camera = orthographic_camera(look_at((0, 0, 5), (0, 0, 0), (0, 1, 0)), 40, 40, scale=40.0)
    square = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], dtype=float)
    speck = build_surface(square, np.arange(4), np.array([0, 4]))
    instance = MeshInstance(speck, np.eye(4), RosyField(4, np.zeros((1, 3))))
    gbuffer = project([instance], camera)
    assert len(gbuffer.pixel) == 1
    with np.errstate(all="raise"):
        rgba = compose(gbuffer, Look(ink="hatch", line_width=10.0, length=4)).rgba
    assert np.isfinite(rgba).all()


@pytest.mark.parametrize("kind", ["families", "ramp"])
def test_undefined_faces_keep_the_tone_in_color(kind):
    undefined = RosyField(4, np.zeros((ball().face_count, 3)))
    look = replace(INK, shading=0.9, **COLORED_INKS[kind])
    assert ramp_error(look, undefined) <= 0.03


COLORED_INKS = {
    "ramp": {"hue": "tone", "ink_color": "#201848"},
    "ramp, light": {
        "hue": "tone",
        "ink_color": "#c08050",
        "ink_color_light": "#fff0c0",
        "paper_color": "#182028",
    },
    "families": {"hue": "families"},
    "families, colored": {"hue": "families", "ink_color": "#204890", "paper_color": "#f4ecd8"},
    "families, light": {"hue": "families", "ink_color": "#f0e8d0", "paper_color": "#101418"},
}


def test_inks_of_tones_are_interpolated():
    look = Look(ink="hatch", hue="tone")
    dark, light = (to_linear(from_hex(code)) for code in (look.ink_color, look.ink_color_light))
    tones = np.array([0.0, 0.125, 0.25, 0.625, 1.0], dtype=np.float32)
    actual = inks_of(look).ink_at_tone(np.zeros(5), tones)
    np.testing.assert_allclose(actual, dark + tones[:, None] * (light - dark), atol=1e-6)


@pytest.mark.parametrize(
    "kind",
    mainly(["families, light", "ramp, light"], COLORED_INKS),
)
def test_colored_inks_reproduce_a_ramp(kind):
    assert ramp_error(replace(INK, layers=3, **COLORED_INKS[kind])) <= 0.04


@pytest.mark.parametrize("kind", COLORED_INKS)
def test_required_coverage_has_the_target_luminance(kind):
    """Paper with the required coverage of ink has the target luminance."""
    look = replace(INK, **COLORED_INKS[kind])
    inks = inks_of(look, 4 if look.hue == "families" else 1)
    tone = np.linspace(0, 1, 101)
    expected = inks.target_transmittance(1 - tone if inks.is_light else tone)
    for index in range(len(inks.dark)):
        ink = inks.ink_at_tone(np.full(101, float(index)), tone)
        covered = inks.required_coverage(expected, ink)[:, None]
        mixed = inks.paper + covered * (ink - inks.paper)
        np.testing.assert_allclose(inks.luminance_transmittance(mixed), expected, atol=2e-3)


def test_inks_of_families_differ_visibly():
    for code in ("#101010", "#8a2020", "#f4f0e8"):
        paper = "#000000" if code == "#f4f0e8" else "#ffffff"
        look = replace(INK, ink_color=code, paper_color=paper, hue="families")
        inks = inks_of(look, 6)
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
    assert (
        np.abs(ink_indices - np.arange(field.line_count)[:, None]).max(axis=1) <= 0.5 + 1e-3
    ).all()
    assert line_ink_indices(field, pixel_look(replace(look, hue="one"))) is None
    assert line_ink_indices(field, pixel_look(replace(look, hue="magnitude"))) is None


def test_families_keep_their_inks_at_any_guiding_angle():
    """The guiding angle determines the order of the lines, not their inks."""
    field = planar_pixel_field(np.linspace(-1, 1, 101)[None], 4)
    field = replace(field, channels={("family", 2): np.exp(2j * np.linspace(-1, 1, 101))})
    for guide in (0.0, 0.6, -1.2):
        look = replace(INK, hue="families", guiding_angle=guide)
        actual, families = (
            line_ink_indices(field, pixel_look(look)),
            line_families(field, pixel_look(look)),
        )
        np.testing.assert_array_equal(actual, families)
        assert {0, 1} == set(np.unique(actual))


def test_ink_is_colored_by_magnitude():
    """Pixels covered by ink have the colors of the color map."""
    look = replace(INK, hue="magnitude", color_map="gray", paper_color="#ffffff00", shading=0.5)
    surface = ball()
    field = axis_field(surface, 4, (0.3, 0.2, 1.0))
    height = surface.vertices[surface.corner_vertex[surface.face_start[:-1]], 2]
    vectors = field.vectors / np.maximum(np.linalg.norm(field.vectors, axis=1), 1e-9)[:, None]
    field = replace(field, vectors=vectors * (1.5 + height)[:, None])
    rgba = render(MeshInstance(surface, np.eye(4), field), make_camera(), look)
    row = np.nonzero(rgba[..., 3] > 0.5)[0]
    gray = rgba[..., 0][rgba[..., 3] > 0.5]
    assert np.corrcoef(row, to_display(gray))[0, 1] > 0.95


# --- overshoot ---------------------------------------------------------------------------------------

#: Half the side of the wall of `render_half_dark_wall`, Blender units.
HALF = 4.0


def render_half_dark_wall(method, overshoot):
    """(H, W - 1) lightness of a wall of horizontal lines, the left half dark, the right white."""
    points = HALF * np.array([[-1, 0, -1], [1, 0, -1], [1, 0, 1], [-1, 0, 1]])
    wall = build_surface(points, [0, 1, 2, 3], [0, 4], name="wall")
    image = np.repeat([[0.3, 1.0]], 2, axis=0).repeat(256, axis=1).astype(np.float32)
    uv = (wall.vertices[wall.corner_vertex][:, [0, 2]] / (2 * HALF) + 0.5).astype(np.float32)
    field = axis_field(wall, 2, (1.0, 0, 0))
    instance = MeshInstance(wall, np.eye(4), field, SurfaceTone(uv, image))
    camera = orthographic_camera(look_at((0, -5, 0), (0, 0, 0)), SIZE, SIZE, scale=2 * HALF)
    look = replace(
        INK, tone="image", overshoot=overshoot, method=method, seed=5, ink_color="#000000"
    )
    # The image of tones repeats, so the last column is dark and is left out.
    return render(instance, camera, look)[..., :-1, 0]


@pytest.mark.parametrize("method", ["sheets", *long("members", "brute")])
def test_lines_overshoot_the_border_of_a_tone(method):
    """The mean of a column is a ramp across the border, twice as wide as the overshoot."""
    overshoot = 24.0
    light = render_half_dark_wall(method, overshoot)
    from_border = np.arange(SIZE - 1) + 0.5 - SIZE / 2
    expected = 0.3 + 0.7 * np.clip(0.5 + from_border / (2 * overshoot), 0, 1)
    error = np.abs(gaussian_filter(light.mean(axis=0), 3) - expected)
    inner = np.abs(from_border) < SIZE / 2 - 20
    assert error[inner].mean() < 0.03 and error[inner].max() < 0.12
    beyond = (from_border > overshoot + 2) & (from_border < SIZE / 2 - overshoot - 4)
    assert (light[:, beyond] > 0.999).all()
    # Lines end at different distances from the border.
    dark_beyond_border = [
        row[SIZE // 2 :] < 0.5 for row in light if (row[SIZE // 2 - 4 : SIZE // 2] < 0.5).all()
    ]
    ends = np.argmin(dark_beyond_border, axis=1)
    assert ends.max() > 0.5 * overshoot and np.std(ends) > 0.1 * overshoot


def test_without_overshoot_lines_end_with_the_tone():
    light = render_half_dark_wall("sheets", 0.0)
    assert (light[:, SIZE // 2 + 2 :] > 0.999).all()
    assert abs(light[:, 20 : SIZE // 2 - 2].mean() - 0.3) < 0.04


def test_overshooting_lines_reproduce_a_ramp():
    assert ramp_error(replace(INK, overshoot=12.0)) <= 0.04


# --- stability ---------------------------------------------------------------------------------------


def warped_correlation(instance, camera, other_instance, other_camera, look):
    """Correlation of two pictures, after the second one is warped by the true motion."""
    first, second = render(instance, camera, look), render(other_instance, other_camera, look)
    gbuffer, other_gbuffer = project([instance], camera), project([other_instance], other_camera)
    corners = instance.surface.triangle_vertex[gbuffer.triangle]
    moved = np.einsum("pi,pij->pj", gbuffer.barycentric, other_instance.surface.vertices[corners])
    matrix = other_camera.projection @ other_camera.view @ other_instance.matrix
    clip = np.concatenate([moved, np.ones((len(moved), 1))], axis=1) @ matrix.T
    position = (clip[:, :2] / clip[:, 3:] * 0.5 + 0.5) * SIZE - 0.5
    depth = np.full((SIZE, SIZE), np.inf)
    depth.reshape(-1)[other_gbuffer.pixel] = -other_gbuffer.position[:, 2]
    nearest_pixel = np.rint(position).astype(int)
    visible = ((nearest_pixel >= 2) & (nearest_pixel < SIZE - 2)).all(axis=1)
    visible[visible] = (
        np.abs(depth[nearest_pixel[visible, 1], nearest_pixel[visible, 0]] - clip[visible, 3])
        < 0.01
    )
    assert visible.mean() > 0.5
    tone, other_tone = (to_display(picture[..., 0]) for picture in (first, second))
    warped = map_coordinates(other_tone, position[visible, ::-1].T, order=3, mode="nearest")
    return np.corrcoef(tone.reshape(-1)[gbuffer.pixel[visible]], warped)[0, 1]


def shift_by_pixels(pixels):
    matrix = np.eye(4)
    matrix[0, 3] = pixels * 4.0 / make_camera().pixels_per_unit
    return matrix


MOTIONS = {
    "camera turned": lambda: (
        make_instance(tube()),
        make_camera(),
        make_instance(tube()),
        make_camera(np.radians(1)),
    ),
    "object moved": lambda: (
        make_instance(tube()),
        make_camera(),
        make_instance(tube(), matrix=shift_by_pixels(2)),
        make_camera(),
    ),
    "zoomed": lambda: (
        make_instance(tube()),
        make_camera(),
        make_instance(tube()),
        make_camera(zoom=1.1),
    ),
    "bent": lambda: (
        make_instance(tube()),
        make_camera(),
        make_instance(tube(bend=0.05)),
        make_camera(),
    ),
    "bent far": lambda: (
        make_instance(tube(bend=0.8)),
        make_camera(),
        make_instance(tube(bend=0.81)),
        make_camera(),
    ),
}


@pytest.mark.parametrize("motion", mainly(["bent", "zoomed"], MOTIONS))
@pytest.mark.parametrize("ink", ["hatch", *long("soft", "uneven")])
def test_streaks_stay_on_the_surface(motion, ink):
    # The light is even, because shading does not move with the surface.
    look = replace(INK, light="scene", shading=0.35, gain=1.2, crispness=0.5)
    if ink == "soft":
        look = replace(look, ink="soft", shading=0.0)
    if ink == "uneven":
        look = replace(look, wobble=1.0, breaks=0.3)
    first, camera, second, other_camera = MOTIONS[motion]()
    assert warped_correlation(first, camera, second, other_camera, look) >= 0.9
    if motion == "zoomed":
        picture_anchored = replace(look, anchor="picture")
        assert warped_correlation(first, camera, second, other_camera, picture_anchored) < 0.5


@pytest.mark.parametrize(
    "motion", ["zoomed", *long(*(name for name in MOTIONS if name != "zoomed"))]
)
@pytest.mark.parametrize("name", mainly(HATCHED[:1], HATCHED))
def test_presets_stay_on_the_surface(name, motion):
    look = replace(PRESETS[name], light="scene", shading=0.35)
    if look.ink == "even" and motion == "zoomed":
        # At distances in pixels, a zoom needs other lines.
        look = replace(look, unit_size=0.006)
    assert warped_correlation(*MOTIONS[motion](), look) >= 0.9


@pytest.mark.parametrize("width", [2.5, *long(4.0)])
def test_lines_keep_their_width_through_a_zoom(width):
    """Lines on a wall, at zooms from 1 to 16."""
    points = np.array([[-9, 0, -9], [9, 0, -9], [9, 0, 9], [-9, 0, 9]], dtype=float)
    wall = build_surface(points, [0, 1, 2, 3], [0, 4], name="wall")
    instance = MeshInstance(wall, np.eye(4), axis_field(wall, 2, (1.0, 0, 0)))
    widths = []
    for zoom in 2.0 ** np.array([0, 0.3, 0.7, 1.5, 2.75, 4]):
        camera = orthographic_camera(
            look_at((0.3, -5, 0.2), (0.3, 0, 0.2)), SIZE, SIZE, scale=8 / zoom
        )
        rgba = render(instance, camera, replace(INK, light="scene", shading=0.4, line_width=width))
        widths.append(line_width(rgba[..., 0]))
    assert max(widths) / min(widths) < 1.15


def test_lines_in_blender_units_scale_with_the_zoom():
    """The width is proportional to the zoom, and equals that in pixels at the scale of the unit."""
    points = np.array([[-9, 0, -9], [9, 0, -9], [9, 0, 9], [-9, 0, 9]], dtype=float)
    wall = build_surface(points, [0, 1, 2, 3], [0, 4], name="wall")
    instance = MeshInstance(wall, np.eye(4), axis_field(wall, 2, (1.0, 0, 0)))
    look = replace(INK, light="scene", shading=0.4)
    world_look = replace(look, unit_size=4 / SIZE)
    widths = []
    for zoom in (1.0, 1.6, 4.0):
        camera = orthographic_camera(
            look_at((0.3, -5, 0.2), (0.3, 0, 0.2)), SIZE, SIZE, scale=4 / zoom
        )
        widths.append(line_width(render(instance, camera, world_look)[..., 0]) / zoom)
        if zoom == 1:
            pixel_width = line_width(render(instance, camera, look)[..., 0])
    assert max(widths) / min(widths) < 1.15
    assert abs(widths[0] / pixel_width - 1) < 0.15


def test_lines_in_blender_units_scale_with_the_distance():
    """Two walls, one twice as far away as the other, both with the target tone."""
    points = np.array([[-1, 0, -2], [1, 0, -2], [1, 0, 2], [-1, 0, 2]], dtype=float)
    walls = []
    for index, (left, distance) in enumerate(((-1.0, 4.0), (2.0, 8.0))):
        wall = build_surface(points, [0, 1, 2, 3], [0, 4], name=f"wall {index}")
        matrix = np.diag([distance / 4, 1.0, distance / 4, 1.0])
        matrix[:3, 3] = left, distance, 0
        walls.append(MeshInstance(wall, matrix, axis_field(wall, 2, (1.0, 0, 0))))
    camera = perspective_camera(look_at((0, 0, 0), (0, 1, 0)), SIZE, SIZE, fov=2 * np.arctan(0.5))
    look = replace(INK, light="scene", shading=0.5, unit_size=0.04)
    picture = compose(project(walls, supersampled(camera, 2)), look).rgba[..., 0]
    near, far = picture[:, 8 : SIZE // 2 - 8], picture[:, SIZE // 2 + 8 : -8]
    assert line_width(near) / line_width(far) == pytest.approx(2, rel=0.2)
    assert abs(near.mean() - 0.5) < 0.05 and abs(far.mean() - 0.5) < 0.05


@pytest.mark.parametrize(
    "motion", ["zoomed", *long(*(name for name in MOTIONS if name != "zoomed"))]
)
def test_lines_in_blender_units_stay_on_the_surface(motion):
    look = replace(INK, light="scene", shading=0.35, unit_size=0.006)
    assert warped_correlation(*MOTIONS[motion](), look) >= 0.9


def line_width(picture):
    """The lag in pixels at which the autocorrelation across horizontal lines is 1/2."""
    columns = picture - picture.mean()
    spectrum = np.abs(np.fft.fft(columns, axis=0)) ** 2
    correlation = np.fft.ifft(spectrum.mean(axis=1)).real
    correlation /= correlation[0]
    below = int(np.argmax(correlation < 0.5))
    above, under = correlation[below - 1], correlation[below]
    return below - 1 + (above - 0.5) / (above - under)


# --- noise on the surface ---------------------------------------------------------------------------


def test_rest_coordinates_match_the_rest_shape():
    instance = make_instance(tube(bend=0.8), matrix=np.diag([1.0, -1.0, 2.0, 1.0]))
    gbuffer = project([instance], make_camera(distance=9))
    rest = rest_coordinates(gbuffer)
    corners = instance.surface.rest_vertices[instance.surface.triangle_vertex[gbuffer.triangle]]
    expected = np.einsum("pi,pij->pj", gbuffer.barycentric, corners)
    np.testing.assert_allclose(rest.at_offset(0, 0).T, expected, atol=2e-4)
    # A pixel to the right is the next pixel of the same triangle.
    right = np.flatnonzero((np.diff(gbuffer.pixel) == 1) & (np.diff(gbuffer.triangle) == 0))
    np.testing.assert_allclose(rest.at_offset(1, 0).T[right], expected[right + 1], atol=2e-4)


@pytest.mark.parametrize("high_pass", [0.0, 16.0])
@pytest.mark.parametrize("distance", [3.0, 4.7, 11.0])
def test_statistics_of_surface_noise(high_pass, distance):
    gbuffer = project([make_instance(tube())], make_camera(distance=distance, zoom=distance / 4))
    noise = surface_noise(gbuffer, 2.0, 0, 3, density=0.3, high_pass=high_pass)
    assert np.abs(noise.mean(axis=0) - 0.5).max() < 0.02
    assert 0.3 < noise.std() < 0.5
    channels = np.corrcoef(noise.T)
    assert np.abs(channels[np.triu_indices(3, 1)]).max() < 0.03


@pytest.mark.parametrize("offset", [2.0**22, 2.0**30])
def test_noise_of_a_mesh_far_from_its_origin_is_as_fine(offset):
    surface = tube()
    points = np.round(surface.vertices * 2**16) / 2**16  # exact after the offset, in float64
    camera, noises = make_camera(distance=4), []
    for moved_by in (0.0, offset):
        matrix = np.eye(4)
        matrix[:3, 3] = -moved_by
        far = build_surface(points + moved_by, surface.corner_vertex, surface.face_start)
        gbuffer = project([make_instance(far, matrix=matrix)], camera)
        noises.append(surface_noise(gbuffer, 2.0, 0, 1, density=0.3, high_pass=0.0))
    correlation = np.corrcoef(noises[0].T, noises[1].T)[0, 1]
    assert correlation > 0.99


def test_instances_have_different_noise():
    names = ["a", "b", "a", "a", "c"]
    assert len(set(instance_hashes(names).tolist())) == 5
    # Another instance does not change the hashes of the others.
    assert instance_hashes(["z", *names])[1:].tolist() == instance_hashes(names).tolist()
    # A mesh file looks the same in every folder.
    assert instance_hashes(["some/ball.obj"]) == instance_hashes(["C:\\other\\ball.obj"])


def test_clear_paper_shows_only_ink():
    look = replace(INK, paper_color="#ffffff00", ink_color="#204060")
    clear, full = (
        render(make_instance(ball()), make_camera(), look),
        render(make_instance(ball()), make_camera(), replace(look, paper_color="#ffffff")),
    )
    inked = clear[..., 3] > 0
    np.testing.assert_allclose(
        clear[inked][:, :3], np.tile(to_linear(from_hex("#204060")), (inked.sum(), 1)), rtol=1e-3
    )
    whole = full[..., 3] == 1
    for alpha in ("40", "c0"):
        part = render(
            make_instance(ball()), make_camera(), replace(look, paper_color="#ffffff" + alpha)
        )
        opacity = int(alpha, 16) / 255
        alpha_of_all = 1 - (1 - clear[..., 3]) * (1 - opacity)
        np.testing.assert_allclose(part[whole][:, 3], alpha_of_all[whole], atol=1e-5)
        ink = clear[..., :3] * clear[..., 3:]
        mixed = ink + opacity * (full[..., :3] - ink)
        np.testing.assert_allclose((part[..., :3] * part[..., 3:])[whole], mixed[whole], atol=1e-5)
    on_white = clear[..., :3] * clear[..., 3:] + 1 - clear[..., 3:]
    np.testing.assert_allclose(on_white[whole], full[whole][:, :3], atol=2e-3)


# --- outlines ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("width", [1.0, 2.0, 3.5, 6.0])
def test_the_width_of_outlines(width):
    """The outline of a ball has the area of a ring of that width along the border."""
    camera = orthographic_camera(look_at((0, -5, 0), (0, 0, 0)), SIZE, SIZE, scale=2.4)
    gbuffer = project([make_instance(ball())], camera)
    covered = outline_coverage(gbuffer, pixel_look(Look(outline=width)))
    radius = SIZE / 2.4
    ring = np.pi * (radius**2 - (radius - width) ** 2)
    assert covered.sum() == pytest.approx(ring, rel=0.06 if width > 1 else 0.15)
    from_middle = np.hypot(gbuffer.position[:, 0], gbuffer.position[:, 1]) * radius
    assert (covered[from_middle < radius - width - 2] == 0).all()
    assert (covered[(from_middle > radius - width + 2)] == 1).all()


def test_outlines_are_drawn_on_the_nearer_surface():
    """Two walls, one in front of the other: the far one has no line where it is occluded."""
    points = np.array([[-1, 0, -1], [1, 0, -1], [1, 0, 1], [-1, 0, 1]], dtype=float)
    walls = []
    for index, (left, distance) in enumerate(((0.0, 0.0), (0.7, 1.0))):
        wall = build_surface(points, [0, 1, 2, 3], [0, 4], name=f"wall {index}")
        matrix = np.eye(4)
        matrix[:3, 3] = left, distance, 0.3 * index
        walls.append(MeshInstance(wall, matrix, axis_field(wall, 4, (1.0, 0, 0.2))))
    camera = orthographic_camera(look_at((0, -5, 0), (0, 0, 0)), 240, 240, scale=4.0)
    gbuffer = project(walls, camera)
    covered = outline_coverage(gbuffer, pixel_look(Look(outline=3.0)))
    first, second = gbuffer.instance_id == 0, gbuffer.instance_id == 1
    x, y = gbuffer.position[:, 0] * 60, gbuffer.position[:, 1] * 60
    to_border = 60 - np.maximum(np.abs(x), np.abs(y))
    assert (covered[first] == (to_border[first] < 3)).all()
    hidden_by = second & (np.maximum(np.abs(x), np.abs(y)) < 65) & (x > -14) & (y > -38)
    assert hidden_by.sum() > 300 and (covered[hidden_by] == 0).all()


def test_lines_of_creases_are_half_on_each_side():
    """The line at an edge of a cube, seen symmetrically; no line if streaks cross creases."""
    soft = cube()
    box = build_surface(soft.vertices, soft.corner_vertex, soft.face_start, sharp_angle=1.0)
    camera = orthographic_camera(look_at((4.5, -3.5, 0.5), (0.5, 0.5, 0.5)), 240, 240, scale=2.0)
    gbuffer = project([MeshInstance(box, np.eye(4), axis_field(box, 4, (0, 0, 1.0)))], camera)
    x = (gbuffer.position @ np.eye(3)[0]) * 120
    middle = np.abs(x) < 20
    covered = outline_coverage(gbuffer, pixel_look(Look(outline=4.0)))
    inner = middle & (np.abs(gbuffer.position[:, 1] * 120) < 40)
    assert (covered[inner] == (np.abs(x[inner]) < 2)).all()
    assert not outline_coverage(gbuffer, pixel_look(Look(outline=4.0, crease_angle=np.pi)))[
        inner
    ].any()


def test_outlines_are_drawn_in_ink():
    plain = replace(INK, light="scene", shading=0.0)  # white, so that there are no lines
    bare, lined = (
        render(make_instance(ball()), make_camera(), replace(plain, outline=width))
        for width in (0.0, 2.0)
    )
    changed = np.abs(lined - bare)[..., 0] > 1e-3
    assert changed.sum() > 500
    ink = to_linear(from_hex(plain.ink_color))
    whole = lined[..., 3] == 1
    darkest = lined[changed & whole].min(axis=0)[:3]
    np.testing.assert_allclose(darkest, ink, atol=1e-3)
