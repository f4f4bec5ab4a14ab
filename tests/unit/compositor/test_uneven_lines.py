"""Uneven lines of hatching: breaks, wobble and the grain of paper."""

from dataclasses import replace

import numpy as np
import pytest
from harness.planar import planar_lines, planar_pixel_field
from hatched import INK, make_camera, make_instance, tube
from scipy.ndimage import gaussian_filter

from rosy_addon.compositor.hatching import render_hatching
from rosy_addon.compositor.image_noise import NoiseSettings, image_noise
from rosy_addon.compositor.look import Look
from rosy_addon.compositor.look_units import pixel_look
from rosy_addon.compositor.paper_grain import picture_paper_grain
from rosy_addon.compositor.wobble import WOBBLE_STD, rotate_pixel_field, wobble_angle
from rosy_addon.projection.project import project

#: These tests draw many pictures and measure them.
pytestmark = pytest.mark.slow


def plane_coverage(look, tone, degree=2, angle=0.3, side=320):
    """(H, W) coverage by lines of a constant field in the plane, for a constant tone."""
    look = pixel_look(replace(look, anchor="picture", paper_color="#ffffff00"))
    field, lines = planar_lines(np.full((side, side), angle), degree, look)
    tones = np.full(len(field.pixel), tone, dtype=np.float32)
    _, alpha = render_hatching(field, lines, tones)
    # Streamlines end at the frame.
    return alpha.reshape(side, side)[40:-40, 40:-40]


def mean_run_length(ink):
    """Mean length of the runs of ink along the rows."""
    ink = ink > 0.5
    begins = ink[:, 1:] & ~ink[:, :-1]
    return ink.sum() / begins.sum()


def test_breaks_and_paper_grain_shorten_lines():
    """Breaks most in light tones, where a pen barely touches the paper."""
    look = Look(ink="hatch", line_width=2.0, length=60, crispness=1.0)

    def shorter(tone, **settings):
        looks = look, replace(look, **settings)
        coverages = [plane_coverage(each, tone, angle=0.0) for each in looks]
        plain, uneven = map(mean_run_length, coverages)
        return uneven / plain

    light, middle, dark = (shorter(tone, breaks=1.0) for tone in (0.9, 0.5, 0.2))
    assert light < middle < dark < 1 and shorter(0.6, paper_grain=1.0) < 1


@pytest.mark.parametrize("line_width", [1.5, 3.0, 8.0])
def test_statistics_of_paper_grain(line_width):
    """Mean 0, standard deviation 1, no low frequencies, independent of other lines and streaks."""
    side = 512
    pixel = np.arange(side * side, dtype=np.int32)
    grain = picture_paper_grain(pixel, side, line_width, 0, line_count=2)
    first_grain, second_grain = grain.reshape(2, side, side)
    assert abs(np.corrcoef(first_grain.ravel(), second_grain.ravel())[0, 1]) < 0.03
    assert abs(first_grain.mean()) < 0.02 and first_grain.std() == pytest.approx(1, abs=0.03)
    assert gaussian_filter(first_grain, 16).std() < 0.12
    streaks = image_noise(pixel, side, NoiseSettings(line_width, 0))
    assert abs(np.corrcoef(first_grain.ravel(), streaks[:, 0])[0, 1]) < 0.02


def test_paper_grain_depends_only_on_the_pixel():
    """A height does not depend on the other visible pixels, and is equal at all subpixels."""
    pixel = np.arange(700 * 300, dtype=np.int32)
    full_frame = picture_paper_grain(pixel, 700, 2.0, 3).reshape(300, 700)
    column, row = np.meshgrid(np.arange(310, 330), np.arange(250, 280))
    part = picture_paper_grain((row * 700 + column).ravel().astype(np.int32), 700, 2.0, 3)
    np.testing.assert_allclose(part.reshape(30, 20), full_frame[250:280, 310:330], atol=1e-5)
    fine = picture_paper_grain(np.arange(1400 * 600, dtype=np.int32), 1400, 2.0, 3, 2)
    expected = full_frame.repeat(2, axis=0).repeat(2, axis=1)
    np.testing.assert_allclose(fine.reshape(600, 1400), expected)
    other = picture_paper_grain(pixel, 700, 2.0, 4)
    assert abs(np.corrcoef(other[0], full_frame.ravel())[0, 1]) < 0.02


@pytest.mark.parametrize("anchor", ["surface", "picture"])
@pytest.mark.parametrize("distance", [4.0, 30.0])
def test_statistics_of_the_wobble(anchor, distance):
    """Mean 0, standard deviation `WOBBLE_STD`, small differences of neighbors, at any distance."""
    gbuffer = project([make_instance(tube())], make_camera(distance=distance, zoom=distance / 4))
    actual = wobble_angle(gbuffer, pixel_look(replace(INK, anchor=anchor, line_width=1.5)))
    assert abs(actual.mean()) < 0.25 * WOBBLE_STD and 0.75 < actual.std() / WOBBLE_STD < 1.25
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
    expected = field.representation * np.exp(1j * degree * angle)
    np.testing.assert_allclose(turned.representation, expected, atol=1e-5)
