"""Directions that are not a RoSy: harmonics, matching and families."""

import numpy as np
import pytest
from field_helpers import directions_at_angles
from hypothesis import given, settings
from hypothesis import strategies as st
from shapes import icosphere, plane

from rosy_addon.field.directional_field import (
    closest_rosy,
    field_directions,
    field_from_directions,
    field_harmonics,
    field_matching,
    field_symmetry,
    ratios_from_harmonics,
    tensor_field,
)
from rosy_addon.field.frames import normalize
from rosy_addon.field.rosy_field import RosyField
from rosy_addon.field.symmetry import FieldSymmetry
from rosy_addon.field.validate import validated_directions

# --- the algebra ---------------------------------------------------------------------------------


@settings(max_examples=200)
@given(st.integers(2, 7), st.integers(0, 10**6), st.integers(0, 6))
def test_harmonics_do_not_depend_on_the_first_direction(degree, seed, shift):
    random = np.random.default_rng(seed)
    w = np.exp(2j * np.pi * random.random((1, degree))) * (0.2 + random.random((1, degree)))
    first, rho, deviations = closest_rosy(w)
    other_first, other_rho, other = closest_rosy(np.roll(w, shift, axis=1))
    ours = field_harmonics(RosyField(degree, np.ones((1, 3)), deviations))
    theirs = field_harmonics(RosyField(degree, np.ones((1, 3)), other))
    # z, and C_j: coefficients relative to the member times exp(-i j t).
    assert np.allclose(np.exp(1j * degree * first), np.exp(1j * degree * other_first))
    assert np.allclose(rho, other_rho)
    for j in {*ours, *theirs}:
        if 2 * j == degree:
            continue  # only defined up to the sign of exp(i N t / 2)
        a = ours.get(j, np.zeros(1)) * np.exp(-1j * j * first)
        b = theirs.get(j, np.zeros(1)) * np.exp(-1j * j * other_first)
        assert np.allclose(a, b, atol=2e-4)


@pytest.mark.slow
@settings(max_examples=200)
@given(st.integers(1, 7), st.integers(0, 10**6))
def test_directions_are_restored_from_the_field(degree, seed):
    surface = icosphere(1)
    random = np.random.default_rng(seed)
    angles, lengths = 6.28 * random.random(degree), 0.2 + random.random(degree)
    directions = directions_at_angles(surface, angles, lengths)
    field = field_from_directions(surface, directions)
    actual = field_directions(surface, field)
    order = np.argsort((angles - angles[0]) % (2 * np.pi))
    assert np.allclose(actual, directions[:, order], atol=1e-9)
    if field.direction_ratios is not None:
        restored = ratios_from_harmonics(field_harmonics(field), degree)
        assert np.abs(restored - field.direction_ratios).max() < 1e-3


def test_the_representation_is_the_product_of_the_directions():
    random = np.random.default_rng(0)
    for degree in range(1, 9):
        w = np.exp(2j * np.pi * random.random((5, degree)))
        first, _, _ = closest_rosy(w)
        assert np.allclose(np.exp(1j * degree * first), (-1) ** (degree - 1) * w.prod(axis=1))


def test_opposite_directions_are_detected():
    surface = plane()
    pairs = np.array([0.0, 0.6, np.pi, np.pi + 0.6])
    even, uneven, odd = (
        field_symmetry(field_from_directions(surface, directions_at_angles(surface, *each)))
        for each in ((pairs, (1, 2, 1, 2)), (pairs, (1, 2, 1, 3)), ((0.0, 1.0, 3.0), (1, 1, 1)))
    )
    assert even.has_opposites and not uneven.has_opposites and not odd.has_opposites


def test_directions_on_vertices_are_averaged_onto_faces():
    surface = plane(6, 6)
    angles = (0.1, 0.9, 0.1 + np.pi, 0.9 + np.pi)
    directions = np.array([(2 * np.cos(a), 2 * np.sin(a), 0) for a in angles])
    rows = np.stack([np.roll(directions, row, axis=0) for row in range(len(surface.vertices))])
    field = validated_directions(surface, rows, "test", domain="vertex")
    for actual in field_directions(surface, field):
        nearest = np.abs(actual[:, None] - directions).max(axis=2).min(axis=1)
        assert nearest.max() < 1e-9


@pytest.mark.parametrize(
    ("degree", "orders", "has_opposites", "line_count", "sheets_per_turn"),
    [
        (1, (), False, 1, 2),
        (3, (), False, 3, 6),
        (4, (), True, 2, 4),
        (4, (0, 2, -2), True, 2, 4),
        (4, (0, 1), False, 4, 4),
        (5, (0, 2), False, 5, 5),
    ],
)
def test_numbers_of_lines_and_sheets(degree, orders, has_opposites, line_count, sheets_per_turn):
    symmetry = FieldSymmetry(degree, orders)
    assert symmetry.has_opposites == has_opposites and symmetry.line_count == line_count
    assert symmetry.sheets_per_turn == sheets_per_turn


# --- matching and families -----------------------------------------------------------------------


def test_matching_follows_the_stored_members():
    surface = plane(5, 5)
    member_index = np.random.default_rng(3).integers(0, 4, surface.face_count)
    angle = member_index * np.pi / 2
    vectors = np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)
    faces, matching = field_matching(surface, RosyField(4, vectors))
    assert np.array_equal(matching, (member_index[faces[:, 0]] - member_index[faces[:, 1]]) % 4)


def test_eigenvectors_of_a_tensor():
    surface = icosphere(3)
    matrix = np.random.default_rng(0).standard_normal((3, 3))
    matrix = matrix + matrix.T
    field = tensor_field(surface, np.tile(matrix, (surface.face_count, 1, 1)))
    assert (field.degree, field.family_count) == (4, 2)
    x, y = surface.face_frames
    for face in range(0, surface.face_count, 37):
        frame = np.stack([x[face], y[face]])
        values, vectors = np.linalg.eigh(frame @ matrix @ frame.T)
        major, minor = field_directions(surface, field)[face][:2]
        assert np.isclose(abs(normalize(major) @ (vectors[:, 1] @ frame)), 1)
        assert np.isclose(np.linalg.norm(major), abs(values[1]), rtol=1e-2)
        assert np.isclose(np.linalg.norm(minor), abs(values[0]), rtol=1e-2)


def test_families_need_a_consistent_order_of_directions():
    surface = plane(8, 8)
    directions = directions_at_angles(surface, (0.0, 1.0, np.pi, np.pi + 1.0))
    assert field_from_directions(surface, directions).family_count == 2
    directions[::2] = np.roll(directions[::2], 1, axis=1)
    assert field_from_directions(surface, directions).family_count == 1
