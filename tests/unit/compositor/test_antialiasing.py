"""Pictures that are shaded once per pixel, against pictures that are shaded at many samples."""

from dataclasses import replace

import numpy as np
import pytest
from harness.streaks import correlation
from shapes import icosphere, instance_of, torus

from rosy_addon.compositor import outline
from rosy_addon.compositor.compose import compose
from rosy_addon.compositor.look import Look
from rosy_addon.compositor.look_units import pixel_look
from rosy_addon.compositor.outline import outline_coverage
from rosy_addon.preset_files.store import load_preset
from rosy_addon.projection.camera import look_at, perspective_camera
from rosy_addon.projection.project import project
from rosy_addon.rendering.draw import draw_picture
from rosy_addon.rendering.view_input import ViewInput

SIZE = 160
CAMERA = perspective_camera(look_at((0.3, -3.2, 1.4), (0, 0, 0)), SIZE, SIZE, fov=0.8)

#: Looks by their names and the degrees of the fields.
LOOKS = {
    ("default", 4): Look(),
    ("on the surface", 3): Look(fade="ends", anchor="surface", line_width=2.5),
    ("cross-hatch", 4): load_preset("cross-hatch").look,
    ("engraving", 4): load_preset("engraving").look,
}


def rendered(instance, look):
    return draw_picture(ViewInput((instance,), CAMERA, look)).rgba


def sampled(instance, look, samples):
    """The picture with streaks at every sample."""
    gbuffer = project([instance], CAMERA.scaled(samples), look.display)
    return compose(gbuffer, replace(look, supersampling=samples)).rgba


def luminance(rgba, where):
    return rgba[..., :3].mean(axis=-1)[where]


@pytest.mark.slow
@pytest.mark.parametrize(("name", "degree"), LOOKS)
def test_streaks_are_those_of_many_samples(name, degree):
    """Nearer to them than without samples, of the same tone and contrast, and with the same silhouettes."""
    instance, look = instance_of(torus(), degree, "form"), LOOKS[name, degree]
    actual, single = (rendered(instance, replace(look, supersampling=s)) for s in (2, 1))
    expected = sampled(instance, look, 3)
    inside = (actual[..., 3] == 1) & (single[..., 3] == 1) & (expected[..., 3] == 1)
    target, value, other = (luminance(rgba, inside) for rgba in (expected, actual, single))
    assert correlation(value, target) > correlation(other, target)
    assert value.mean() == pytest.approx(target.mean(), abs=0.01)
    assert value.std() == pytest.approx(target.std(), rel=0.1)
    np.testing.assert_allclose(actual[..., 3], sampled(instance, look, 2)[..., 3], atol=1e-6)


@pytest.mark.parametrize(("width", "max_samples"), [(1.0, 1 << 20), (2.6, 1 << 11)])
def test_outlines_are_those_of_samples(width, max_samples, monkeypatch):
    monkeypatch.setattr(outline, "MAX_OUTLINE_SAMPLES", max_samples)
    instance, look = instance_of(torus(), 4, "form"), Look(outline=width)
    pixels, samples = project([instance], CAMERA, samples=2), project([instance], CAMERA.scaled(2))
    coverage = outline_coverage(pixels, pixel_look(look, is_antialiased=True))
    actual = np.zeros(SIZE * SIZE)
    actual[pixels.pixel] = coverage * pixels.coverage.own
    shown = coverage[pixels.coverage.entry] * pixels.coverage.share
    np.add.at(actual, pixels.coverage.pixel, shown)
    sample_look = pixel_look(look).in_samples(2)
    expected = np.zeros(4 * SIZE * SIZE)
    expected[samples.pixel] = outline_coverage(samples, sample_look)
    expected = expected.reshape(SIZE, 2, SIZE, 2).mean(axis=(1, 3)).ravel()
    assert np.abs(actual - expected).sum() < 0.01 * expected.sum()


@pytest.mark.slow
def test_light_changes_within_a_pixel_at_a_crease():
    """Where two faces meet, a pixel has a color between those of the faces, as with many samples."""
    instance = instance_of(icosphere(0), 4, "axis")
    look = Look(display="flat", gain=0.0, shading=1.0)
    actual, single = (rendered(instance, replace(look, supersampling=s)) for s in (4, 1))
    expected = sampled(instance, look, 4)
    inside = (single[..., 3] == 1) & (expected[..., 3] == 1)
    exact = luminance(expected, inside)
    error, single_error = (np.abs(luminance(each, inside) - exact) for each in (actual, single))
    assert error.mean() < single_error.mean()
