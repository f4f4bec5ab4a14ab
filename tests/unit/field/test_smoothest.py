"""Smoothest fields, against closed forms, SciPy and another library; awkward meshes."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.sparse as sparse
from field_helpers import angle_differences, as_scipy, bumpy, copies_of
from scipy.sparse.linalg import eigsh
from scipy.spatial import ConvexHull
from shapes import from_triangles, icosphere, plane, torus

from rosy_addon.core.errors import RosyError
from rosy_addon.field.connection import build_connection, laplacian
from rosy_addon.field.frames import dot
from rosy_addon.field.singularities import find_singularities
from rosy_addon.field.smoothest import smallest_eigenvectors, smoothest_field
from rosy_addon.field.surface import build_surface

BALL = bumpy(icosphere(4))


def random_sphere(count, seed=1):
    points = np.random.default_rng(seed).standard_normal((count, 3))
    points /= np.linalg.norm(points, axis=1)[:, None]
    triangles = ConvexHull(points).simplices
    a, b, c = points[triangles].swapaxes(0, 1)
    inward = dot(np.cross(b - a, c - a), a) < 0
    triangles[inward] = triangles[inward, ::-1]
    return from_triangles(points, triangles)


# --- the connection --------------------------------------------------------------------------------


@pytest.mark.parametrize("degree", [1, 4, 7])
def test_a_constant_direction_in_the_plane_has_no_energy(degree):
    surface = plane(6)
    random = np.random.default_rng(3)
    is_interior = np.abs(surface.vertices).max(axis=1) < np.abs(surface.vertices).max() - 1e-9
    moved = surface.vertices + is_interior[:, None] * (0.05, 0.05, 0) * random.standard_normal(
        (1, 3)
    )
    surface = build_surface(moved, surface.corner_vertex, surface.face_start)
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
    bowtie = from_triangles(
        [[0, 0, 0], [1, 0, 0], [1, 1, 0], [-1, 0, 0], [-1, -1, 0]], [[0, 1, 2], [0, 3, 4]]
    )
    assert build_connection(bowtie).node_count == 6


# --- fields ----------------------------------------------------------------------------------------


@pytest.mark.slow
def test_energies_on_the_unit_sphere():
    """The smallest eigenvalue on the round sphere is N."""
    connection = build_connection(random_sphere(10_000))
    for degree in (1, 4):
        _, energy = smallest_eigenvectors(connection, degree)
        assert energy == pytest.approx(degree, rel=0.01)


@pytest.mark.slow
@pytest.mark.parametrize("degree", [1, 4])
@pytest.mark.parametrize("surface", [BALL, bumpy(torus(60, 30))], ids=["ball", "torus"])
def test_the_eigenvector_matches_scipy(surface, degree):
    connection = build_connection(surface)
    z, energy = smallest_eigenvectors(connection, degree)
    matrix, mass = as_scipy(laplacian(connection, degree)), sparse.diags(connection.mass)
    actual, vectors = eigsh(matrix, k=2, M=mass, sigma=-1e-6 / connection.mass.sum())
    order = np.argsort(actual)  # for complex matrices they are not sorted
    actual, vectors = actual[order], vectors[:, order]
    assert energy[0] == pytest.approx(actual[0], rel=1e-4)
    assert actual[1] > 1.03 * actual[0]
    overlap = np.abs(np.vdot(vectors[:, 0], connection.mass * z))
    assert overlap / np.sqrt(connection.mass @ np.abs(z) ** 2) > 1 - 1e-5


@pytest.mark.parametrize("degree", [1, 2, 4, 6])
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
    vertex = np.empty(connection.node_count, dtype=int)
    vertex[connection.corner_node] = triangles.ravel()
    mass[vertex] = connection.mass
    raised = sparse.csr_matrix((value, (theirs.row, theirs.col)))
    expected = eigsh(raised, k=1, M=sparse.diags(mass), sigma=-1e-6)[0]
    _, energy = smallest_eigenvectors(connection, degree)
    assert energy == pytest.approx(expected, rel=1e-5)


@pytest.mark.slow
@pytest.mark.parametrize("degree", [1, 2, 4, 6, 12])
def test_indices_sum_to_the_euler_characteristic(degree):
    for surface in (icosphere(3), torus(30, 16), bumpy(icosphere(3))):
        _, index = find_singularities(surface, smoothest_field(surface, degree))
        assert index.sum() == degree * surface.euler_characteristic


@pytest.mark.parametrize("degree", range(1, 7))
def test_a_sphere_has_the_fewest_possible_singularities(degree):
    _, index = find_singularities(icosphere(4), smoothest_field(icosphere(4), degree))
    assert (index == 1).all()
    assert len(index) == 2 * degree


@pytest.mark.slow
@pytest.mark.parametrize("degree", [2, 4, 5])
def test_the_field_does_not_depend_on_numbering_or_position(degree):
    surface = bumpy(icosphere(3))
    expected = smoothest_field(surface, degree).vectors
    for mesh, rotation in copies_of(surface):
        actual = smoothest_field(mesh, degree).vectors @ rotation
        assert angle_differences(surface, actual, expected, degree).max() < 1e-5


def test_each_component_has_its_own_field():
    first, second = bumpy(icosphere(3)), bumpy(torus(24, 12))
    points = np.concatenate([first.vertices, 0.3 * second.vertices + 5])
    corners = np.concatenate([first.corner_vertex, second.corner_vertex + len(first.vertices)])
    starts = np.concatenate([first.face_start, second.face_start[1:] + first.face_start[-1]])
    both = build_connection(build_surface(points, corners, starts))
    _, energy = smallest_eigenvectors(both, 4)
    separately = [
        smallest_eigenvectors(build_connection(surface), 4)[1][0] for surface in (first, second)
    ]
    np.testing.assert_allclose(energy, [separately[0], separately[1] / 0.09], rtol=1e-4)


def test_no_area_at_all_is_an_error():
    flat = from_triangles([[0, 0, 0], [1, 0, 0], [2, 0, 0]], [[0, 1, 2]])
    with pytest.raises(RosyError, match="no face has an area"):
        smoothest_field(flat, 4)


def test_a_component_far_smaller_than_the_others():
    ball = bumpy(icosphere(2))
    tiny = np.array([[5, 5, 5], [5 + 1e-8, 5, 5], [5, 5 + 1e-8, 5]])
    surface = build_surface(
        np.concatenate([ball.vertices, tiny]),
        np.concatenate([ball.corner_vertex, len(ball.vertices) + np.arange(3)]),
        np.concatenate([ball.face_start, [ball.face_start[-1] + 3]]),
    )
    field, alone = smoothest_field(surface, 4), smoothest_field(ball, 4)
    assert np.isfinite(field.vectors).all()
    assert np.degrees(angle_differences(ball, field.vectors[:-1], alone.vectors, 4)).max() < 0.1
