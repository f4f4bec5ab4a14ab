"""Guides along edges that are straight, in steps, or around the corners of a box."""

from __future__ import annotations

import numpy as np
import pytest
from shapes import cube, plane

from rosy_addon.field.edge_guides import coherent_edge_guides
from rosy_addon.field.guides import feature_edges, guides_from_edges

#: Number of faces along a side of a square; a face is smaller than the distance over which edges are averaged.
SIDE = 240


def kept_share(ends: np.ndarray, degree: int) -> float:
    """The share of the guides along edges of a square of size 1 that are kept."""
    square = plane(SIDE, SIDE)
    square = square.with_vertices(square.vertices / np.ptp(square.vertices[:, 0]))
    expected = guides_from_edges(square, ends, degree)
    guides = coherent_edge_guides(square, ends, degree)
    is_kept = guides.any(axis=1)
    assert (guides[is_kept] == expected[is_kept]).all()
    return is_kept.sum() / expected.any(axis=1).sum()


@pytest.mark.parametrize("degree", [2, 4])
def test_a_straight_line_is_followed(degree):
    x = np.arange(SIDE) + SIDE // 2 * (SIDE + 1)
    assert kept_share(np.stack([x, x + 1], axis=1), degree) == 1


@pytest.mark.parametrize("degree, low, high", [(2, 0, 0.1), (4, 1, 1)])
def test_steps(degree, low, high):
    """A cross follows both directions of steps of two edges, but a line would have to turn at each of them."""
    corner = np.arange(0, SIDE, 2) * (SIDE + 2)
    path = corner + np.array([[0, 1, 2, SIDE + 3, 2 * SIDE + 4]]).T
    ends = np.stack([path[:-1].ravel(), path[1:].ravel()], axis=1)
    assert low <= kept_share(ends, degree) <= high


def test_the_edges_of_a_cube_are_followed():
    box = cube()
    ends = feature_edges(box, 1.0)
    assert (coherent_edge_guides(box, ends, 4) == guides_from_edges(box, ends, 4)).all()
