"""Fields between two others: they turn the shorter way, and keep families."""

from dataclasses import replace

import numpy as np
import pytest
from field_helpers import random_field
from shapes import plane, torus

from rosy_addon.field.carry import vectors_on_rest_shape
from rosy_addon.field.convert import rotate_field
from rosy_addon.field.directional_field import field_directions, tensor_field
from rosy_addon.field.interpolation import interpolate_fields
from rosy_addon.field.representation import face_representation, from_representation
from rosy_addon.field.rosy_field import RosyField
from rosy_addon.projection.face_values import face_values
from rosy_addon.projection.field_channel import REPRESENTATION

SURFACE = torus()


@pytest.mark.parametrize("degree", [1, 2, 3, 4, 6])
def test_a_field_turns_the_shorter_way(degree):
    """It has half of the turn in the middle, and both fields at the ends; magnitudes stay."""
    field = random_field(SURFACE, degree)
    turned = rotate_field(SURFACE, field, 0.4 * np.pi / degree + 2 * np.pi / degree)
    pair = (SURFACE, field), (SURFACE, turned)
    for share, expected in ((0.0, 0.0), (0.5, 0.2), (1.0, 0.4)):
        between = interpolate_fields(*pair, share, SURFACE)
        z = face_representation(SURFACE, rotate_field(SURFACE, field, expected * np.pi / degree))
        assert face_representation(SURFACE, between) == pytest.approx(z, abs=1e-12)


def test_undefined_faces_fade():
    field = random_field(SURFACE, 4)
    none = replace(field, vectors=np.zeros_like(field.vectors))
    between = interpolate_fields((SURFACE, field), (SURFACE, none), 0.75, SURFACE)
    z, whole = (face_representation(SURFACE, each) for each in (between, field))
    assert z == pytest.approx(0.25 * whole)
    assert not interpolate_fields((SURFACE, none), (SURFACE, none), 0.5, SURFACE).vectors.any()


def test_moving_singularities_move():
    """If magnitudes vanish at a singularity, it is on the way from one place to the other."""
    mesh = plane(16, 16)
    x, y = mesh.face_frames
    center = mesh.face_center[:, 0] + 1j * mesh.face_center[:, 1]
    turn = (x[:, 0] + 1j * x[:, 1]).conj() ** 4

    def around(place):
        return RosyField(4, from_representation((center - place) * turn, x, y, 4))

    places = -0.5 + 0.1j, 0.3 + 0.2j
    pair = [(mesh, around(place)) for place in places]
    between = interpolate_fields(*pair, 0.25, mesh)
    expected = around(0.75 * places[0] + 0.25 * places[1])
    z, other = (face_representation(mesh, field) for field in (between, expected))
    assert np.angle(z * other.conj()) == pytest.approx(np.zeros(len(z)), abs=1e-9)


def test_families_of_tensors_stay():
    """The major directions stay major, although another of the four is nearer."""
    x, y = SURFACE.face_frames

    def tensors(angle):
        major = np.cos(angle) * x + np.sin(angle) * y
        minor = np.cross(SURFACE.face_normal, major)
        return 3 * major[:, :, None] * major[:, None] + minor[:, :, None] * minor[:, None]

    first, second = (tensor_field(SURFACE, tensors(angle)) for angle in (0.0, np.radians(80)))
    between = interpolate_fields((SURFACE, first), (SURFACE, second), 0.5, SURFACE)
    assert between.family_count == 2 and between.direction_ratios is not None
    major = field_directions(SURFACE, between)[:, 0]
    angle = np.arctan2((major * y).sum(axis=1), (major * x).sum(axis=1))
    assert np.degrees(angle) % 180 == pytest.approx(np.full(SURFACE.face_count, 40.0))
    assert np.linalg.norm(major, axis=1) == pytest.approx(np.full(SURFACE.face_count, 3.0))


def test_vectors_on_a_rest_shape_are_transported_back():
    """A renderer that knows the rest shape draws the vectors of the deformed faces."""
    rest = SURFACE.vertices @ np.array([[1, 0.3, 0], [0, 1.5, 0.2], [0.4, 0, 0.7]])
    field = random_field(SURFACE, 1)
    vectors = vectors_on_rest_shape(SURFACE, rest, field.vectors)
    assert np.linalg.norm(vectors, axis=1) == pytest.approx(field.magnitude)
    moved = SURFACE.with_parts(rest_vertices=rest)
    deformed = np.ascontiguousarray(SURFACE.vertices.T)
    expected, transported = (
        face_values(mesh, np.eye(3), deformed, a_field, False)[0].channels[REPRESENTATION]
        for mesh, a_field in ((SURFACE, field), (moved, replace(field, vectors=vectors)))
    )
    assert transported == pytest.approx(expected, abs=1e-6)
