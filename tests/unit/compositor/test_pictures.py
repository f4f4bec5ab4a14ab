"""Pictures of surfaces, composed from a G-buffer."""

import numpy as np
import pytest
from field_helpers import with_random_members
from harness.planar import degree_layers
from harness.streaks import correlation, orientation_spectrum, peaks
from planar_fields import PLAIN, plain
from shapes import icosphere, moved, plane, torus

from rosy_addon.compositor.compose import compose
from rosy_addon.compositor.look import Look
from rosy_addon.compositor.shading import Light, diffuse, metered
from rosy_addon.core.color import map_colors, to_display, to_linear
from rosy_addon.field.directional_field import field_from_directions, tensor_field
from rosy_addon.field.frames import normalize
from rosy_addon.field.generate import axis_field
from rosy_addon.field.rosy_field import RosyField
from rosy_addon.projection.camera import look_at, orthographic_camera, perspective_camera
from rosy_addon.projection.gbuffer import MeshInstance
from rosy_addon.projection.project import project

#: These tests draw many pictures and measure them.
pytestmark = pytest.mark.slow


def project_surface(surface, field, size=256, eye=(0, 0, 4), scale=2.4, up=(0, 1, 0)):
    """A G-buffer of one surface under an orthographic camera."""
    camera = orthographic_camera(look_at(eye, (0, 0, 0), up), size, size, scale=scale)
    return project([MeshInstance(surface, np.eye(4), field)], camera)


def test_decomposition_agrees_with_brute_force_on_a_sphere():
    sphere = icosphere(5)
    gbuffer = project_surface(sphere, axis_field(sphere, 4, (0.3, 0.9, 0.1)), 384)
    looks = [plain(method=method) for method in ("members", "brute")]
    members, brute = (degree_layers(gbuffer, look)[0].tone for look in looks)
    assert correlation(members, brute) > 0.98


@pytest.mark.parametrize("method", ["members", "sheets", "brute", "ibfv"])
@pytest.mark.parametrize("degree", [1, 4, 7])
def test_pictures_do_not_depend_on_the_stored_member(degree, method):
    surface, look = torus(48, 24), plain(method=method)
    field = axis_field(surface, degree, (0.2, 0.3, 1.0))
    fields = field, with_random_members(surface, field, 1)
    gbuffers = (project_surface(surface, each, 96, (2, 1, 4), 3.2) for each in fields)
    (first,), (second,) = (degree_layers(gbuffer, look) for gbuffer in gbuffers)
    assert np.mean(np.abs(first.tone - second.tone) > 1e-5) < 0.005


def test_two_degrees_in_one_picture():
    left, right = torus(32, 16, 0.5, 0.2), icosphere(3, 0.5)
    camera = orthographic_camera(look_at((0.6, 0, 4), (0.6, 0, 0), (0, 1, 0)), 200, 150, scale=3.0)
    instances = [
        MeshInstance(left, np.eye(4), axis_field(left, 4)),
        MeshInstance(right, moved(x=1.2), axis_field(right, 3, (0, 1, 0))),
    ]
    gbuffer = project(instances, camera)
    picture, layers = compose(gbuffer, PLAIN), degree_layers(gbuffer, PLAIN)
    assert [layer.degree for layer in layers] == [3, 4]
    assert sum(len(layer.pixel) for layer in layers) == np.count_nonzero(picture.rgba[..., 3])


def test_streaks_of_a_tilted_plane_follow_the_projected_direction():
    surface = plane(2, 2, 4.0)
    direction = np.array([0.6, 0.8, 0.0])
    field = RosyField(1, np.tile(direction, (surface.face_count, 1)))
    eye = (0, -4 * np.sin(np.pi / 3), 4 * np.cos(np.pi / 3))
    gbuffer = project_surface(surface, field, 256, eye, 1.6, (0, 0, 1))
    tone = np.zeros(256 * 256)
    tone[gbuffer.pixel] = degree_layers(gbuffer, PLAIN)[0].tone[:, 0] - 0.5
    on_screen = gbuffer.camera.view[:2, :3] @ direction
    expected = np.degrees(np.arctan2(on_screen[1], on_screen[0]))
    spectrum = orientation_spectrum(tone.reshape(256, 256))
    np.testing.assert_allclose(peaks(spectrum), [expected % 180], atol=1.5)


def test_breaking_points_are_visible_on_a_tilted_surface_without_the_view_plane():
    """Figures 7 and 8 of the paper, measured against brute force."""
    surface = plane(128, 128, 4.0)
    angle = 1.5 * surface.face_center[:, 0] + 0.8 * surface.face_center[:, 1]
    field = RosyField(4, np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1))
    tilt = np.radians(65)
    eye = (0, -4 * np.sin(tilt), 4 * np.cos(tilt))
    gbuffer = project_surface(surface, field, 300, eye, 1.5, (0, 0, 1))
    brute = degree_layers(gbuffer, plain(method="brute"))[0].tone
    looks = [plain(method="members", view_plane=on) for on in (True, False)]
    with_it, without = (degree_layers(gbuffer, look)[0].tone for look in looks)
    assert correlation(with_it, brute) > correlation(without, brute)


def test_headlight_is_lamberts_law():
    sphere = icosphere(5)
    gbuffer = project_surface(sphere, axis_field(sphere, 1))
    full = diffuse(gbuffer, plain(shading=1.0))
    radius = np.hypot(*(gbuffer.position[:, :2].T))
    inner = radius < 0.9
    assert np.allclose(full[inner, 0], np.sqrt(1 - radius[inner] ** 2), atol=0.01)
    assert np.allclose(diffuse(gbuffer, plain(shading=0.25)), 0.75 + 0.25 * full, atol=1e-6)


def test_lights_of_the_scene():
    surface = plane(2, 2)
    camera = perspective_camera(look_at((0, 0, 3), (0, 0, 0), (0, 1, 0)), 64, 64)
    gbuffer = project([MeshInstance(surface, np.eye(4), axis_field(surface, 1, (1, 0, 0)))], camera)
    look = plain(shading=1.0, light="scene")
    sun = Light("sun", normalize(np.array([0.0, 1.0, 1.0])), np.ones(3), 2.0)
    assert np.allclose(diffuse(gbuffer, look, [sun]), np.sqrt(2), atol=1e-5)
    # A point light two units above the center of the plane: 1 / r^2 and the cosine.
    lamp = Light("point", np.array([0.0, 0.0, -1.0]), np.array([1.0, 0.5, 0.0]), 4.0)
    lighting = diffuse(gbuffer, look, [lamp])
    across = np.hypot(gbuffer.position[:, 0], gbuffer.position[:, 1])
    expected = 4 / (4 + across**2) * 2 / np.sqrt(4 + across**2)
    assert np.allclose(lighting[:, 0], expected, atol=1e-4)
    assert np.allclose(lighting[:, 1], expected / 2, atol=1e-4)
    # Without lights, soft streaks have the headlight, and ink the lamp.
    for ink, light in (("soft", "headlight"), ("even", "lamp")):
        looks = (plain(shading=1.0, light=each, ink=ink) for each in ("scene", light))
        np.testing.assert_array_equal(*(diffuse(gbuffer, look) for look in looks))


def test_metered_lights_make_the_brightest_tenth_white():
    """On a ball in the light of a sun, the irradiance of the lit half is uniformly distributed."""
    ball = icosphere(4)
    instances = [MeshInstance(ball, np.eye(4), axis_field(ball, 1))]
    above = np.array([0.0, 0.0, 1.0])
    suns = [Light("sun", above, np.full(3, 0.5), power) for power in (0.1, 400.0)]
    for lights in (suns[:1], suns[1:], suns):
        strength = sum(light.strength * 0.5 for light in metered(lights, instances))
        np.testing.assert_allclose(strength * 0.9, 1.0, atol=0.01)
    ratio = metered(suns, instances, 1.0)[1].strength / metered(suns, instances)[1].strength
    np.testing.assert_allclose(ratio, 2.0)
    black = Light("sun", above, np.zeros(3), 1.0)
    assert metered([black], instances) == (black,) and metered([], instances) == ()


@pytest.mark.parametrize("ends", [(0.0, 1.0), (0.25, 0.75), (1.0, 0.0)], ids=str)
def test_magnitude_is_colored(ends):
    surface = plane(32, 2)
    rho = (surface.face_center[:, :1] + 1) / 2
    gbuffer = project_surface(surface, RosyField(1, rho * [1.0, 0, 0]), 128)
    picture = compose(gbuffer, plain(hue="magnitude", color_range=ends, gain=0.0))
    x = gbuffer.position[:, 0]
    actual = to_display(picture.rgba.reshape(-1, 4)[gbuffer.pixel, :3])
    expected = map_colors(((x + 1) / 2 - ends[0]) / (ends[1] - ends[0]), "viridis")
    inner = np.abs(x) < 0.9
    assert np.abs(actual - expected)[inner].max() < 0.03


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize(
    "ends", [(0.0, 0.0), (0.0, 5e-324), (0.0, 1e30), (7.0, 7.0), (1e30, -1e30)]
)
def test_magnitudes_of_any_scale(ends):
    surface = plane(4, 4)
    rho = 10.0 ** np.linspace(-29, 29, surface.face_count)[:, None]
    gbuffer = project_surface(surface, RosyField(4, rho * [1.0, 0, 0]), 16)
    look = plain(hue="magnitude", magnitude_length=True, color_range=ends, supersampling=1)
    assert np.isfinite(compose(gbuffer, look).rgba).all()


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("degree", [1, 4])
def test_lines_do_not_depend_on_the_scale_of_magnitudes(degree):
    surface = plane(4, 4)
    rho = 10.0 ** np.linspace(-29, 29, surface.face_count)[:, None]
    look = plain(display="flat", supersampling=1)
    fields = (RosyField(degree, length * [1.0, 0, 0]) for length in (rho, np.ones_like(rho)))
    gbuffers = (project_surface(surface, field, 32) for field in fields)
    pictures = (compose(gbuffer, look).rgba for gbuffer in gbuffers)
    np.testing.assert_allclose(*pictures, atol=1e-5)


def test_display_curve_is_its_own_inverse():
    values = np.linspace(0, 1, 1001, dtype=np.float32)
    assert np.allclose(to_display(to_linear(values)), values, atol=1e-5)
    assert to_linear(np.array([0.5]))[0] == pytest.approx(0.21404, abs=1e-5)


# --- free directions ------------------------------------------------------------------------------


@pytest.mark.parametrize("method", ["sheets", "members", "brute", "ibfv"])
@pytest.mark.parametrize(
    "angles",
    [(20, 70, 200, 250), (10, 55, 130), (0, 40, 100, 150), (15, 195)],
    ids=["paired", "three", "four", "line"],
)
def test_streaks_run_along_free_directions(method, angles):
    surface = plane(7, 7, 2.2)
    radians = np.radians(angles)
    directions = np.stack([np.cos(radians), np.sin(radians), 0 * radians], axis=1)
    orders = [np.roll(directions, row, axis=0) for row in range(surface.face_count)]
    field = field_from_directions(surface, np.stack(orders))
    gbuffer = project_surface(surface, field, scale=2.0)
    (layer,) = degree_layers(gbuffer, plain(method=method, length=30))
    tone = layer.tone.reshape(256, 256)[32:-32, 32:-32]
    # From -5 to 175 degrees: no direction is near the ends.
    actual = np.sort((np.array(peaks(orientation_spectrum(tone))) + 5) % 180 - 5)
    expected = np.unique(np.mod(angles, 180))
    assert len(actual) == len(expected) and np.abs(actual - expected).max() < 2


def test_hues_of_families_tell_their_directions():
    """The major direction runs along x: its streaks are orange, and those along y blue."""
    surface = plane(7, 7, 2.2)
    field = tensor_field(surface, np.tile(np.diag([3.0, -1.0, 0.0]), (surface.face_count, 1, 1)))
    gbuffer = project_surface(surface, field, scale=2.0)
    colored = compose(gbuffer, Look(shading=0.0, length=30, hue="families")).rgba
    orange_minus_blue = (colored[..., 0] - colored[..., 2]).astype(float)
    for sign, expected in ((1, 0), (-1, 90)):
        image = np.clip(sign * orange_minus_blue, 0, None)
        actual = np.array(peaks(orientation_spectrum(image - image.mean()), 4.0))
        assert np.abs((actual - expected + 90) % 180 - 90).max() < 3


def test_a_single_family_is_gray():
    surface = plane(7, 7, 2.2)
    field = RosyField(4, np.tile((1.0, 0, 0), (surface.face_count, 1)))
    gbuffer = project_surface(surface, field, 64, scale=2.0)
    colored = compose(gbuffer, plain(hue="families")).rgba
    assert np.array_equal(colored, compose(gbuffer, PLAIN).rgba)
