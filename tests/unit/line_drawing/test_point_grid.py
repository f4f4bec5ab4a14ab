"""`PointGrid`: all pairs within radii that differ by orders of magnitude, in bounded time."""

import numpy as np
import pytest
from scipy.spatial import cKDTree

from rosy_addon.line_drawing.point_grid import PointGrid


def spread_points(count, octaves):
    """Points whose distances to their neighbors grow away from the origin, and these distances."""
    rng = np.random.default_rng(2)
    distance = 2.0 ** (octaves * rng.random(count))
    direction = rng.standard_normal((count, 3)) * (1, 1, 0.02)
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    return distance[:, None] * direction, 0.05 * distance


@pytest.mark.slow
@pytest.mark.parametrize("octaves", [0, 16])
def test_all_pairs_are_found(octaves):
    points, radius = spread_points(1500, octaves)
    grid = PointGrid(float(np.median(radius)), len(points))
    grid.add(points[:1000], radius[:1000])
    grid.add(points[1000:], radius[1000:])
    grid.remove(np.arange(0, 1500, 7))
    query, other = grid.pairs_within(points, radius)
    actual = np.unique(np.stack([query, other], axis=1), axis=0)
    neighbors = cKDTree(points).query_ball_point(points, radius)
    own = np.repeat(np.arange(len(points)), list(map(len, neighbors)))
    expected = np.stack([own, np.concatenate(neighbors)], axis=1)
    expected = expected[expected[:, 1] % 7 != 0]
    np.testing.assert_array_equal(actual, np.unique(expected, axis=0))
