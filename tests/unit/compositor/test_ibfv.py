"""Image based flow visualization: directions, contrast, drift, loops."""

from dataclasses import replace

import numpy as np
import pytest
from harness.planar import lic, planar_pixel_field
from planar_fields import pixel_centers

from bench import cases
from rosy_addon.compositor.compose import compose
from rosy_addon.compositor.filter_kernel import full_sample_count
from rosy_addon.compositor.flow import Drift, cycle_distance, drift_at
from rosy_addon.compositor.ibfv import decay_of_samples
from rosy_addon.compositor.look import Look
from rosy_addon.compositor.pixel_field import PixelField
from rosy_addon.core.cache import Cache
from rosy_addon.projection.project import project

LOOK = Look(method="ibfv")


def uniform(angle: float, degree: int, size: int = 192) -> PixelField:
    return planar_pixel_field(np.full((size, size), angle), degree)


def frame(values: np.ndarray, field: PixelField) -> np.ndarray:
    return values.reshape(field.height, field.width)


def test_the_contrast_is_the_same_where_streaks_end():
    """Without the correction it would be several times as high."""
    field = uniform(0.3, 1)
    images = [frame(lic(field, replace(LOOK, seed=seed)).members[0], field) for seed in range(3)]
    begin = np.std([image[:, 6:14] for image in images])
    middle = np.std([image[:, 90:98] for image in images])
    assert begin == pytest.approx(middle, rel=0.2)


@pytest.mark.parametrize("two_sided", [False, True])
@pytest.mark.parametrize("samples", [1.0, 3.0, 81.0, 2001.0])
def test_the_kernel_has_the_effective_samples(samples, two_sided):
    decay = float(decay_of_samples(np.array(samples), two_sided))
    weight = decay ** np.arange(100_000)
    weight[0] = 0.5
    if two_sided:
        weight = np.concatenate([weight[:0:-1], [1.0], weight[1:]])
    assert weight.sum() ** 2 / (weight**2).sum() == pytest.approx(samples, rel=1e-3)


def test_the_kernel_is_exponential():
    """A bright pixel becomes a streak that begins there, and fades along the direction of the field."""
    noise = np.full((64, 200), 0.5)
    noise[32, 60] = 1.5
    look = replace(LOOK, length=10)
    field = planar_pixel_field(np.zeros(noise.shape), 1)
    image = frame(lic(field, look, noise.reshape(-1, 1).astype(np.float32)).members[0], field)
    decay = float(decay_of_samples(np.array(full_sample_count(look.length, "box")), False))
    # The noise of the first pixels is sharpened.
    streak = image[32, 63:93] - 0.5
    np.testing.assert_allclose(streak / streak[0], decay ** np.arange(30), rtol=0.02)
    assert np.abs(image[32, :59] - 0.5).max() < 1e-6


def test_streamlines_stay_on_circles():
    """Noise that grows with the radius is the same along them. Steps along tangents would leave them."""
    size, radius = 160, 50
    x, y = pixel_centers(size)
    distance, angle = np.hypot(x - size / 2, y - size / 2), np.arctan2(y - size / 2, x - size / 2)
    field = planar_pixel_field(angle + np.pi / 2, 1)
    noise = (0.5 + (distance - radius) / 100).reshape(-1, 1).astype(np.float32)
    image = lic(field, LOOK, noise).members[0].reshape(size, size)
    ring = np.abs(distance - radius) < 3
    slope, error = np.polyfit((distance - radius)[ring], 100 * (image[ring] - 0.5), 1)
    assert abs(error / slope) < 0.1


@pytest.mark.parametrize("degree", [1, 3, 4])
def test_branch_cuts_of_the_angle_leave_no_seam(degree):
    """The numbers of the members change at cuts, whose place depends on the guiding angle."""
    size = 128
    x, y = pixel_centers(size)
    angle = np.arctan2(y - size / 2, x - size / 2) / degree
    field = planar_pixel_field(angle, degree)
    one, other = (lic(field, replace(LOOK, guiding_angle=angle)).blend for angle in (0.0, 0.5))
    assert np.std(one - other) < 0.02 * one.std()


# --- drift ----------------------------------------------------------------------------------------

FLOW = replace(LOOK, flow=1.5)

#: A cycle of 60 pixels, for which frames are drawn.
CYCLE = 60 / cycle_distance(FLOW.length, FLOW.method)


#: A bright spot in gray noise.
SPOT = np.full((64, 200, 3), 0.5, dtype=np.float32)
SPOT[32, 100] += (1.0, -0.5, 0.3)


def drift_of(frame):
    return Drift(frame * FLOW.flow / 60 % 1, CYCLE)


@pytest.mark.parametrize(("degree", "backward"), [(1, 0), (2, 0), (3, 0), (1, 1)])
def test_streaks_drift_by_the_flow(degree, backward):
    """The streak of a pixel is a wave that fades. After two frames, it is three pixels further."""
    field = planar_pixel_field(np.full((64, 200), np.pi * backward), degree)
    frames = []
    for number in (5, 7):
        image = frame(lic(field, FLOW, SPOT.reshape(-1, 3), drift_of(number)).members[0], field)
        frames.append((image[32, ::-1] if backward else image[32]) - 0.5)
    decay = float(decay_of_samples(np.array(full_sample_count(FLOW.length, "box")), False))
    source = 200 - 101 if backward else 100
    before, after = frames[0][source + 3 :][:40], frames[1][source + 6 :][:40]
    np.testing.assert_allclose(after, before * decay**3, atol=0.003 * np.abs(before).max())
    assert np.abs(frames[0][: source - 2]).max() < 1e-6
    assert np.std(before / decay ** np.arange(40)) > 0.1 * np.abs(before).max()


def test_lines_across_the_guiding_angle_drift_both_ways():
    field = planar_pixel_field(np.zeros((64, 200)), 2)
    look = replace(FLOW, guiding_angle=np.pi / 2)
    image = lic(field, look, SPOT.reshape(-1, 3), Drift(0.3, CYCLE)).members[0]
    row = frame(image, field)[32] - 0.5
    np.testing.assert_allclose(row[101:180], row[99:20:-1], atol=1e-4)
    assert np.abs(row[110]) > 0.1 * np.abs(row).max()


@pytest.mark.parametrize("degree", [1, 4])
def test_a_loop_closes(degree):
    field = uniform(0.3, degree)
    drifts = [drift_at(FLOW, number, 12) for number in (0, 1, 11, 12)]
    frames = [lic(field, FLOW, drift=drift).members.astype(float) for drift in drifts]
    np.testing.assert_array_equal(frames[0], frames[3])
    to_next, to_last = np.std(frames[1] - frames[0]), np.std(frames[2] - frames[3])
    assert to_last == pytest.approx(to_next, rel=0.1) and to_next < 0.5 * np.std(frames[0])


def test_frames_in_sequence_are_those_drawn_alone():
    gbuffer = project([cases.instance(2000, 4)], cases.camera(64))
    cache = Cache()
    drifts = [drift_of(number) for number in range(4)]
    sequence = [compose(gbuffer, FLOW, cache=cache, drift=drift).rgba for drift in drifts]
    for number in (3, 1):
        alone = compose(gbuffer, FLOW, drift=drifts[number]).rgba
        np.testing.assert_array_equal(alone, sequence[number])
    assert np.abs(sequence[3] - sequence[0]).mean() > 0.01
