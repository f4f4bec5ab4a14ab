"""Cameras: lenses as in Blender, framing, and errors."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from lenses import shifted
from shapes import icosphere

from rosy_addon.field.frames import transformed
from rosy_addon.projection.camera import (
    Camera,
    look_at,
    orbit_basis,
    orbit_camera,
    orthographic_camera,
    perspective_camera,
    pixel_rays,
)
from rosy_addon.projection.gbuffer import MeshInstance

angles = st.floats(-400, 400)
sizes = st.sampled_from([(64, 64), (90, 40), (30, 70)])


def device_coordinates(camera, points):
    """(V, 3) normalized device coordinates."""
    clip = transformed(points, camera.projection @ camera.view)
    assert (clip[:, 3] > 0).all()
    return clip[:, :3] / clip[:, 3:]


@pytest.mark.parametrize(
    ("azimuth", "elevation", "right", "up", "back"),
    [
        (0, 0, (1, 0, 0), (0, 0, 1), (0, -1, 0)),  # Blender's front view, numpad 1
        (90, 0, (0, 1, 0), (0, 0, 1), (1, 0, 0)),  # right view, numpad 3
        (180, 0, (-1, 0, 0), (0, 0, 1), (0, 1, 0)),  # back
        (0, 90, (1, 0, 0), (0, 1, 0), (0, 0, 1)),  # top view, numpad 7
        (0, -90, (1, 0, 0), (0, -1, 0), (0, 0, -1)),  # bottom
    ],
)
def test_view_directions_match_blender(azimuth, elevation, right, up, back):
    np.testing.assert_allclose(orbit_basis(azimuth, elevation), [right, up, back], atol=1e-12)


@given(st.integers(0, 2**32 - 1), angles, angles, st.booleans(), sizes)
def test_everything_is_framed_and_touches_the_margin(seed, azimuth, elevation, perspective, size):
    random = np.random.default_rng(seed)
    points = random.normal(size=(20, 3)) * random.uniform(0.01, 100, 3) + random.normal(size=3) * 50
    camera = orbit_camera(points, azimuth, elevation, *size, perspective=perspective, margin=0.05)
    ndc = device_coordinates(camera, points)
    assert np.abs(ndc[:, :2]).max() <= 0.9 + 1e-6 and np.abs(ndc[:, 2]).max() < 1
    # As large as possible: the points touch both margins in one direction, unless the eye would
    # then be among the points.
    low, high = ndc[:, :2].min(axis=0), ndc[:, :2].max(axis=0)
    touched = (np.isclose(low, -0.9, atol=1e-6) & np.isclose(high, 0.9, atol=1e-6)).any()
    assert touched or camera.depths(points).min() < 2e-3 * np.ptp(points, axis=0).max()


def test_framing_ignores_loose_vertices():
    ball = icosphere(2)
    loose = ball.with_parts(vertices=np.concatenate([ball.vertices, [[100.0, 0, 0]]]))
    points = [MeshInstance(each, np.eye(4)).face_points() for each in (ball, loose)]
    first, second = (orbit_camera(each, 10, 20, 50, 50) for each in points)
    assert (first.view == second.view).all()


@pytest.mark.parametrize("perspective", [True, False])
def test_a_single_point_can_be_framed(perspective):
    camera = orbit_camera(np.zeros((1, 3)), 0, 0, 10, 10, perspective=perspective)
    np.testing.assert_allclose(device_coordinates(camera, np.zeros((1, 3)))[0, :2], 0, atol=1e-9)


def test_blenders_default_lens():
    """50 mm on 36 mm at 1920 x 1080; expected values are from Blender's calc_matrix_camera."""
    camera = perspective_camera(np.eye(4), 1920, 1080, clip=(0.1, 100))
    expected = [[2.7777777, 0, 0, 0], [0, 4.9382715, 0, 0]]
    expected += [[0, 0, -1.0020020, -0.2002002], [0, 0, -1, 0]]
    np.testing.assert_allclose(camera.projection, expected, atol=1e-6)
    by_angle = perspective_camera(np.eye(4), 1920, 1080, fov=2 * np.arctan(0.36), clip=(0.1, 100))
    np.testing.assert_allclose(by_angle.projection, expected, atol=1e-6)


def test_orthographic_scale_spans_the_longer_side():
    for width, height in ((200, 100), (100, 200)):
        camera = orthographic_camera(np.eye(4), width, height, scale=6.0)
        assert camera.pixels_per_unit == pytest.approx(200 / 6)
        x, y = pixel_rays(camera, np.array([0, width * height - 1]))
        assert np.ptp(x) == pytest.approx(6 * (width - 1) / 200)
        assert np.ptp(y) == pytest.approx(6 * (height - 1) / 200)


@pytest.mark.parametrize("make", [perspective_camera, orthographic_camera])
def test_pixel_rays_go_through_pixel_centers(make):
    camera = shifted(make(np.eye(4), 31, 17), (0.2, -0.3))
    pixel = np.arange(31 * 17)
    x, y = pixel_rays(camera, pixel)
    depth = 3.0 if camera.is_perspective else 1.0
    points = np.stack([depth * x, depth * y, np.full(x.shape, -3.0)], axis=1)
    ndc = device_coordinates(camera, points)
    np.testing.assert_allclose((ndc[:, 0] + 1) * 15.5, pixel % 31 + 0.5)
    np.testing.assert_allclose((ndc[:, 1] + 1) * 8.5, pixel // 31 + 0.5)


def test_the_scale_of_a_projection_does_not_matter():
    plain = perspective_camera(np.eye(4), 20, 20)
    scaled = Camera(np.eye(4), 7 * plain.projection, 20, 20)
    np.testing.assert_allclose(scaled.projection, plain.projection)


def test_look_at():
    view = look_at((3, 4, 5), (1, 1, 1))
    np.testing.assert_allclose(view @ (1, 1, 1, 1), (0, 0, -np.sqrt(29), 1), atol=1e-12)
    above = view @ (1, 1, 2, 1)
    assert abs(above[0]) < 1e-12 and above[1] > 0


GOOD = perspective_camera(np.eye(4), 10, 10)


def make_camera(view=GOOD.view, projection=GOOD.projection, size=(10, 10)):
    return Camera(view, projection, *size, "Cam")


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"view": np.diag([-1.0, 1, 1, 1])}, "'Cam' is mirrored"),
        ({"view": np.diag([2.0, 2, 2, 1])}, "'Cam': its view matrix must be a rotation"),
        ({"view": np.full((4, 4), np.nan)}, "'Cam': its view matrix is not finite"),
        ({"view": np.eye(3)}, "'Cam': its view matrix must have the shape (4, 4)"),
        ({"projection": np.full((4, 4), np.inf)}, "'Cam': its projection matrix is not finite"),
        ({"projection": np.diag([1.0, 1, 1, 0])}, "'Cam' is neither perspective nor orthographic"),
        ({"projection": np.diag([-1.0, 1, 1, 1])}, "'Cam': its projection is mirrored or flat"),
        ({"size": (0, 10)}, "size 0x10"),
        ({"size": (10.5, 10)}, "size 10.5x10"),
    ],
)
def test_impossible_cameras_are_refused(settings, message, error_of):
    assert message in error_of(make_camera, **settings)


@pytest.mark.parametrize(
    "make",
    [
        lambda: perspective_camera(np.eye(4), 9, 9, fov=4.0),
        lambda: perspective_camera(np.eye(4), 9, 9, clip=(0.0, 5.0)),
        lambda: perspective_camera(np.eye(4), 9, 9, clip=(5.0, 1.0)),
        lambda: orthographic_camera(np.eye(4), 9, 9, scale=0.0),
        lambda: orthographic_camera(np.eye(4), 9, 9, clip=(2.0, 2.0)),
        lambda: orbit_camera(np.zeros((3, 3)), np.nan, 0, 9, 9),
        lambda: orbit_camera(np.empty((0, 3)), 0, 0, 9, 9),
        lambda: look_at((1, 1, 1), (1, 1, 1)),
        lambda: look_at((1, 1, 9), (1, 1, 1)),
    ],
)
def test_impossible_views_are_refused(make, error_of):
    error_of(make)
