"""The triangle closest to a point, against exhaustive search and dense samples."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from shapes import from_triangles, icosphere, joined, torus

from rosy_addon.field.closest_point import closest_triangles, point_triangle_distances


def distances_to_all_triangles(surface, points):
    """(n, T) distances of points from all triangles."""
    corners = surface.vertices[surface.triangle_vertex]
    pairs = np.repeat(points, len(corners), axis=0), np.tile(corners, (len(points), 1, 1))
    return point_triangle_distances(*pairs).reshape(len(points), -1)


@pytest.mark.slow
@pytest.mark.parametrize("surface", [icosphere(3), torus(24, 12)], ids=["sphere", "torus"])
@pytest.mark.parametrize("far", [0.02, 0.5, 8.0])
def test_the_result_matches_an_exhaustive_search(surface, far):
    points = np.random.default_rng(1).standard_normal((200, 3)) * far + (0.9, 0.1, 0.2)
    triangle, distance = closest_triangles(surface, points)
    distances = distances_to_all_triangles(surface, points)
    assert np.allclose(distance, distances.min(axis=1))
    assert np.allclose(distances[np.arange(200), triangle], distance)


@pytest.mark.slow
def test_a_maximum_distance_changes_only_the_points_beyond_it():
    ball = icosphere(3)
    points = np.random.default_rng(1).standard_normal((400, 3))
    triangle, distance = closest_triangles(ball, points)
    near_triangle, near_distance = closest_triangles(ball, points, 0.1)
    near = distance <= 0.1
    assert 20 < near.sum() < 200 and (near_distance[~near] > 0.1).all()
    np.testing.assert_array_equal(near_triangle[near], triangle[near])
    np.testing.assert_array_equal(near_distance[near], distance[near])
    # What is far away takes no time: neither outside of the surface nor inside.
    _, distance = closest_triangles(ball, np.tile([[0.0, 0, 0], [1e9, 0, 0]], (100_000, 1)), 0.1)
    assert (distance > 0.1).all()


def test_large_triangles_among_small_ones():
    ball = icosphere(3, 0.1)
    floor = from_triangles([(-9, -9, -1), (9, -9, -1), (0, 9, -1)], [[0, 1, 2]])
    surface = joined(ball, floor)
    triangle, distance = closest_triangles(surface, np.array([(3.0, -4.0, -0.9), (0.0, 0.0, 0.2)]))
    assert triangle[0] == len(ball.triangles) and np.isclose(distance[0], 0.1)
    assert triangle[1] < len(ball.triangles) and np.isclose(distance[1], 0.1, atol=0.002)


@settings(max_examples=100)
@given(st.lists(st.floats(-3, 3), min_size=12, max_size=12))
def test_distances_match_dense_samples_of_the_triangle(numbers):
    point, corners = np.array(numbers[:3]), np.array(numbers[3:]).reshape(3, 3)
    steps = np.argwhere(np.ones((41, 41)))
    weights = np.column_stack([steps, 40 - steps.sum(axis=1)])[steps.sum(axis=1) <= 40] / 40
    nearest = np.linalg.norm(weights @ corners - point, axis=1).min()
    actual = point_triangle_distances(point[None], corners[None])[0]
    size = np.abs(corners - corners[0]).max()
    assert actual <= nearest + 1e-9 and actual >= nearest - size / 10


def test_a_surface_that_is_a_point():
    """Points may be farther away than its cells can count."""
    surface = from_triangles(np.zeros((3, 3)), [[0, 1, 2]])
    points = np.array([[0.0, 0.0, 0.0], [1e6, 0.0, 0.0], [0.0, 3.0, -4e12]])
    triangle, distance = closest_triangles(surface, points)
    assert (triangle == 0).all() and np.allclose(distance, [0, 1e6, 4e12])
