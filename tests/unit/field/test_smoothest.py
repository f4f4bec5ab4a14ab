"""Smoothest fields, against closed forms, SciPy and another library; awkward meshes."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.sparse as sparse
from field_helpers import angle_differences, bumpy, symmetric_head
from scipy.sparse.linalg import eigsh
from scipy.spatial.distance import cdist
from shapes import cylinder, from_triangles, icosphere, joined, plane, rebuilt, torus

from rosy_addon.field.connection import build_connection, laplacian
from rosy_addon.field.singularities import find_singularities
from rosy_addon.field.smoothest import eigenproblem, smoothest_field, spectral_shift

BALL = bumpy(icosphere(3))
MIRROR = np.diag([-1.0, 1.0, 1.0])


def smallest_energies(connection, degree):
    """The smallest eigenvalue of the connection Laplacian on each component."""
    mass = connection.positive_mass
    shift = spectral_shift(mass)
    matrix = laplacian(connection, degree, shift)
    return eigenproblem(matrix, mass, connection.component)[1] - shift


# --- the connection --------------------------------------------------------------------------------


@pytest.mark.parametrize("degree", [1, 4, 7])
def test_a_constant_direction_in_the_plane_has_no_energy(degree):
    surface = plane(6)
    random = np.random.default_rng(3)
    is_interior = np.abs(surface.vertices).max(axis=1) < np.abs(surface.vertices).max() - 1e-9
    shift = (0.05, 0.05, 0) * random.standard_normal((1, 3))
    surface = rebuilt(surface, surface.vertices + is_interior[:, None] * shift)
    connection = build_connection(surface)
    edge = np.roll(surface.vertices[surface.triangle_vertex], -1, axis=1)
    edge = (edge - surface.vertices[surface.triangle_vertex]).reshape(-1, 3)
    # The angle of an edge in the map of its node, relative to its angle in the plane.
    angle = connection.edge_direction - np.arctan2(edge[:, 1], edge[:, 0])
    z = np.empty(connection.node_count, dtype=complex)
    z[connection.corner_node] = np.exp(1j * degree * angle)
    np.testing.assert_allclose(z[connection.corner_node], np.exp(1j * degree * angle), atol=1e-9)
    np.testing.assert_allclose(laplacian(connection, degree) @ z, 0, atol=1e-9)


def test_each_umbrella_of_a_vertex_is_a_node():
    points = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [-1, 0, 0], [-1, -1, 0]]
    bowtie = from_triangles(points, [[0, 1, 2], [0, 3, 4]])
    assert build_connection(bowtie).node_count == 6


# --- fields ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("degree", [1, 4, 6])
def test_energies_match_another_library(degree):
    """The phases of geometry-central's connection Laplacian, raised to N, give the same eigenvalues.

    Its frames at the vertices are rotated, which changes no eigenvalue. It flips edges to be Delaunay, and
    treats borders differently, so the mesh is closed and Delaunay.
    """
    potpourri3d = pytest.importorskip("potpourri3d")
    surface = bumpy(icosphere(4), 0.08, (1.0, 1.05, 1.1))
    connection = build_connection(surface)
    assert connection.weight.min() > 0
    triangles = surface.corner_vertex.reshape(-1, 3)
    solver = potpourri3d.MeshVectorHeatSolver(surface.vertices, triangles)
    theirs = sparse.coo_matrix(solver.get_connection_laplacian())
    modulus, is_edge = np.abs(theirs.data), theirs.row != theirs.col
    # The entry of an edge is its weight times minus the transport.
    value = np.where(is_edge, -modulus * (-theirs.data / modulus) ** degree, modulus)
    mass = np.empty(connection.node_count)
    mass[triangles.ravel()] = connection.mass[connection.corner_node]
    raised = sparse.csr_matrix((value, (theirs.row, theirs.col)))
    expected = eigsh(raised, k=1, M=sparse.diags(mass), sigma=-1e-6)[0]
    assert smallest_energies(connection, degree) == pytest.approx(expected, rel=1e-5)


@pytest.mark.parametrize("degree", range(1, 7))
def test_a_sphere_has_the_fewest_possible_singularities(degree):
    _, index = find_singularities(icosphere(4), smoothest_field(icosphere(4), degree))
    assert index.tolist() == [1] * (2 * degree)


def test_each_component_has_its_own_field():
    first, second = bumpy(icosphere(3)), bumpy(torus(24, 12))
    both = joined(first, rebuilt(second, 0.3 * second.vertices + 5))
    energies = [smallest_energies(build_connection(s), 4) for s in (both, first, second)]
    np.testing.assert_allclose(energies[0], [*energies[1], *energies[2] / 0.09], rtol=1e-4)


def test_no_area_at_all_is_an_error(error_of):
    flat = from_triangles([[0, 0, 0], [1, 0, 0], [2, 0, 0]], [[0, 1, 2]])
    assert "no face has an area" in error_of(smoothest_field, flat, 4)


def test_a_component_far_smaller_than_the_others():
    ball = bumpy(icosphere(2))
    tiny = from_triangles([[5, 5, 5], [5 + 1e-8, 5, 5], [5, 5 + 1e-8, 5]], [[0, 1, 2]])
    field, alone = smoothest_field(joined(ball, tiny), 4), smoothest_field(ball, 4)
    assert np.isfinite(field.vectors).all()
    assert np.degrees(angle_differences(ball, field.vectors[:-1], alone.vectors, 4)).max() < 0.1


# --- rotation -----------------------------------------------------------------------------------------


@pytest.mark.parametrize("degree", range(1, 7))
def test_the_mirror_image_has_the_mirrored_field(degree):
    image = from_triangles(BALL.vertices @ MIRROR, BALL.corner_vertex.reshape(-1, 3)[:, ::-1])
    expected = smoothest_field(BALL, degree).vectors
    actual = smoothest_field(image, degree).vectors @ MIRROR
    assert np.degrees(angle_differences(BALL, actual, expected, degree).max()) < 0.1


@pytest.mark.parametrize("degree", range(1, 7))
def test_a_mirror_symmetric_surface_has_a_symmetric_field(degree):
    surface = symmetric_head()
    vectors = smoothest_field(surface, degree).vectors
    distance = cdist(surface.face_center, surface.face_center @ MIRROR)
    image = distance.argmin(axis=1)
    assert distance.min(axis=1).max() < 1e-9
    turned = angle_differences(surface, vectors[image] @ MIRROR, vectors, degree)
    assert np.degrees(turned.max()) < 0.1


@pytest.mark.parametrize("degree", [1, 2, 4])
def test_borders_and_curvature_decide(degree):
    square = smoothest_field(plane(5), degree).vectors
    if degree == 4:
        assert np.abs(square).max(axis=1) == pytest.approx(1)
    around = smoothest_field(cylinder(24, 6), degree).vectors
    if degree % 2 == 0:
        assert np.minimum(np.abs(around[:, 2]), 1 - np.abs(around[:, 2])).max() < 1e-6
