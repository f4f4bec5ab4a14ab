"""The rotation of a smoothest field depends on the shape: mirror images, symmetries, borders, curvature."""

from __future__ import annotations

import numpy as np
import pytest
from field_helpers import angle_differences, bumpy, symmetric_head
from scipy.spatial.distance import cdist
from shapes import cylinder, from_triangles, icosphere, plane

from rosy_addon.field.smoothest import smoothest_field

BALL = bumpy(icosphere(3))
MIRROR = np.diag([-1.0, 1.0, 1.0])


@pytest.mark.parametrize("degree", range(1, 7))
def test_the_mirror_image_has_the_mirrored_field(degree):
    image = from_triangles(BALL.vertices @ MIRROR, BALL.corner_vertex.reshape(-1, 3)[:, ::-1])
    expected = smoothest_field(BALL, degree).vectors
    actual = smoothest_field(image, degree).vectors @ MIRROR
    assert np.degrees(angle_differences(BALL, actual, expected, degree).max()) < 0.1


@pytest.mark.parametrize("degree", range(1, 7))
def test_a_mirror_symmetric_surface_has_a_symmetric_field(degree):
    surface = symmetric_head()
    vectors = smoothest_field(surface, degree).vectors
    distance = cdist(surface.face_center, surface.face_center @ MIRROR)
    image = distance.argmin(axis=1)
    assert distance.min(axis=1).max() < 1e-9
    turned = angle_differences(surface, vectors[image] @ MIRROR, vectors, degree)
    assert np.degrees(turned.max()) < 0.1


@pytest.mark.parametrize("degree", [1, 2, 4])
def test_borders_and_curvature_decide(degree):
    square = smoothest_field(plane(5), degree).vectors
    if degree == 4:
        assert np.abs(square).max(axis=1) == pytest.approx(1)
    around = smoothest_field(cylinder(24, 6), degree).vectors
    if degree % 2 == 0:
        assert np.minimum(np.abs(around[:, 2]), 1 - np.abs(around[:, 2])).max() < 1e-6
