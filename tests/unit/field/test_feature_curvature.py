"""Curvature of features: closed forms, scales, noise, sharp edges and awkward meshes."""

import numpy as np
import pytest
from awkward import AWKWARD
from field_helpers import awkward_surface
from shapes import cube, cylinder, icosphere, plane, rebuilt, torus

from rosy_addon.field.feature_curvature import feature_curvature


@pytest.mark.parametrize("scale", [1e-6, 1.0, 1e6])
def test_spheres(scale):
    ball = icosphere(4)
    curvature = feature_curvature(rebuilt(ball, scale * ball.vertices))
    assert curvature.shape == (len(ball.triangles), 3) and curvature.dtype == np.float32
    np.testing.assert_allclose(curvature, 1 / scale, rtol=0.02)


def test_the_larger_curvature_of_a_torus():
    ring = torus(96, 48)
    small_radius = np.ptp(ring.vertices[:, 2]) / 2
    np.testing.assert_allclose(feature_curvature(ring), 1 / small_radius, rtol=0.05)


@pytest.mark.parametrize("make", [cube, plane, lambda: cylinder(64)])
def test_sharp_edges_have_none(make):
    surface = make()
    round_curvature = 1 / np.linalg.norm(surface.vertices[:, :2], axis=1).max()
    assert feature_curvature(surface).max() <= 1.05 * round_curvature


def test_a_deformation_changes_nothing():
    ball = icosphere(3)
    bent = rebuilt(ball, ball.vertices * (1, 1, 3), rest_vertices=ball.vertices)
    np.testing.assert_array_equal(feature_curvature(bent), feature_curvature(ball))


@pytest.mark.parametrize("name", AWKWARD)
def test_awkward_meshes(name):
    surface = awkward_surface(name)
    curvature = feature_curvature(surface)
    assert curvature.shape == (len(surface.triangles), 3)
    assert np.isfinite(curvature).all() and (curvature >= 0).all()
