"""Shares of pixels, against the surfaces that a frame of all samples shows."""

import numpy as np
import pytest
from shapes import cube, icosphere, placed, rebuilt, torus

from rosy_addon.field.generate import axis_field
from rosy_addon.projection.camera import look_at, orthographic_camera, perspective_camera
from rosy_addon.projection.gbuffer import MeshInstance
from rosy_addon.projection.project import project

pytestmark = pytest.mark.filterwarnings("error")

SIZE = 60
CUBE = rebuilt(cube(), 2 * cube().vertices - 1)


def instance(surface, scale=1.0, shift=(0, 0, 0), has_field=True):
    field = axis_field(surface, 4, (0.2, 0.3, 1)) if has_field else None
    return MeshInstance(surface, placed(scale, shift), field)


SCENES = {
    "dense sphere": [instance(icosphere(5))],
    "cube": [instance(CUBE)],
    "torus behind a sphere": [instance(torus(60, 30)), instance(icosphere(3), 0.4, (0, -1.5, 0))],
    "behind an occluder": [instance(icosphere(3)), instance(CUBE, 0.3, (0.6, -2, 0.2), False)],
    "specks": [instance(icosphere(1), 0.02, (0.013 * k, -k / 2, 0.1 * k)) for k in range(4)],
}
VIEW = look_at((0.8, -4, 1.1), (0, 0, 0))
CAMERAS = {
    "perspective": perspective_camera(VIEW, SIZE, SIZE - 7, fov=0.8),
    "orthographic": orthographic_camera(VIEW, SIZE, SIZE - 7, scale=3),
}


def shares(gbuffer, keys):
    """The share of each pixel by key of its entries: an array for each key."""
    frame = gbuffer.camera.width * gbuffer.camera.height
    coverage = gbuffer.coverage
    return [
        np.bincount(gbuffer.pixel, coverage.own * (key == keys), frame)
        + np.bincount(coverage.pixel, coverage.share * (key == keys)[coverage.entry], frame)
        for key in np.unique(keys)
    ]


def sampled_shares(fine, keys, camera, samples):
    """The same from a G-buffer of the frame of all samples."""
    row, column = np.divmod(fine.pixel, camera.width * samples)
    pixel = row // samples * camera.width + column // samples
    frame = camera.width * camera.height
    return [np.bincount(pixel, key == keys, frame) / samples**2 for key in np.unique(keys)]


@pytest.mark.parametrize("samples", [2, 3])
@pytest.mark.parametrize("view", CAMERAS)
@pytest.mark.parametrize("name", SCENES)
def test_shares_of_pixels_are_those_of_their_samples(name, view, samples):
    instances, camera = SCENES[name], CAMERAS[view]
    gbuffer = project(instances, camera, samples=samples)
    fine = project(instances, camera.scaled(samples))
    covered = sum(shares(gbuffer, np.zeros(len(gbuffer.pixel))))
    expected = sum(sampled_shares(fine, np.zeros(len(fine.pixel)), camera, samples))
    np.testing.assert_allclose(covered, expected, atol=1e-6)
    assert (np.diff(gbuffer.pixel) > 0).all() and (np.diff(gbuffer.coverage.pixel) >= 0).all()
    if name == "specks":
        return  # parts that are thinner than a sample are shown by what is beside them
    actual = np.array(shares(gbuffer, gbuffer.instance_id))
    expected = np.array(sampled_shares(fine, fine.instance_id, camera, samples))
    assert np.abs(actual - expected).sum() <= 0.002 * expected.sum()


@pytest.mark.parametrize("view", CAMERAS)
def test_the_sides_of_a_crease_have_their_shares(view):
    """Pixels at an edge of a cube show both faces, as much as their samples do."""
    camera = CAMERAS[view]
    gbuffer = project([instance(CUBE)], camera, samples=4)
    fine = project([instance(CUBE)], camera.scaled(4))
    actual = np.array(shares(gbuffer, CUBE.triangle_face[gbuffer.triangle]))
    expected = np.array(sampled_shares(fine, CUBE.triangle_face[fine.triangle], camera, 4))
    mixed = (expected > 0).sum(axis=0) > 1
    assert mixed.sum() > 30 and np.abs(actual - expected)[:, mixed].mean() < 0.02
    alone = np.bincount(gbuffer.pixel, minlength=actual.shape[1])[mixed]
    assert alone.max() == 1  # the other face is that of a pixel beside it


def test_entries_are_those_of_pixel_centers():
    camera, instances = CAMERAS["perspective"], SCENES["torus behind a sphere"]
    gbuffer, single = project(instances, camera, samples=2), project(instances, camera)
    entry = np.searchsorted(gbuffer.pixel, single.pixel)
    for name in ("pixel", "instance_id", "triangle", "barycentric", "position", "representation"):
        np.testing.assert_array_equal(getattr(gbuffer, name)[entry], getattr(single, name))
    assert single.coverage is None
    assert 0 < len(gbuffer.pixel) - len(single.pixel) < 0.1 * len(single.pixel)


@pytest.mark.parametrize("scene", SCENES)
def test_values_do_not_reach_beyond_triangles(scene):
    """Also where a pixel sees a triangle that its center is outside of."""
    gbuffer = project(SCENES[scene], CAMERAS["perspective"], samples=3)
    np.testing.assert_allclose(gbuffer.barycentric.sum(axis=1), 1, atol=2e-4)
    assert gbuffer.barycentric.min() >= 0
    largest = max(part.field.magnitude.max() for part in SCENES[scene] if part.field is not None)
    assert np.abs(gbuffer.representation).max() <= largest * (1 + 3e-4)
