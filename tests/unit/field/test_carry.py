"""Vectors of faces that are carried along when their mesh moves."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from shapes import from_triangles, icosphere, plane, torus

from rosy_addon.field.carry import carried_vectors
from rosy_addon.field.frames import dot
from rosy_addon.field.generate import axis_field


def vectors_of(surface):
    return axis_field(surface, 4, (0.3, -0.2, 1.0)).vectors


@pytest.mark.parametrize("surface", [icosphere(2), torus(), plane(4, 3)])
@pytest.mark.parametrize("seed", range(2))
def test_rotations_translations_and_scales_are_followed(surface, seed):
    random = np.random.default_rng(seed)
    rotation = Rotation.random(random_state=seed)
    vectors = vectors_of(surface) * random.uniform(0.1, 3, (surface.face_count, 1))
    moved = rotation.apply(surface.vertices) * random.uniform(0.1, 9) + random.normal(size=3)
    actual = carried_vectors(surface.with_parts(vertices=moved), surface.vertices, vectors)
    np.testing.assert_allclose(actual, rotation.apply(vectors), atol=1e-9)
    several = np.stack([vectors, -vectors], axis=1)
    again = carried_vectors(surface.with_parts(vertices=moved), surface.vertices, several)
    np.testing.assert_allclose(again[:, 1], -actual, atol=1e-12)


def test_a_mirrored_half_has_the_mirror_image():
    """A mirror reverses the order of corners, as Blender's modifier does."""
    surface = icosphere(2)
    vectors = vectors_of(surface)
    triangles = surface.corner_vertex.reshape(-1, 3)[:, ::-1]
    mirrored = from_triangles(surface.vertices * (-1, 1, 1), triangles)
    actual = carried_vectors(mirrored, surface.vertices, vectors)
    np.testing.assert_allclose(actual, vectors * (-1, 1, 1), atol=1e-9)


def test_a_shear_rotates_less_than_its_edges():
    """Directions stay between those of the edges that the shear turns and of those that it keeps."""
    surface = plane(3, 3)
    sheared = surface.vertices + 0.5 * surface.vertices[:, [1]] * (1, 0, 0)
    vectors = np.tile((0.0, 1.0, 0.0), (surface.face_count, 1))
    actual = carried_vectors(surface.with_parts(vertices=sheared), surface.vertices, vectors)
    turned = np.degrees(np.arctan2(actual[:, 0], actual[:, 1]))
    # The rotation of the polar decomposition of [[1, s], [0, 1]] is by atan(s / 2).
    np.testing.assert_allclose(turned, np.degrees(np.arctan(0.25)), atol=1e-6)


def test_what_has_not_moved_or_cannot_be_followed_stays():
    surface = icosphere(1)
    vectors = vectors_of(surface)
    assert np.array_equal(carried_vectors(surface, surface.vertices, vectors), vectors)
    far = surface.with_parts(vertices=surface.vertices + 2.0)
    assert np.array_equal(carried_vectors(far, surface.vertices, vectors), vectors)
    turned = surface.with_parts(vertices=surface.vertices[:, [1, 2, 0]])
    flat = np.zeros_like(surface.vertices)
    assert np.array_equal(carried_vectors(turned, flat, vectors), vectors)
    strange = vectors.copy()
    strange[0], strange[1], strange[2] = np.nan, 0.0, surface.face_normal[2]
    actual = carried_vectors(turned, surface.vertices, strange)
    assert np.array_equal(actual[:3], strange[:3], equal_nan=True)
    assert np.abs(dot(actual[3:], turned.face_normal[3:])).max() < 1e-9
