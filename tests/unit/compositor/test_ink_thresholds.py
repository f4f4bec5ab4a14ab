"""Thresholds of hatching: the coverage from which each point is covered by ink."""

from dataclasses import replace

import numpy as np
import pytest
from harness.planar import planar_lines
from shapes import instance_of, torus

from rosy_addon.compositor.ink_from_thresholds import ink_of_thresholds
from rosy_addon.compositor.ink_thresholds import (
    cyclic_places,
    layer_shares,
    line_thresholds,
    ordered_thresholds,
    sharp_look,
    threshold_pixels,
    unlit_look,
)
from rosy_addon.compositor.look import Look
from rosy_addon.compositor.look_units import pixel_look
from rosy_addon.core.color import to_linear
from rosy_addon.projection.camera import orbit_camera
from rosy_addon.rendering.draw import draw_picture
from rosy_addon.rendering.view_input import ViewInput

SIZE = 400
INK = Look(ink="hatch", length=30, line_width=2.0, density=0.3, high_pass=8.0)


@pytest.mark.parametrize("breaks, wobble, grain", [(0, 0, 0), (0.7, 0, 0.4), (0, 0.4, 0)])
def test_thresholds_draw_the_lines_of_a_picture(breaks, wobble, grain):
    """They are evenly distributed, and comparing them with a coverage draws the coverage by the line."""
    look = pixel_look(sharp_look(replace(INK, breaks=breaks, wobble=wobble, paper_grain=grain)))
    row, column = np.indices((SIZE, SIZE)) / SIZE
    angles = 0.5 * np.sin(4 * row) + 0.5 * column
    angles[:80] = np.nan
    _, lines = planar_lines(angles, 4, look)
    thresholds = line_thresholds(1, lines)
    expected = np.linspace(0.1, 0.9, 9)
    np.testing.assert_allclose(np.quantile(thresholds, expected), expected, atol=0.025)
    for coverage in (0.15, 0.5, 0.8):
        covered = lines.coverage(1, np.full(len(thresholds), coverage))
        is_clear = np.abs(covered - 0.5) > 0.05
        differs = (thresholds < coverage) != (covered > 0.5)
        assert differs[is_clear].mean() < 1e-4 and is_clear.mean() > 0.9


def random_lines(lines: int, count: int = 40_000, seed: int = 1):
    """Independent thresholds, evenly distributed, and random places of the lines."""
    rng = np.random.default_rng(seed)
    first = rng.dirichlet(np.full(lines, 0.5), count).T.astype(np.float32)
    return rng.random((lines, count), dtype=np.float32), cyclic_places(first)


@pytest.mark.parametrize(
    "lines, layers, layering",
    [(2, 1, 0.3), (2, 2, 0.8), (3, 3, 0), (3, 3, 0.8), (5, 2, 0.3), (5, 3, 0.8)],
)
def test_ordered_thresholds_transmit_what_the_tone_asks(lines, layers, layering):
    """Also where lines swap."""
    look = replace(INK, layers=layers, layering=layering)
    thresholds, places = random_lines(lines)
    undefined = np.zeros(thresholds.shape[1], dtype=bool)
    ordered = ordered_thresholds(thresholds, places, undefined, look)[:layers]
    for transmittance in (0.05, 0.3, 0.5, 0.8):
        share = layer_shares(np.array(1 - transmittance), layers, layering)
        bare = np.all([t > 1 - transmittance**s for t, s in zip(ordered, share, strict=True)], 0)
        # The standard error of a share of 40,000 samples is at most 0.0025.
        assert bare.mean() == pytest.approx(transmittance, abs=0.01)


def test_lines_keep_their_thresholds_where_none_swap():
    """The first is that of the line in the first place, and the others follow in turn."""
    thresholds, _ = random_lines(3, 1000)
    first = np.zeros_like(thresholds)
    first[2] = 1
    undefined = np.zeros(1000, dtype=bool)
    ordered = ordered_thresholds(thresholds, cyclic_places(first), undefined, INK)
    np.testing.assert_allclose(ordered, thresholds[[2, 0, 1]], atol=1e-5)


def test_ink_of_lines_in_equal_places_is_that_of_both():
    """Each is as dark as the other, and where neither has ink, there is none."""
    thresholds, _ = random_lines(2)
    first = np.full_like(thresholds, 0.5)
    undefined = np.zeros(thresholds.shape[1], dtype=bool)
    ordered = ordered_thresholds(thresholds, cyclic_places(first), undefined, INK)
    for transmittance in (0.1, 0.5, 0.8):
        share = layer_shares(np.array(1 - transmittance), 2, INK.layering)
        has_ink = np.any([t < 1 - transmittance**s for t, s in zip(ordered, share, strict=True)], 0)
        expected = thresholds.min(axis=0) < 1 - transmittance**0.5
        assert (has_ink != expected).mean() < 1e-3


def test_ordered_thresholds_are_continuous():
    """Neither where two lines swap, nor where one of them begins before the other, is there a jump."""
    count = 20_001
    share = np.linspace(0, 1, count, dtype=np.float32)
    undefined = np.zeros(count, dtype=bool)
    for first, second, third in np.random.default_rng(5).random((4, 3), dtype=np.float32) * 0.9:
        thresholds = np.broadcast_to(np.array([[first], [second], [third]]), (3, count))
        places = cyclic_places(np.stack([share, 1 - share, 0 * share]))
        ordered = ordered_thresholds(thresholds, places, undefined, INK)
        # A jump would not get smaller with the steps.
        assert np.abs(np.diff(ordered, axis=1)).max() < 0.025


def test_undefined_pixels_have_the_ink_of_all_lines():
    """There the first line alone transmits what the tone asks."""
    thresholds = np.random.default_rng(2).random((3, 40_000), dtype=np.float32)
    everywhere = np.ones(40_000, dtype=bool)
    places = cyclic_places(np.full_like(thresholds, 1 / 3))
    ordered = ordered_thresholds(thresholds, places, everywhere, INK)
    assert (ordered[1:] > 0.999).all()
    for transmittance in (0.1, 0.5, 0.8):
        share = layer_shares(np.array(1 - transmittance), 3, INK.layering)[0]
        bare = (ordered[0] > 1 - transmittance**share).mean()
        assert bare == pytest.approx(transmittance, abs=0.02)


@pytest.mark.slow
@pytest.mark.parametrize(("ink", "supersampling"), [("hatch", 1), ("even", 2)])
def test_thresholds_of_a_picture_draw_its_ink(ink, supersampling):
    """At any tone: a torus in the light of the camera, whose contour has all of them."""
    look = replace(INK, ink=ink, layers=2, supersampling=supersampling, light="headlight")
    instance = instance_of(torus(48, 24), 4, "axis")
    camera = orbit_camera(instance.face_points(), 0.0, 50.0, 320, 240)
    view = ViewInput((instance,), camera, look)
    expected = draw_picture(view).rgba
    view = replace(view, look=unlit_look(look), draws_thresholds=True)
    picture = draw_picture(view)
    gray = replace(look, ink="soft", gain=0.0, supersampling=1)
    tone = draw_picture(replace(view, look=gray)).rgba[..., 0]
    tone /= to_linear(np.float32(0.5))
    pixels = np.dstack([picture.rgba[..., :3], picture.spread])
    inside = (picture.rgba[..., 3] > 0.99) & (expected[..., 3] > 0.99)
    color, _ = ink_of_thresholds(pixels[inside], np.clip(tone[inside], 0, 1), look, 2)
    drawn = expected[inside][:, 0]
    assert color[:, 0].mean() == pytest.approx(drawn.mean(), abs=0.01)
    assert np.corrcoef(color[:, 0], drawn)[0, 1] > 0.95


def test_the_spread_of_averaged_pixels():
    """The mean of single pixels has no spread, that of many has the spread of an even distribution."""
    thresholds, _ = random_lines(3, 4096)
    pixels = threshold_pixels(thresholds)
    for size, spread in ((1, 0.0), (4096, 1 / 3)):
        mean = pixels[:size].mean(axis=0)
        centered = 2 * mean[:3] - 1
        assert mean[3] - np.mean(centered**2) == pytest.approx(spread, abs=0.015)
    unresolved = threshold_pixels(thresholds, np.zeros(4096))
    np.testing.assert_allclose(unresolved[:, :3], 0.5, atol=0.003)
    np.testing.assert_allclose(unresolved[:, 3], 1 / 3, atol=0.003)
    np.testing.assert_array_equal(threshold_pixels(thresholds[:2])[:, 2], pixels[:, 0])


@pytest.mark.parametrize("count", [1, 2, 4, 16, 256])
def test_smaller_versions_of_a_texture_keep_the_tone(count):
    """The ink of means of thresholds has the mean tone, however many thresholds are averaged."""
    thresholds, _ = random_lines(2, 204_800)
    look = replace(INK, ink_color="#000000", crispness=1.0)
    pixels = threshold_pixels(thresholds).reshape(-1, count, 4).mean(axis=1)
    for tone in (0.0, 0.1, 0.3, 0.5, 0.8, 1.0):
        color, coverage = ink_of_thresholds(pixels, np.full(len(pixels), tone), look, 2)
        atol = 0.03 if 0 < tone < 1 else 0.005
        assert color[:, 0].mean() == pytest.approx(tone, abs=atol)
        np.testing.assert_allclose(color[:, 0], 1 - coverage, atol=1e-5)
