"""Creases of a mesh, as chains of sharp edges."""

import numpy as np
import pytest
from shapes import capped_cylinder, cube, from_triangles, icosphere, plane, rebuilt

from rosy_addon.field.connectivity import connected_components
from rosy_addon.field.creases import find_creases


def creases(surface, angle=0.7, **settings):
    """The ends of the edges, and the number of edges of each chain."""
    ends = find_creases(rebuilt(surface, **settings), angle)
    chain = connected_components(len(surface.vertices), ends)[ends[:, 0]]
    return ends, np.unique(chain, return_counts=True)[1].tolist()


def ridge(height, cells=48, noise=0.0):
    """Return a square of triangles with a ridge along y = 0.

    `noise` is the standard deviation of the heights, relative to the length of an edge.
    """
    flat = plane(cells, cells)
    x, y, _ = flat.vertices.T
    z = noise * (2 / cells) * np.random.default_rng(3).standard_normal(x.shape)
    return from_triangles(np.stack([x, y, z - height * np.abs(y)], axis=1), flat.triangle_vertex)


def test_all_edges_of_a_cube_are_one_chain():
    for sharp in (None, 1.0):
        assert creases(cube(), sharp_angle=sharp)[1] == [12]


@pytest.mark.parametrize("flat", [False, True])
def test_smooth_surfaces_have_no_creases(flat):
    for surface in (icosphere(2), icosphere(1)):
        assert creases(surface, flat_faces=np.full(surface.face_count, flat))[1] == []


def test_the_rims_of_a_cylinder_are_two_chains():
    assert creases(capped_cylinder(24))[1] == [24, 24]


@pytest.mark.parametrize("noise", [0.25, 0.35])
@pytest.mark.parametrize("flat", [False, True])
def test_noise_has_no_creases(noise, flat):
    surface = ridge(0.0, noise=noise)
    assert creases(surface, flat_faces=np.full(surface.face_count, flat))[1] == []


@pytest.mark.parametrize("noise", [0.0, 0.05, 0.1])
def test_a_ridge_is_a_crease_in_spite_of_noise(noise):
    """At least 0.95 of the ridge is found, and nothing else."""
    surface = ridge(1.0, noise=noise)
    ends, counts = creases(surface)
    on_ridge = np.abs(surface.vertices[ends, 1]).max(axis=1) < 1e-9
    assert on_ridge.all() and len(counts) == 1 and len(ends) >= 0.95 * 48


def test_a_chain_continues_where_it_is_weaker():
    """A ridge that becomes flat counts down to half of the crease angle, if enough of it is strong."""
    flat = ridge(0.0)
    x, y, _ = flat.vertices.T
    angle = 0.05 + 0.45 * (x + 1)
    points = np.stack([x, y, -np.tan(angle / 2) * np.abs(y)], axis=1)
    fading = rebuilt(flat, points)
    ends, counts = creases(fading, 0.7, sharp_angle=0.1)
    on_ridge = np.abs(fading.vertices[ends, 1]).max(axis=1) < 1e-9
    lowest = angle[ends].min()
    assert on_ridge.all() and len(counts) == 1 and lowest == pytest.approx(0.35, abs=0.03)
    assert creases(fading, 0.9, sharp_angle=0.1)[1] == []
