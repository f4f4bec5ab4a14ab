"""Evenly spaced lines: tone, distances in pictures, and where they are too close or too far apart."""

from dataclasses import replace

import numpy as np
import pytest
from harness.stroke_tracing import turned
from hatched import camera_above, render
from shapes import plane

from rosy_addon.compositor.even_lines import (
    COARSE_RATIO,
    EvenLines,
    even_lines,
    look_width_table,
    uneven_width,
)
from rosy_addon.compositor.look import Look
from rosy_addon.compositor.look_units import instance_line_spacing, pixel_look
from rosy_addon.compositor.pixel_field import all_members, surface_pixel_field
from rosy_addon.core.settings import settings_of
from rosy_addon.field.generate import axis_field
from rosy_addon.field.rosy_field import RosyField
from rosy_addon.projection.camera import look_at, orthographic_camera, perspective_camera
from rosy_addon.projection.gbuffer import MeshInstance
from rosy_addon.projection.project import project
from tests.fuzz.options import setting_value

SIZE = 256
LOOK = Look(
    ink="even",
    anchor="surface",
    shading=0.0,
    tone_levels=(0.0, 2.0, 1.0),
    line_width=3.0,
    line_distance=6.0,
    crispness=1.0,
    ink_color="#000000",
    layers=1,
)


def wall_instance(degree=2, angle=0.0, size=20.0):
    return turned(plane(2, 2, size), degree, angle)


def partly_undefined(degree):
    surface = plane(8, 8, 20.0)
    vectors = axis_field(surface, degree, (1, 0.3, 0)).vectors.copy()
    vectors[24:40] = 0
    return MeshInstance(surface, np.eye(4), RosyField(degree, vectors))


def lines_at_pixels(instance, camera, look=LOOK):
    gbuffer = project([instance], camera)
    field = surface_pixel_field(gbuffer, instance.field.degree, look.crease_angle)
    return even_lines(gbuffer, field, pixel_look(look, camera, [instance])), gbuffer


def distance_of_lines(rgba):
    """The period of horizontal lines in pixels, at the maximum of the spectrum of the columns."""
    columns = (rgba[..., 0] - rgba[..., 0].mean()) * np.hanning(SIZE)[:, None]
    spectrum = np.abs(np.fft.rfft(columns, 2**16, axis=0)) ** 2
    return 2**16 / np.argmax(spectrum.sum(axis=1))


# --- lines in pictures -------------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize(("supersampling", "distance"), [(1, 4.0), (2, 16.0)])
def test_the_distance_between_lines(distance, supersampling):
    """Distances in pixels are rounded to steps of 1 / 8 octave."""
    look = replace(LOOK, line_distance=distance, supersampling=supersampling)
    rgba = render(wall_instance(), camera_above(), look)
    assert abs(np.log2(distance_of_lines(rgba) / distance)) <= 0.5 / 8 + 0.01
    # Lines are along the rows.
    assert rgba[..., 0].std(axis=1).max() < 0.01


def test_distances_in_blender_units_are_exact():
    look = replace(LOOK, unit="scene", unit_size=0.037, line_distance=5.0)
    lines, _ = lines_at_pixels(wall_instance(), camera_above(8.0), look)
    pixels_per_unit = SIZE / 8
    np.testing.assert_allclose(lines.period, 5.0 * 0.037 * pixels_per_unit, rtol=1e-4)
    assert lines.growth is None


def test_spacings_in_pixels_come_in_steps():
    instance, look = wall_instance(), pixel_look(LOOK)
    cameras = [camera_above(scale) for scale in np.linspace(8, 16, 200)]
    spacings = {instance_line_spacing(look, camera, instance) for camera in cameras}
    np.testing.assert_allclose(np.diff(np.log2(sorted(spacings))), 1 / 8, atol=1e-9)
    assert len(spacings) == 9


@pytest.mark.slow
def test_lines_at_a_larger_distance_replace_crowded_ones():
    """On a wall that is seen at a small angle, all lines along the horizon would run together."""
    cosine = 0.2
    eye = (0, -5 * np.sqrt(1 - cosine**2), 5 * cosine)
    camera = orthographic_camera(look_at(eye, (0, 0, 0), (0, 0, 1)), SIZE, SIZE, scale=2.0)
    rgba = render(wall_instance(), camera, replace(LOOK, line_distance=8.0))
    assert rgba[..., 0].std() > 0.2
    distance = distance_of_lines(rgba)
    assert abs(np.log2(distance / (COARSE_RATIO * 2 * 4.0 * cosine))) <= 0.5 / 8 + 0.02


@pytest.mark.parametrize("degree", [1, 2, 3, 4, 5, 6])
@pytest.mark.parametrize("side", [1, -1])
def test_members_get_the_lines_along_them(degree, side):
    """The gradient of the streaks is across the member, on both sides of the surface."""
    gbuffer = project([wall_instance(degree, 0.4)], camera_above(eye=(0, 0, 5 * side)))
    field = surface_pixel_field(gbuffer, degree, 0.7)
    look = replace(LOOK, line_distance=16.0, guiding_angle=0.3)
    lines = even_lines(gbuffer, field, pixel_look(look))
    members = all_members(field, look.guiding_angle)
    for member, streak in zip(members, lines.streaks, strict=False):
        up, right = np.gradient(streak.reshape(SIZE, SIZE))
        gradient = (right + 1j * up).reshape(-1) * np.conj(member)
        steep = np.abs(gradient) > 0.5 * np.abs(gradient).max()
        assert np.median(np.abs(gradient.real[steep] / gradient.imag[steep])) < 0.02


def test_undefined_pixels_have_the_mean_tone():
    lines, gbuffer = lines_at_pixels(partly_undefined(2), camera_above(20.0))
    undefined = gbuffer.representation == 0
    assert undefined.any() and not lines.period[:, undefined].any()
    width = np.full(len(gbuffer.pixel), 0.3, dtype=np.float32)
    np.testing.assert_allclose(lines.coverage(0, width, LOOK)[undefined], 0.3, atol=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("breaks", [0.0, 0.5])
def test_settings_that_do_not_apply_do_not_change_the_picture(breaks):
    """Pictures are up to date when only such settings change. Some faces have no direction."""
    instance, camera = partly_undefined(4), camera_above(20.0, size=96)
    look = replace(LOOK, crispness=0.8, layers=2, breaks=breaks)
    expected = render(instance, camera, look)
    others, random = {"length": 7, "fade": "ends"}, np.random.default_rng(0)
    applied = {name for name in others if settings_of(Look)[name].applies(look)}
    assert applied == (set(others) if breaks else set())
    for name, setting in settings_of(Look).items():
        if setting.applies(look):
            continue
        while (other := others.get(name, setting_value(random, setting))) == setting.default:
            pass
        actual = render(instance, camera, look.with_settings({name: other}))
        np.testing.assert_array_equal(actual, expected, err_msg=name)
    for name in applied:
        actual = render(instance, camera, replace(look, **{name: others[name]}))
        assert np.abs(actual - expected).max() > 0.1, name


# --- tone ------------------------------------------------------------------------------------------


@pytest.mark.parametrize("crispness", [0.0, 0.6, 1.0])
@pytest.mark.parametrize("period", [1.5, 2.2, 5.0, 40.0])
@pytest.mark.parametrize("growth", [None, 0.0, 0.4, 1.0])
def test_the_mean_coverage_is_exact(crispness, period, growth):
    count = 20_000
    position = (np.arange(count, dtype=np.float32) + 0.5) / count
    streaks = (1 - 2 * np.abs(position - np.rint(position)))[None]
    periods = np.full((1, count), period, dtype=np.float32)
    growths = None if growth is None else np.full(count, growth, dtype=np.float32)
    lines = EvenLines(streaks, periods, growths)
    look = replace(LOOK, crispness=crispness)
    for width in (0.0, 0.03, 0.3, 0.5, 0.8, 0.97, 1.0):
        coverage = lines.coverage(0, np.full(count, width, dtype=np.float32), look)
        assert coverage.min() >= -1e-5 and coverage.max() <= 1 + 1e-5
        assert coverage.mean() == pytest.approx(width, abs=1e-3)


@pytest.mark.parametrize("breaks", [0.0, 0.5, 1.0])
@pytest.mark.parametrize("paper_grain", [0.0, 0.8])
def test_uneven_lines_have_the_mean_width(breaks, paper_grain):
    look = replace(LOOK, breaks=breaks, paper_grain=paper_grain, wobble=0.3)
    streak, grain = np.random.default_rng(0).standard_normal((2, 200_000))
    for width in (0.05, 0.3, 0.7, 0.95):
        widths = uneven_width(np.full(streak.shape, width), look, streak, grain)
        assert widths.mean() == pytest.approx(width, abs=6e-3)
    assert (np.diff(look_width_table(look)) > 0).all()


# --- perspective -------------------------------------------------------------------------------------


@pytest.mark.slow
def test_lines_grow_between_lines_that_are_too_far_apart():
    """A floor that runs from near the eye to far away."""
    instance = wall_instance(2, np.pi / 2, 40.0)
    camera = perspective_camera(look_at((0, -18.5, 1.0), (0, 0, 0), (0, 0, 1)), SIZE, SIZE, fov=1.0)
    look = replace(LOOK, line_distance=4.0)
    lines, gbuffer = lines_at_pixels(instance, camera, look)
    assert lines.growth is not None and lines.growth.max() > 0.99
    # Without doubling, the nearest lines would be about 9 times as far apart as asked for.
    depth = -gbuffer.position[:, 2]
    # In the middle of the picture, lines run straight up.
    near = (depth < 0.9 * 18) & (np.abs(gbuffer.position[:, 0]) < 0.02 * depth)
    assert near.sum() > 500
    assert lines.period[0, near].min() > 3.6 and lines.period[0, near].max() < 8.4
    coverage = lines.coverage(0, np.full(len(depth), 0.4, np.float32), look)
    assert coverage[near].mean() == pytest.approx(0.4, abs=0.05)
    assert (
        lines_at_pixels(instance, camera, replace(look, unit="scene", unit_size=0.2))[0].growth
        is None
    )
