"""Refinement of triangles by bisection."""

import numpy as np
import pytest
from awkward import AWKWARD
from field_helpers import awkward_surface
from shapes import cube, icosphere

from rosy_addon.field.bisection import bisect

MESHES = [*AWKWARD, "sphere"]


def triangles_of(name):
    surface = icosphere(1) if name == "sphere" else awkward_surface(name)
    return surface.vertices, surface.triangle_vertex


def edge_counts(triangle_vertex):
    """Number of triangles at each edge, by its sorted ends."""
    edges = np.sort(np.stack([triangle_vertex, np.roll(triangle_vertex, -1, 1)], axis=-1), axis=-1)
    return np.unique(edges.reshape(-1, 2), axis=0, return_counts=True)


def area_vectors(vertices, triangle_vertex):
    a, b, c = vertices[triangle_vertex].transpose(1, 0, 2)
    return np.cross(b - a, c - a) / 2


@pytest.mark.parametrize("name", MESHES)
def test_edges_are_short_and_stay_shared(name):
    vertices, triangles = triangles_of(name)
    tree = bisect(vertices, triangles, 0.21, 100_000)
    points = tree.vertices[tree.leaf_vertex]
    lengths = np.linalg.norm(points - np.roll(points, -1, axis=1), axis=2)
    assert lengths.max() <= 0.21
    # Each border of a root is split into borders of leaves; all other edges have two leaves.
    _, root_counts = edge_counts(triangles)
    edges, counts = edge_counts(tree.leaf_vertex)
    if (root_counts <= 2).all():
        assert counts.max() <= 2
    length = np.linalg.norm(np.diff(tree.vertices[edges], axis=1)[:, 0], axis=1)
    root_edges, _ = edge_counts(triangles)
    root_length = np.linalg.norm(np.diff(vertices[root_edges], axis=1)[:, 0], axis=1)
    border = length[counts == 1].sum()
    assert border == pytest.approx(root_length[root_counts == 1].sum(), abs=1e-9)
    # Leaves have the orientation of their roots.
    leaf_sums = np.zeros((len(triangles), 3))
    np.add.at(leaf_sums, tree.leaf_root, area_vectors(tree.vertices, tree.leaf_vertex))
    np.testing.assert_allclose(leaf_sums, area_vectors(vertices, triangles), atol=1e-12)


def test_points_are_in_the_leaves_that_are_found():
    vertices, triangles = triangles_of("cube")
    tree = bisect(vertices, triangles, 0.1, 100_000)
    rng = np.random.default_rng(0)
    root = rng.integers(0, len(triangles), 5000)
    weights = rng.dirichlet(np.ones(3), len(root)).astype(np.float32)
    leaf, leaf_weights = tree.locate(root, weights)
    assert (tree.leaf_root[leaf] == root).all() and leaf_weights.min() >= -1e-5
    np.testing.assert_allclose(leaf_weights.sum(axis=0), 1, atol=1e-5)
    expected = np.einsum("pk,pki->pi", weights, vertices[triangles[root]])
    found = np.einsum("kp,pki->pi", leaf_weights, tree.vertices[tree.leaf_vertex[leaf]])
    np.testing.assert_allclose(found, expected, atol=1e-5)
    # The corners of the leaves in their roots are the same points.
    corners = np.einsum("lcr,lri->lci", tree.leaf_weights, vertices[triangles[tree.leaf_root]])
    np.testing.assert_allclose(corners, tree.vertices[tree.leaf_vertex], atol=1e-12)


def test_short_edges_are_not_bisected():
    surface = cube()
    tree = bisect(surface.vertices, surface.triangle_vertex, 10.0, 1000)
    assert (tree.leaf_vertex == surface.triangle_vertex).all()
    root = np.array([3, 0])
    leaf, weights = tree.locate(root, np.eye(3, dtype=np.float32)[:2])
    assert (leaf == root).all() and (weights == np.eye(3)[:, :2]).all()


def test_refinement_ends_at_the_largest_number_of_triangles():
    surface = cube()
    tree = bisect(surface.vertices, surface.triangle_vertex, 1e-9, 500)
    assert 125 < len(tree.leaf_root) <= 500
