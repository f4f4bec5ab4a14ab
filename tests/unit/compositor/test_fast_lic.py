"""Fast LIC on the covering surface, against brute force and closed forms."""

from dataclasses import replace

import numpy as np
import pytest
from harness.planar import lic, planar_pixel_field
from hypothesis import given, settings
from hypothesis import strategies as st
from planar_fields import KERNELS, PLAIN, pair_angle, pixel_centers, plain

from rosy_addon.compositor import fast_lic
from rosy_addon.compositor.covering import build_covering
from rosy_addon.compositor.filter_kernel import kernel_weights
from rosy_addon.compositor.lic import look_noise
from rosy_addon.compositor.look_units import pixel_look

SIZE = 256


def brute_force(field, look=PLAIN, noise=None):
    return lic(field, replace(look, method="brute"), noise)


@pytest.mark.parametrize(
    ("kernel", "degree"), [("box", 1), ("box", 2), ("taper", 1), ("taper", 2), ("ramp", 1)]
)
def test_averages_match_brute_force_if_noise_is_constant_across_streamlines(kernel, degree):
    field = planar_pixel_field(np.zeros((SIZE, SIZE)), degree)
    look = replace(PLAIN, **KERNELS[kernel])
    noise = np.tile(look_noise(field, pixel_look(PLAIN))[:SIZE], (SIZE, 1))
    actual, expected = lic(field, look, noise), brute_force(field, look, noise)
    np.testing.assert_allclose(actual.effective_samples, expected.effective_samples, rtol=1e-6)
    contrast = (actual.members - 0.5) / fast_lic.CONTRAST_MATCH
    np.testing.assert_allclose(contrast, expected.members - 0.5, atol=5e-4)


@pytest.mark.slow
@given(
    degree=st.integers(1, 12),
    first_angle=st.floats(-np.pi, np.pi),
    second_angle=st.floats(-np.pi, np.pi),
    guide=st.floats(-3, 3),
)
@settings(max_examples=200)
def test_the_sheet_of_the_next_pixel_is_the_best_match(degree, first_angle, second_angle, guide):
    field = planar_pixel_field(np.array([[first_angle, second_angle]]), degree)
    look = pixel_look(replace(PLAIN, guiding_angle=guide))
    covering = build_covering(field, look, np.ones((2, 1), dtype=np.float32))
    first, second = covering.cell_of_pixel
    directions = covering.state_table.reshape(2 * covering.line_count, -1, 4)[..., :2] / 32767.0
    match = directions[:, first] @ directions[:, second].T
    for sheet in range(2 * covering.line_count):
        matching = np.rint(covering.packed_phase[first] - covering.packed_phase[second])
        chosen = int(sheet + matching) % (2 * covering.line_count)
        assert match[sheet, chosen] > match[sheet].max() - 2e-4


@pytest.mark.slow
@pytest.mark.parametrize(("kernel", "degree"), [("box", 4), ("taper", 3), ("ramp", 3)])
def test_pictures_of_singular_fields_resemble_brute_force(kernel, degree):
    look = replace(PLAIN, **KERNELS[kernel])
    field = planar_pixel_field(pair_angle(*pixel_centers(SIZE), SIZE, degree), degree)
    actual, expected = (images(field, look).blend[:, 0] for images in (lic, brute_force))
    # They are not equal, because each streak is shifted by up to half a pixel.
    assert np.corrcoef(actual, expected)[0, 1] > 0.85
    assert actual.std() == pytest.approx(expected.std(), rel=0.03)


@pytest.mark.slow
@pytest.mark.parametrize(("kernel", "degree"), [("box", 4), ("taper", 4), ("ramp", 3)])
def test_streamlines_end_where_brute_force_ends_them(kernel, degree):
    look = replace(PLAIN, **KERNELS[kernel])
    x, y = pixel_centers(SIZE)
    angles = np.where(np.hypot(x - 128, y - 128) < 90, pair_angle(x, y, SIZE, degree), np.nan)
    field = planar_pixel_field(angles, degree)
    actual, expected = lic(field, look), brute_force(field, look)
    inside = field.representation != 0
    assert (actual.effective_samples[~inside] == 1).all()
    difference = actual.effective_samples[inside] - expected.effective_samples[inside]
    assert abs(difference.mean()) < 0.5 and np.abs(difference).mean() < 2


@pytest.mark.parametrize("kernel", KERNELS)
def test_magnitude_determines_the_samples_of_a_pixel(kernel):
    x, _ = pixel_centers(SIZE)
    field = planar_pixel_field(np.zeros((SIZE, SIZE)), 1, magnitude=x / SIZE)
    look = plain(magnitude_length=True, color_range=(0.0, 1.0), length=30, **KERNELS[kernel])
    samples = lic(field, look).effective_samples.reshape(SIZE, SIZE)[:, 40:-40]
    reach = np.rint(30 * x / SIZE)[:, 40:-40]
    expected = kernel_weights(reach, reach, reach, kernel).effective_samples
    np.testing.assert_allclose(samples, expected, rtol=1e-5)
    expected = brute_force(field, look).effective_samples.reshape(SIZE, SIZE)[:, 40:-40]
    np.testing.assert_allclose(samples, expected, rtol=1e-5)


def test_long_streamlines_end_when_they_have_closed_a_loop():
    # The loops are circles of up to 201 pixels. The cost does not grow with the length.
    x, y = pixel_centers(64)
    field = planar_pixel_field(np.arctan2(y - 32, x - 32) + np.pi / 2, 1)
    samples = lic(field, replace(PLAIN, length=8000)).effective_samples
    samples = samples.reshape(64, 64)[np.hypot(x - 32, y - 32) < 31]
    loop = 2 * np.pi * 31
    assert samples.max() < 4 * (256 + 2 * loop) and np.median(samples) > 256


@pytest.mark.parametrize("degree", [1, 4])
def test_fields_that_change_a_little_keep_their_streamlines(degree):
    """Pictures of a series do not flicker: pixels keep the streamline from which they take their average."""
    x, y = pixel_centers(SIZE)
    angle = pair_angle(x, y, SIZE, degree)
    fields = [planar_pixel_field(angle + np.radians(turn), degree) for turn in (0.0, 0.02)]
    first, second = (lic(field, PLAIN).members.ravel() for field in fields)
    assert np.corrcoef(first, second)[0, 1] > 0.975
