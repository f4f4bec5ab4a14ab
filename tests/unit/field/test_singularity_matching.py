"""Singularities of two fields are matched, the nearest pairs first."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
from scipy.spatial.distance import cdist

from rosy_addon.field.analysis import match_on_surface


def match(points, index, other_points, other_index, reach):
    """Match singularities at vertices at these points, on a mesh of extent 1."""
    surface = SimpleNamespace(vertices=np.concatenate([points, other_points]), extent=1.0)
    other_vertex = len(points) + np.arange(len(other_points))
    singularities = np.arange(len(points)), index
    return match_on_surface(surface, singularities, (other_vertex, other_index), reach)


def greedy_pairs(points, index, other_points, other_index, reach):
    """The same, one pair after another."""
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
        found = match(points, index, other_points, other_index, reach)
        pairs = list(zip(found.first.tolist(), found.second.tolist(), strict=True))
        assert pairs == greedy_pairs(points, index, other_points, other_index, reach)
        distance = np.linalg.norm(points[found.first] - other_points[found.second], axis=1)
        np.testing.assert_allclose(found.distance, distance)
