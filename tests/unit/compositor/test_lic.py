"""LIC images against independent integrators, theory and invariances."""

from itertools import product

import numpy as np
import pytest
from harness.planar import compose_planar, lic, planar_pixel_field
from harness.streaks import correlation, orientation_spectrum, peaks, persistence
from planar_fields import KERNELS, kernel_window, pair_angle, pixel_centers, plain, swirl_angle
from scipy.integrate import solve_ivp

from rosy_addon.compositor.contrast import blend_gain, expected_std
from rosy_addon.compositor.image_noise import NoiseSettings, image_noise
from rosy_addon.compositor.look import Look
from rosy_addon.compositor.look_units import pixel_look

#: These tests draw many pictures and measure them.
pytestmark = pytest.mark.slow

SIZE = 256
METHODS = "sheets", "members", "brute", "ibfv"


def tone(angles, degree, look, **more):
    """(H, W) display values of a planar picture before clipping, one channel."""
    return compose_planar(angles, degree, look, **more).layer.tone[:, 0].reshape(angles.shape)


def make_noise(size, line_width=1.5, seed=0):
    pixel = np.arange(size * size, dtype=np.int32)
    return image_noise(pixel, size, NoiseSettings(line_width, seed))[:, 0]


def runge_kutta_lic(angle, noise, size, length, kernel):
    """One-member LIC in double precision, by scipy's Runge-Kutta method of order 5, away from borders."""
    x, y = (part.ravel() for part in pixel_centers(size))
    window = kernel_window(length, kernel)
    total = window[length] * noise.ravel()
    for sign in (1, -1):

        def direction(_, p, sign=sign):
            return sign * np.exp(1j * angle(p.real, p.imag, size))

        path = solve_ivp(direction, (0, length), x + 1j * y, t_eval=range(1, length + 1)).y.T
        row, column = (np.clip(part.astype(int), 0, size - 1) for part in (path.imag, path.real))
        total += window[::sign][length + 1 :] @ noise[row, column]
    return (total / window.sum()).reshape(size, size)


def crop_margin(image, margin=50):
    return image[margin:-margin, margin:-margin]


@pytest.mark.parametrize("kernel", KERNELS)
def test_one_direction_agrees_with_a_runge_kutta_integrator(kernel):
    size = 192
    noise = make_noise(size).reshape(size, size).astype(np.float64)
    expected = runge_kutta_lic(swirl_angle, noise, size, plain().length, kernel)
    look = plain(method="members", **KERNELS[kernel])
    actual = tone(swirl_angle(*pixel_centers(size), size), 1, look, noise=noise)
    assert correlation(crop_margin(actual), crop_margin(expected)) > 0.99


@pytest.mark.parametrize(("method", "settings"), [("members", {}), ("sheets", {"fade": "tail"})])
def test_corrected_contrast_is_that_of_one_member(method, settings):
    size = 320
    layers = compose_planar(np.full((size, size), 0.2), 7, plain(method=method, **settings)).layer
    inner = crop_margin(np.arange(size * size).reshape(size, size)).ravel()
    member_std = np.mean([member[inner].std() for member in layers.images.members])
    assert layers.tone[inner].std() == pytest.approx(member_std, rel=0.03)
    assert layers.tone[inner].mean() == pytest.approx(0.5, abs=0.01)


def test_the_blend_gain_of_seven_lines_includes_correlations():
    # Equation 6 assumes independent images; the correction for correlations is about a tenth.
    gain = blend_gain(7, np.array([81.0]), pixel_look(plain()))[0]
    assert 0.87 < gain / np.sqrt(7) < 0.94


@pytest.mark.parametrize(
    ("kernel", "line_width", "length", "high_pass"),
    [
        ("box", 1.0, 20, 0.0),
        ("taper", 1.0, 80, 8.0),
        ("ramp", 1.5, 20, 24.0),
        ("taper", 1.5, 80, 0.0),
        ("ramp", 3.0, 20, 8.0),
        ("box", 3.0, 80, 24.0),
    ],
)
def test_the_standard_deviation_of_one_member_matches_theory(kernel, line_width, length, high_pass):
    size = 2 * length + 310
    look = plain(line_width=line_width, length=length, high_pass=high_pass, **KERNELS[kernel])
    pictures = (tone(np.full((size, size), angle), 1, look) for angle in (0.1, 0.9, 1.7, 2.6))
    stds = [crop_margin(picture, length + 5).std() for picture in pictures]
    assert np.mean(stds) == pytest.approx(expected_std(pixel_look(look)), rel=0.05)


@pytest.mark.parametrize(
    "settings", [{"method": "members", "weights": "cosine"}, {"method": "sheets"}]
)
def test_breaking_points_are_not_visible(settings):
    size, degree, guides = 384, 4, 4
    x, _ = pixel_centers(size)
    # The field rotates evenly from left to right, so breaking points form evenly spaced columns.
    angles = 3 * 2 * np.pi / degree * x / size
    stds, similarity = np.zeros(2), np.zeros(2)
    # Several guiding angles, so that breaking points occur at several directions.
    for guide in np.arange(guides) * 2 * np.pi / degree / guides:
        image = tone(angles, degree, plain(guiding_angle=guide, **settings))
        angle_offset = np.abs(np.angle(np.exp(1j * degree * (angles - guide))))
        inner = np.zeros_like(x, dtype=bool)
        inner[50:-50, 50:-50] = True
        for group, chosen in enumerate((angle_offset > 2.7, angle_offset < 2.2)):
            chosen = inner & chosen
            stds[group] += image[chosen].std()
            similarity[group] += persistence(image, np.exp(1j * angles), chosen, 4)[4]
    assert stds[0] == pytest.approx(stds[1], rel=0.05)
    assert similarity[0] == pytest.approx(similarity[1], rel=0.05)


@pytest.mark.parametrize("method", METHODS)
def test_short_streamlines_have_the_contrast_of_full_ones(method):
    angles = np.zeros((SIZE, SIZE))
    angles[:, 100:112] = np.nan
    image = tone(angles, 1, plain(method=method))
    # Near the gap, about half of each streamline is missing.
    near_gap, far_from_gap = image[:, 112:122], image[:, 170:200]
    assert near_gap.std() == pytest.approx(far_from_gap.std(), rel=0.1)


@pytest.mark.parametrize("method", METHODS)
def test_streamlines_end_at_undefined_pixels(method):
    look = plain(method=method)
    whole = np.zeros((64, 64))
    half = np.where(np.arange(64) < 32, whole, np.nan)
    noise = make_noise(64).reshape(64, 64)
    other = noise.copy()
    other[:, 32:] = 1 - other[:, 32:]
    for ends, shown in ((True, half), (False, whole)):
        halves = [tone(shown, 1, look, noise=each)[:, :32] for each in (noise, other)]
        assert np.array_equal(*halves) == ends


@pytest.mark.parametrize(
    ("method", "degree"), [*product(["sheets"], [1, 2, 3, 4, 6]), ("ibfv", 1), ("ibfv", 4)]
)
def test_the_spectrum_peaks_at_the_members(method, degree):
    """To 1 degree, with no other direction."""
    image = tone(np.full((320, 320), 0.3), degree, plain(method=method))
    spectrum = orientation_spectrum(image)
    members = np.degrees(0.3 + 2 * np.pi * np.arange(degree) / degree) % 180
    expected = sorted(set(np.round(members, 6)))
    np.testing.assert_allclose(peaks(spectrum), expected, atol=1)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("shape", [(1, 1), (1, 300), (300, 1), (3, 5)])
def test_pictures_of_any_size(method, shape):
    for angle in (0.7, np.nan):
        images = lic(planar_pixel_field(np.full(shape, angle), 3), Look(method=method))
        assert np.isfinite(images.members).all() and images.effective_samples.min() >= 0.99


def test_color_noise_has_three_channels():
    angles = pair_angle(*pixel_centers(128), 128, 4)
    channels = compose_planar(angles, 4, plain(hue="noise")).layer.tone
    assert channels.shape == (128 * 128, 3)
    assert abs(correlation(channels[:, 0], channels[:, 1])) < 0.1
    assert np.allclose(channels[:, 0].reshape(128, 128), tone(angles, 4, plain()), atol=1e-6)


def test_the_same_settings_give_the_same_bytes():
    angles = pair_angle(*pixel_centers(128), 128, 4)
    first, second = (compose_planar(angles, 4, Look()).rgba.tobytes() for _ in range(2))
    assert first == second and compose_planar(angles, 4, Look(seed=1)).rgba.tobytes() != first
