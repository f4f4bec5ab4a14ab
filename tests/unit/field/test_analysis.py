"""The Dirichlet energy of fields, and angles and matched singularities between fields."""

from types import SimpleNamespace

import numpy as np
import pytest
from field_helpers import directions_at_angles, with_random_members
from scipy.spatial.distance import cdist
from shapes import from_triangles, icosphere, plane, rebuilt, torus

from rosy_addon.field.analysis import (
    angle_errors,
    dirichlet_energy,
    error_statistics,
    match_on_surface,
)
from rosy_addon.field.convert import rotate_field
from rosy_addon.field.directional_field import field_from_directions
from rosy_addon.field.frames import normalize
from rosy_addon.field.generate import GeneratorSettings, axis_field, generate
from rosy_addon.field.rosy_field import RosyField
from rosy_addon.field.singularities import description


def rotating_field(surface, degree, rate):
    """A field on a plane that rotates by `rate` radians per unit of x."""
    angle = rate * surface.face_center[:, 0]
    return RosyField(degree, np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1))


@pytest.mark.parametrize("degree", [1, 2, 4])
def test_energy_of_a_field_that_rotates_evenly(degree):
    """|grad z|^2 is (N rate)^2 on the area of 4, without half a column at two borders."""
    surface = plane(80, 80)
    rate = 0.7
    energy = dirichlet_energy(surface, rotating_field(surface, degree, rate))
    assert np.isclose(energy, 4 * (degree * rate) ** 2, rtol=0.02)
    assert dirichlet_energy(surface, rotating_field(surface, degree, 0.0)) < 1e-12


def test_energy_does_not_depend_on_size_member_or_length():
    surface = torus(48, 24)
    field = axis_field(surface, 4, (0.2, 0.3, 1.0))
    energy = dirichlet_energy(surface, field)
    large = rebuilt(surface, 7 * surface.vertices)
    assert np.isclose(dirichlet_energy(large, axis_field(large, 4, (0.2, 0.3, 1.0))), energy)
    other = with_random_members(surface, RosyField(4, 3 * field.vectors))
    assert np.isclose(dirichlet_energy(surface, other), energy)


@pytest.mark.parametrize("degree", [1, 3, 6])
def test_errors_are_angles_to_the_nearest_member(degree, error_of):
    ball = icosphere(2)
    field = RosyField(degree, normalize(axis_field(ball, degree).vectors))
    index = np.arange(ball.face_count) % degree
    angle = np.linspace(-3, 3, ball.face_count) / degree
    other = rotate_field(ball, field, angle + 2 * np.pi * index / degree)
    np.testing.assert_allclose(angle_errors(ball, field, other), np.abs(angle), atol=1e-9)
    is_defined = np.arange(ball.face_count)[:, None] >= 10
    partial = angle_errors(ball, RosyField(degree, field.vectors * is_defined), other)
    assert np.isnan(partial[:10]).all() and np.isfinite(partial[10:]).all()
    assert np.isclose(error_statistics(ball, partial).compared, 1 - 10 / ball.face_count)
    assert "cannot be compared" in error_of(angle_errors, ball, field, axis_field(ball, 12))


def test_percentiles_of_errors_are_weighted_by_area():
    """The face of 3/4 of the area has the least error."""
    area = np.array([0.75, 0.075, 0.15, 0.025])
    corners = [[(0, 0, k), (2 * width, 0, k), (0, 1, k)] for k, width in enumerate(area)]
    mesh = from_triangles(np.reshape(corners, (-1, 3)), np.arange(12).reshape(4, 3))
    error = np.array([0.1, 0.2, 0.3, 0.4])
    statistics = error_statistics(mesh, error)
    assert np.isclose(statistics.mean, area @ error) and statistics.p95 == 0.3
    assert statistics.worst_face == 3 and statistics.max == 0.4
    error[3] = np.nan
    assert error_statistics(mesh, error).worst_face == 2
    values = list(vars(error_statistics(mesh, np.full(4, np.nan))).values())
    assert values[1:] == [0, 0, 0, 0, -1, 0]


def test_fields_that_are_no_rosys_are_compared_by_their_best_matching():
    """Three directions at free angles, once with the first and once with the second one stored."""
    ball = icosphere(2)

    def field_at(*angles):
        return field_from_directions(ball, directions_at_angles(ball, angles))

    field = field_at(0.1, 1.0, 4.0)
    for other, error in ((field_at(1.0, 4.0, 0.1), 0), (field_at(3.7, 0.4, 1.0), 0.2)):
        np.testing.assert_allclose(angle_errors(ball, field, other), error, atol=1e-7)


def test_fields_are_described():
    """A smoothest 4-RoSy on a sphere has 8 singularities; two faces are undefined."""
    sphere = icosphere(3)
    field = generate(sphere, GeneratorSettings("smoothest"), 4)
    assert description([(sphere, field)], count_singularities=True) == "8 singularities"
    assert description([(sphere, field)], count_singularities=False) == ""
    vectors = field.vectors.copy()
    vectors[[3, 70]] = 0
    fields = [(sphere, field), (sphere, RosyField(4, vectors))]
    assert description(fields, count_singularities=False) == "2 faces without a direction"


# --- singularities ---------------------------------------------------------------------------------------


def greedy_pairs(points, index, other_points, other_index, reach):
    """Match points, one pair after another."""
    distance = cdist(points, other_points)
    distance[index[:, None] != other_index] = np.inf
    pairs = []
    while distance.size and distance.min() <= reach:
        row, column = np.unravel_index(np.argmin(distance), distance.shape)
        pairs.append((row, column))
        distance[row], distance[:, column] = np.inf, np.inf
    return sorted(pairs)


def test_the_nearest_pairs_come_first():
    random = np.random.default_rng(3)
    for count, other_count, reach in ((40, 55, 0.2), (200, 120, 0.5), (60, 60, 9.0), (5, 0, 1.0)):
        points, other_points = random.random((count, 3)), random.random((other_count, 3))
        index, other_index = random.choice([-1, 1], count), random.choice([-1, 1, 2], other_count)
        surface = SimpleNamespace(vertices=np.concatenate([points, other_points]), extent=1.0)
        others = count + np.arange(other_count), other_index
        found = match_on_surface(surface, (np.arange(count), index), others, reach)
        pairs = list(zip(found.first.tolist(), found.second.tolist(), strict=True))
        assert pairs == greedy_pairs(points, index, other_points, other_index, reach)
        distance = np.linalg.norm(points[found.first] - other_points[found.second], axis=1)
        np.testing.assert_allclose(found.distance, distance)
