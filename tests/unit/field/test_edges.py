"""Edges and connected parts of meshes, compared with scipy and numpy's own sorting."""

import numpy as np
import pytest
from scipy.sparse import coo_array, csgraph

from rosy_addon.field.connectivity import connected_components, sorted_with_order


@pytest.mark.parametrize("limit", [50, 1 << 40, 1 << 62])
def test_keys_are_sorted_with_their_order(limit):
    """Also if keys and indices do not fit into one number."""
    key = np.random.default_rng(1).integers(0, limit, 3000)
    key[1::3] = key[::3]
    ordered, order = sorted_with_order(key, limit)
    np.testing.assert_array_equal(order, np.argsort(key, kind="stable"))
    np.testing.assert_array_equal(ordered, np.sort(key))


@pytest.mark.parametrize("shape", ["random", "star", "path", "none"])
def test_connected_parts_are_numbered_by_their_first_node(shape):
    count, rng = 300, np.random.default_rng(2)
    nodes = rng.permutation(count)
    pairs = {
        "random": rng.integers(0, count, (200, 2)),
        "star": np.stack([np.full(count - 1, nodes[0]), nodes[1:]], axis=1),
        "path": np.stack([nodes[:-1], nodes[1:]], axis=1),
        "none": np.empty((0, 2), dtype=int),
    }[shape]
    graph = coo_array((np.ones(len(pairs)), pairs.T), shape=(count, count))
    _, expected = csgraph.connected_components(graph, directed=False)
    np.testing.assert_array_equal(connected_components(count, pairs), expected)
