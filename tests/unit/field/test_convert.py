"""Conversion of fields: degree, rotation, diffusion and magnitude."""

import numpy as np
import pytest
from field_helpers import directions_at_angles, with_random_members
from hypothesis import given, settings
from hypothesis import strategies as st
from shapes import cylinder, icosphere, plane, torus

from rosy_addon.field.convert import (
    Conversion,
    change_degree,
    convert,
    diffuse_field,
    rotate_field,
    with_magnitude,
)
from rosy_addon.field.curvature import face_magnitude
from rosy_addon.field.directional_field import field_from_directions, field_matching
from rosy_addon.field.frames import dot, normalize
from rosy_addon.field.generate import axis_field, generate
from rosy_addon.field.representation import face_representation, from_representation, power
from rosy_addon.field.rosy_field import RosyField
from rosy_addon.field.singularities import find_singularities

BALL = icosphere(3)


# --- degrees -------------------------------------------------------------------------------------


@pytest.mark.parametrize(("degree", "multiple"), [(1, 6), (2, 4), (3, 12), (4, 4)])
def test_a_multiple_has_the_member_and_the_power_of_z(degree, multiple):
    field = axis_field(BALL, degree, (0.2, 0.1, 1.0))
    converted = change_degree(BALL, field, multiple)
    assert converted.degree == multiple
    unit = RosyField(degree, normalize(field.vectors))
    z = power(face_representation(BALL, unit), multiple // degree) * field.magnitude
    np.testing.assert_allclose(face_representation(BALL, converted), z, atol=1e-9)


@pytest.mark.parametrize(("degree", "divisor"), [(4, 2), (4, 1), (6, 2), (6, 3), (12, 1)])
def test_a_divisor_is_consistent_without_singularities(degree, divisor):
    """A field without singularities, around the axis of a torus."""
    surface = torus(48, 24)
    line = RosyField(divisor, normalize(np.cross((0, 0, 1), surface.face_center)))
    field = with_random_members(surface, RosyField(degree, line.vectors))
    converted = change_degree(surface, field, divisor)
    assert converted.degree == divisor
    # The result is the same one of the fields of degree `divisor` everywhere.
    ratio = face_representation(surface, converted) * face_representation(surface, line).conj()
    np.testing.assert_allclose(ratio, ratio[0], atol=1e-6)
    np.testing.assert_allclose(ratio[0] ** (degree // divisor), 1, atol=1e-6)


def test_a_divisor_has_seams_between_singularities():
    field = generate(BALL, "smoothest", 4)
    converted = change_degree(BALL, with_random_members(BALL, field), 1)
    _, matching = field_matching(BALL, RosyField(4, converted.vectors))
    assert 0 < np.count_nonzero(matching) < 0.2 * len(matching)
    # There are eight singularities of index 1/4, at which seams end.
    assert len(find_singularities(BALL, field)[0]) == 8


@pytest.mark.parametrize("degree", [3, 8])
def test_other_degrees_are_refused(degree, error_of):
    field = axis_field(BALL, 6 if degree == 8 else 4)
    assert "neither a multiple nor a divisor" in error_of(change_degree, BALL, field, degree)


# --- turns ---------------------------------------------------------------------------------------


@settings(max_examples=50)
@given(st.integers(1, 12), st.floats(-7, 7))
def test_rotation_multiplies_z(degree, angle):
    surface = plane(3, 3)
    field = axis_field(surface, degree, (1.0, 0.5, 0.3))
    z = face_representation(surface, rotate_field(surface, field, angle))
    expected = face_representation(surface, field) * np.exp(1j * degree * angle)
    np.testing.assert_allclose(z, expected, atol=1e-9)


# --- diffusion -----------------------------------------------------------------------------------


@pytest.mark.parametrize("waves", [0, 1, 3])
def test_diffusion_of_a_wave(waves):
    """An implicit step divides cos(k x), which has no flow over the borders, by 1 + t k^2."""
    surface, time = plane(60, 60), 0.05
    k = np.pi * waves / 2
    x, y = surface.face_frames
    wave = np.cos(k * (surface.face_center[:, 0] + 1)) + 0j
    field = RosyField(3, from_representation(wave, x, y, 3))
    z = face_representation(surface, diffuse_field(surface, field, time))
    np.testing.assert_allclose(z, wave / (1 + time * k**2), atol=0.01)


def test_the_diffusion_time_must_be_positive(error_of):
    # A length whose square is too small for a number is as good as one that is a little larger.
    field = axis_field(BALL, 4)
    tiny, small = (convert(BALL, field, Conversion(smoothing_length=h)) for h in (1e-300, 1e-30))
    np.testing.assert_allclose(tiny.vectors, small.vectors, atol=1e-9)
    assert "the diffusion time must be above 0" in error_of(diffuse_field, BALL, field, 0.0)


# --- magnitudes ----------------------------------------------------------------------------------


@pytest.mark.parametrize("scale", [1.0, 30.0])
def test_curvature_is_one_over_the_radius(scale):
    """In 1 / unit of the mesh, whatever its size."""
    tube = cylinder(96, 24, radius=0.5 * scale, height=2 * scale)
    assert np.allclose(face_magnitude(tube, "curvature"), 2 / scale, rtol=2e-3)


def test_magnitudes_keep_directions_and_undefined_faces():
    vectors = np.array(axis_field(BALL, 4).vectors)
    vectors[::7] = 0
    field = with_magnitude(RosyField(4, vectors), np.arange(BALL.face_count))
    expected = np.arange(BALL.face_count) * vectors.any(axis=1)
    np.testing.assert_allclose(field.magnitude, expected)
    cosine = dot(normalize(field.vectors), normalize(vectors))
    np.testing.assert_allclose(cosine[field.magnitude > 0], 1)


def test_free_directions_are_not_converted(error_of):
    surface = plane(3, 3)
    free = field_from_directions(surface, directions_at_angles(surface, [0.0, 0.5, 3.0]))
    assert "are not a RoSy" in error_of(change_degree, surface, free, 6)
    assert "are not a RoSy" in error_of(diffuse_field, surface, free, 1.0)
