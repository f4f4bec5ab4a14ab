"""Ambient occlusion against closed forms."""

import numpy as np
import pytest
from shapes import from_quads, grid_of_quads, icosphere, moved, placed, plane

from rosy_addon.projection.ambient_occlusion import ambient_occlusion, fibonacci_sphere
from rosy_addon.projection.gbuffer import MeshInstance

#: These tests draw many pictures and measure them.
pytestmark = pytest.mark.slow


def occlusion_at_vertices(instances, *directions):
    """(V,) values of the first instance, from one corner of each vertex."""
    surface = instances[0].surface
    actual = np.empty(len(surface.vertices))
    actual[surface.corner_vertex] = ambient_occlusion(instances, 0, *directions)
    return actual


def trough(cells=8, size=4.0, sharp=True):
    """A floor (z = 0, y > 0) and a wall, long in x; (V,) distances from the edge."""
    x = np.linspace(-3 * size, 3 * size, 3 * cells + 1)
    edge_distance = np.linspace(0, size, cells + 1)
    edge_distance = np.concatenate([-edge_distance[:0:-1], edge_distance])
    y, z = np.maximum(edge_distance, 0), np.maximum(-edge_distance, 0)
    points = [np.repeat(x, len(edge_distance)), np.tile(y, len(x)), np.tile(z, len(x))]
    quads, _ = grid_of_quads(3 * cells, 2 * cells, False, False)
    bend = 0.5 if sharp else None
    surface = from_quads(np.stack(points, axis=1), quads, name="trough", sharp_angle=bend)
    return surface, np.tile(edge_distance, len(x))


def test_directions_are_evenly_spread():
    """The directions have the moments of the sphere: mean 0, covariance 1/3 of the identity."""
    actual = fibonacci_sphere(256)
    np.testing.assert_allclose(np.linalg.norm(actual, axis=1), 1)
    np.testing.assert_allclose(actual.mean(axis=0), 0, atol=5e-3)
    np.testing.assert_allclose(actual.T @ actual / 256, np.eye(3) / 3, atol=5e-3)


@pytest.mark.parametrize("scale", [0.01, 300.0])
def test_a_sphere_is_fully_open(scale):
    instance = MeshInstance(icosphere(3), placed(scale))
    np.testing.assert_allclose(ambient_occlusion([instance], 0, 64), 1, atol=0.005)


def test_a_floor_beside_a_wall():
    """A wall of height h at distance d leaves 1/2 + cos(atan(h/d))/2 open; at the edge, half."""
    surface, edge_distance = trough()
    actual = occlusion_at_vertices([MeshInstance(surface, np.eye(4))])
    is_central = np.abs(surface.vertices[:, 0]) < 1
    for distance, tolerance in ((0.0, 0.02), (0.5, 0.02), (1.0, 0.015), (2.0, 0.015)):
        selected = is_central & (np.abs(np.abs(edge_distance) - distance) < 0.05)
        expected = 0.5 + 0.5 * distance / np.hypot(distance, 4.0)
        assert actual[selected].mean() == pytest.approx(expected, abs=tolerance)
        assert actual[selected].std() < 0.01


def test_the_smooth_edge_of_two_planes():
    """The normal bisects the open wedge of 90 degrees, whose visibility is sin 45."""
    surface, edge_distance = trough(24, sharp=False)
    actual = occlusion_at_vertices([MeshInstance(surface, np.eye(4))])
    selected = (np.abs(surface.vertices[:, 0]) < 1) & (edge_distance == 0)
    assert actual[selected].mean() == pytest.approx(np.sqrt(0.5), abs=0.02)


def test_a_plane_below_a_sphere():
    """A ball of radius r hides cos(a) (r / l)^2, at distance l and angle a (Nusselt)."""
    ground, ball = plane(10, 10, 6.0), icosphere(4)
    instances = [MeshInstance(ground, np.eye(4)), MeshInstance(ball, moved(z=1.6))]
    actual = occlusion_at_vertices(instances, 300)
    distance = np.sqrt(ground.vertices[:, 0] ** 2 + ground.vertices[:, 1] ** 2 + 1.6**2)
    expected = 1 - 1.6 / distance**3
    assert expected.min() < 0.65 and np.abs(actual - expected).mean() < 0.006
    assert np.abs(actual - expected).max() < 0.05


def test_zero_directions_are_refused(error_of):
    instance = MeshInstance(icosphere(1), np.eye(4))
    assert "directions" in error_of(ambient_occlusion, [instance], 0, 0)
