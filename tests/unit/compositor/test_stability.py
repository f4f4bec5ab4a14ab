"""Streaks that stay on a surface which moves, and the noise that is fixed to it."""

from dataclasses import replace

import numpy as np
import pytest
from hatched import (
    INK,
    SIZE,
    camera_before_wall,
    make_camera,
    make_instance,
    make_wall,
    render,
    tube,
)
from scipy.ndimage import map_coordinates
from shapes import placed, rebuilt

from rosy_addon.compositor.image_noise import NoiseSettings
from rosy_addon.compositor.surface_noise import instance_hashes, surface_noise
from rosy_addon.core.color import to_display
from rosy_addon.projection.project import project
from rosy_addon.projection.rest_coordinates import rest_coordinates

#: These tests draw many pictures and measure them.
pytestmark = pytest.mark.slow


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
    column, row = nearest_pixel[visible].T
    visible[visible] = np.abs(depth[row, column] - clip[visible, 3]) < 0.01
    assert visible.mean() > 0.5
    tone, other_tone = (to_display(picture[..., 0]) for picture in (first, second))
    warped = map_coordinates(other_tone, position[visible, ::-1].T, order=3, mode="nearest")
    return np.corrcoef(tone.reshape(-1)[gbuffer.pixel[visible]], warped)[0, 1]


def pair(other_bend=0.0, bend=0.0, zoom=1.0):
    """Two instances of a tube, and a camera for each."""
    instances = make_instance(tube(bend)), make_instance(tube(other_bend))
    return instances[0], make_camera(), instances[1], make_camera(zoom=zoom)


#: The light is even, because shading does not move with the surface.
STEADY = replace(INK, shading=0.0, tone_levels=(0.0, 1 / 0.65, 1.0), gain=1.2, crispness=0.5)
MOVED = {
    "hatch": (STEADY, {"zoom": 1.1}),
    "uneven": (replace(STEADY, wobble=1.0, breaks=0.3), {"other_bend": 0.05}),
    # At distances in pixels, a zoom needs other lines.
    "even": (
        replace(STEADY, ink="even", unit="scene", unit_size=0.006),
        {"other_bend": 0.81, "bend": 0.8},
    ),
}


@pytest.mark.parametrize(("look", "motion"), MOVED.values(), ids=MOVED)
def test_streaks_stay_on_the_surface(look, motion):
    assert warped_correlation(*pair(**motion), look) >= 0.9
    if "zoom" in motion:
        on_screen = replace(look, anchor="picture")
        assert warped_correlation(*pair(**motion), on_screen) < 0.5


def line_width(picture):
    """The lag in pixels at which the autocorrelation across horizontal lines is 1/2."""
    spectrum = np.abs(np.fft.fft(picture - picture.mean(), axis=0)) ** 2
    correlation = np.fft.ifft(spectrum.mean(axis=1)).real
    correlation /= correlation[0]
    below = int(np.argmax(correlation < 0.5))
    above, under = correlation[below - 1], correlation[below]
    return below - 1 + (above - 0.5) / (above - under)


@pytest.mark.parametrize(
    ("unit", "zooms"), [("pixels", [1, 1.23, 1.62, 6.7]), ("scene", [1.62, 2.8, 6.7])]
)
def test_widths_of_lines_through_a_zoom(unit, zooms):
    """They are constant in pixels, or proportional to the zoom; in between, lines of two widths mix."""
    look = replace(
        INK,
        shading=0.0,
        tone_levels=(0.0, 1 / 0.6, 1.0),
        unit=unit,
        unit_size=8 / 384,
        supersampling=1,
    )
    widths = []
    for zoom in zooms:
        camera = camera_before_wall(8 / zoom, 0.3, 0.2).resized(384, 384)
        rgba = render(make_wall(), camera, look)
        widths.append(line_width(rgba[..., 0]) / (zoom if unit == "scene" else 1))
    assert max(widths) / min(widths) < 1.15


# --- noise on the surface ------------------------------------------------------------------------


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
    noise = surface_noise(gbuffer, NoiseSettings(2.0, 0, 3, 0.3, high_pass))
    assert np.abs(noise.mean(axis=0) - 0.5).max() < 0.02 and 0.3 < noise.std() < 0.5
    channels = np.corrcoef(noise.T)
    assert np.abs(channels[np.triu_indices(3, 1)]).max() < 0.03


@pytest.mark.parametrize("offset", [2.0**22, 2.0**30])
def test_noise_of_a_mesh_far_from_its_origin_is_as_fine(offset):
    surface = tube()
    points = np.round(surface.vertices * 2**16) / 2**16  # exact after the offset, in float64
    camera, noises = make_camera(distance=4), []
    for moved_by in (0.0, offset):
        far = rebuilt(surface, points + moved_by)
        gbuffer = project([make_instance(far, matrix=placed(shift=-moved_by))], camera)
        noises.append(surface_noise(gbuffer, NoiseSettings(2.0, 0, density=0.3)))
    assert np.corrcoef(noises[0].T, noises[1].T)[0, 1] > 0.99


def test_instances_have_different_noise():
    names = ["a", "b", "a", "a", "c"]
    assert len(set(instance_hashes(names).tolist())) == 5
    # Another instance does not change the hashes of the others.
    assert instance_hashes(["z", *names])[1:].tolist() == instance_hashes(names).tolist()
    # A mesh file looks the same in every folder.
    assert instance_hashes(["some/ball.obj"]) == instance_hashes(["C:\\other\\ball.obj"])
    assert instance_hashes(["bytes\udcff.obj"]) != instance_hashes(["bytes\udcfe.obj"])
