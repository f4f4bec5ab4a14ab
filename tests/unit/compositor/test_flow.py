"""Drifting streaks, against plain convolutions, and by correlation between frames."""

import numpy as np
import pytest
from harness.planar import compose_planar
from planar_fields import KERNELS
from scipy import ndimage

from rosy_addon.compositor.drifting_averages import DriftingAverages, MovingKernel
from rosy_addon.compositor.filter_kernel import sample_weights
from rosy_addon.compositor.flow import NO_DRIFT, Drift, channel_shifts, channel_weights, drift_at
from rosy_addon.compositor.look import Look, has_flow
from rosy_addon.compositor.look_units import pixel_look

SIZE = 320

#: Pixels at the border that are not compared: streamlines end there.
MARGIN = 64


def member(angle, degree, look, drift=NO_DRIFT):
    """Return the image of the first member of a uniform field, around 0."""
    layer = compose_planar(np.full((SIZE, SIZE), angle), degree, look, drift=drift).layer
    return layer.images.members[0, :, 0].reshape(SIZE, SIZE) - 0.5


def inner(image):
    return image[MARGIN:-MARGIN, MARGIN:-MARGIN]


def correlation(first, second):
    return np.corrcoef(inner(first).ravel(), inner(second).ravel())[0, 1]


def best_shift(first, second, direction, expected, reach=3.0):
    """The shift of an image along a direction that makes it most like another one, in pixels."""
    shifts = np.arange(expected - reach, expected + reach + 0.01, 0.25)
    shifted = [ndimage.shift(first, shift * np.asarray(direction)[::-1]) for shift in shifts]
    likeness = [correlation(each, second) for each in shifted]
    return shifts[int(np.argmax(likeness))]


@pytest.mark.parametrize("kernel", KERNELS)
@pytest.mark.parametrize("is_short", [False, True])
def test_averages_are_those_of_kernels_moved_upstream(kernel, is_short):
    user_look = Look(flow=1.0, length=12, magnitude_length=is_short, **KERNELS[kernel])
    look = pixel_look(user_look, drift=drift_at(user_look, 4.3))
    shifts = channel_shifts(look.flow_phase, look.flow_distance)
    moving = MovingKernel(look)
    steps, count = 40, 5
    reach = look.streamline_reach()
    rng = np.random.default_rng(1)
    noise = rng.normal(size=(3, 2 * steps + 1, count))
    second = np.pad(noise, ((0, 0), (2, 0), (0, 0))).cumsum(axis=1).cumsum(axis=1)
    position, axial = 3, rng.uniform(-0.5, 0.5, count).astype(np.float32)
    length = np.full(count, 7) if is_short else None
    forward = np.array([1.0, 0.0, 1.0, 0.25, 0.5], dtype=np.float32)
    ends = np.full(count, reach), np.full(count, reach)
    averages = DriftingAverages(moving, second.astype(np.complex64))
    sums, samples = averages.at(position, axial, length, forward, *ends)

    kernel_length = 7.0 if is_short else 12.0
    offsets = np.arange(-steps, steps + 1) - position
    expected = np.zeros(count)
    for column in range(count):
        for direction, part in ((1, forward[column]), (-1, 1 - forward[column])):
            for channel in range(3):
                center = axial[column] - direction * kernel_length / 12 * shifts[channel]
                whole = np.floor(center)
                low, high = (
                    sample_weights(direction * (offsets - at), kernel_length, look.kernel)
                    for at in (whole, whole + 1)
                )
                weights = low + (center - whole) * (high - low)
                amount = part * channel_weights(look.flow_phase)[channel]
                expected[column] += amount * weights @ noise[channel, :, column]
    # The factor depends on nothing but the shares, where streamlines do not end.
    factor = sums.real / expected
    np.testing.assert_allclose(factor[[0, 2]], factor[1], rtol=2e-4)
    level = 7 if is_short else 0
    np.testing.assert_allclose(samples[:3], moving.full_samples[level], rtol=1e-5)
    assert factor.min() > 0


@pytest.mark.parametrize("phase", [0.0, 0.13, 0.5, 0.9])
def test_channels_have_a_constant_contrast(phase):
    assert np.square(channel_weights(phase)).sum() == pytest.approx(1)


def test_frames_of_a_loop_are_whole_cycles():
    look = Look(flow=1.3)
    first, second, last = (drift_at(look, frame, 50) for frame in (0, 1, 50))
    assert last.phase % 1 == pytest.approx(first.phase) and first.phase == 0
    distance = pixel_look(look, drift=first).flow_distance
    assert distance <= look.length
    cycles = 1.3 * 50 / distance
    assert cycles == pytest.approx(round(cycles)) and second.phase * distance == pytest.approx(1.3)


def test_looks_without_flow_do_not_drift():
    for look in (Look(), Look(flow=1.0, method="brute"), Look(flow=1.0, hue="noise")):
        assert not has_flow(look) and drift_at(look, 7) == NO_DRIFT
        assert pixel_look(look, drift=Drift(0.3)).lic_key() == pixel_look(look).lic_key()


@pytest.mark.slow
@pytest.mark.parametrize("degree", [1, 3])
def test_streaks_drift_along_directions(degree):
    look = Look(flow=1.0, length=20)
    # The first member is the one nearest to the guiding angle.
    first, second = (member(0.0, degree, look, drift_at(look, frame)) for frame in (5, 11))
    along = best_shift(first, second, (1, 0), 6)
    across = best_shift(first, second, (0, 1), 0)
    assert along == pytest.approx(6, rel=0.05) and across == 0
    moved = ndimage.shift(first, (0, 6))
    for lateral in (-1, 1):
        assert correlation(np.roll(moved, lateral, axis=0), second) < 0.7


def test_lines_drift_toward_the_guiding_angle():
    look = Look(flow=1.0, length=20, guiding_angle=np.pi)
    first, second = (member(0.0, 2, look, drift_at(look, frame)) for frame in (5, 11))
    assert best_shift(first, second, (1, 0), -6) == pytest.approx(-6, rel=0.05)


@pytest.mark.slow
def test_a_loop_closes():
    look, count = Look(flow=1.0, length=20), 24
    frames = [member(0.4, 1, look, drift_at(look, at, count)) for at in (0, 1, 12, 13, count - 1)]
    neighbors = [correlation(frames[0], frames[1]), correlation(frames[2], frames[3])]
    assert correlation(frames[-1], frames[0]) > min(neighbors) - 0.01
