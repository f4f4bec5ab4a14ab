"""Smoothest fields, against closed forms, SciPy and another library; awkward meshes."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.sparse as sparse
from awkward import AWKWARD
from conftest import long, mainly
from field_helpers import MESHES, angle_differences, as_scipy, bumpy
from scipy.sparse.csgraph import breadth_first_order
from scipy.sparse.linalg import eigsh, spsolve
from scipy.spatial import ConvexHull
from scipy.spatial.transform import Rotation
from shapes import from_triangles, icosphere, plane, torus

from rosy_addon.core.errors import RosyError
from rosy_addon.field.connection import build_connection, laplacian
from rosy_addon.field.frames import dot
from rosy_addon.field.singularities import find_singularities
from rosy_addon.field.smoothest import smallest_eigenvectors, smoothest_field
from rosy_addon.field.sparse_multigrid import (
    from_coo,
    hierarchy,
    matrix_product,
    w_cycle,
)
from rosy_addon.field.surface import Surface, build_surface


def random_sphere(count, seed=1):
    points = np.random.default_rng(seed).standard_normal((count, 3))
    points /= np.linalg.norm(points, axis=1)[:, None]
    triangles = ConvexHull(points).simplices
    a, b, c = points[triangles].swapaxes(0, 1)
    inward = dot(np.cross(b - a, c - a), a) < 0
    triangles[inward] = triangles[inward, ::-1]
    return from_triangles(points, triangles)


# --- matrices --------------------------------------------------------------------------------------


def random_matrix(rows, columns, seed):
    random = np.random.default_rng(seed)
    count = 4 * rows
    row = np.concatenate([np.arange(rows), random.integers(rows, size=count)])
    column = random.integers(columns, size=len(row))
    value = random.standard_normal(len(row)) + 1j * random.standard_normal(len(row))
    return from_coo(row, column, value, rows, columns)


def test_products_of_sparse_matrices():
    a, b = random_matrix(60, 40, 0), random_matrix(40, 25, 1)
    dense = as_scipy(a).toarray() @ as_scipy(b).toarray()
    np.testing.assert_allclose(as_scipy(matrix_product(a, b)).toarray(), dense, atol=1e-12)
    vector = np.arange(40) * (1 + 2j)
    np.testing.assert_allclose(a @ vector, as_scipy(a) @ vector, atol=1e-10)


def test_the_adjoint():
    a = random_matrix(60, 20, 2)
    np.testing.assert_allclose(as_scipy(a.adjoint).toarray(), as_scipy(a).toarray().conj().T)


@pytest.mark.slow
@pytest.mark.parametrize("degree", [4, *long(1, 6)])
def test_multigrid_cycles_converge(degree):
    connection = build_connection(bumpy(icosphere(5)))
    matrix = laplacian(connection, degree, 0.1)
    levels = hierarchy(matrix)
    assert len(levels) > 2
    right = np.random.default_rng(0).standard_normal(len(matrix)) + 0j
    expected = spsolve(as_scipy(matrix).tocsc(), right)
    actual = np.zeros_like(right)
    errors = []
    for _ in range(12):
        actual += w_cycle(levels, right - matrix @ actual)
        errors.append(np.linalg.norm(actual - expected))
    assert (np.array(errors[1:]) < 0.8 * np.array(errors[:-1])).all()


@pytest.mark.slow
def test_multigrid_cycles_ignore_rows_of_rounding():
    """The row of a component of tiny area can be all rounding, with 0 on the diagonal."""
    matrix = laplacian(build_connection(bumpy(icosphere(4))), 4, 0.1)
    count = len(matrix)
    with_row = from_coo(
        np.concatenate([matrix.row_indices, [count, count, 0]]),
        np.concatenate([matrix.indices, [count, 0, count]]),
        np.concatenate([matrix.data, [0, 1e-16, 1e-16]]),
        count + 1,
        count + 1,
    )
    right = np.append(np.random.default_rng(0).standard_normal(count), 0) + 0j
    solution = np.zeros_like(right)
    with np.errstate(divide="raise", invalid="raise", over="raise"):
        levels = hierarchy(with_row)
        for _ in range(12):
            solution += w_cycle(levels, right - with_row @ solution)
    assert len(levels) > 1
    expected = spsolve(as_scipy(matrix).tocsc(), right[:-1])
    assert np.linalg.norm(solution[:-1] - expected) < 0.1 * np.linalg.norm(expected)


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


def simple_shapes():
    yield "ball", bumpy(icosphere(4))
    yield "torus", bumpy(torus(60, 30))


def shapes_of_other_programs():
    for name in ("spot.obj", "vase.off", "dome.off", "cheburashka.off", "stanford-bunny.obj"):
        if (MESHES / name).exists():
            yield name, Surface(MESHES / name)


@pytest.mark.slow
@pytest.mark.parametrize("degree", [1, 4])
@pytest.mark.parametrize("shapes", [simple_shapes, *long(shapes_of_other_programs)])
def test_the_eigenvector_matches_scipy(shapes, degree):
    for name, surface in shapes():
        connection = build_connection(surface)
        z, energy = smallest_eigenvectors(connection, degree)
        below = -1e-6 / connection.mass.sum()
        actual, vectors = eigsh(
            as_scipy(laplacian(connection, degree)),
            k=2,
            M=sparse.diags(connection.mass),
            sigma=below,
        )
        order = np.argsort(actual)  # for complex matrices they are not sorted
        actual, vectors = actual[order], vectors[:, order]
        assert energy[0] == pytest.approx(actual[0], rel=1e-4), name
        if actual[1] > 1.03 * actual[0]:
            overlap = np.abs(np.vdot(vectors[:, 0], connection.mass * z))
            assert overlap / np.sqrt(connection.mass @ np.abs(z) ** 2) > 1 - 1e-5, name


@pytest.mark.parametrize("degree", [1, 4, *long(2, 6)])
def test_the_field_matches_another_library(degree):
    """The connection Laplacian of geometry-central, raised to N, has the same smallest eigenvector.

    It flips edges to be Delaunay, and treats borders differently, so the mesh is closed and Delaunay.
    """
    potpourri3d = pytest.importorskip("potpourri3d")
    surface = bumpy(icosphere(4), 0.08, (1.0, 1.05, 1.1))
    triangles = surface.corner_vertex.reshape(-1, 3)
    connection = build_connection(surface)
    assert connection.weight.min() > 0
    vertex = np.empty(connection.node_count, dtype=int)
    vertex[connection.corner_node] = triangles.ravel()
    solver = potpourri3d.MeshVectorHeatSolver(surface.vertices, triangles)
    their_laplacian = sparse.csr_matrix(solver.get_connection_laplacian())
    tail, head = vertex[connection.tail], vertex[connection.head]
    entry = np.asarray(their_laplacian[tail, head]).ravel()
    np.testing.assert_allclose(np.abs(entry), connection.weight, rtol=1e-6)

    # Their frames differ from ours by an angle at each vertex, found along a tree of edges.
    count = connection.node_count
    ends = np.concatenate([tail, head]), np.concatenate([head, tail])
    ratio = -entry / np.abs(entry) * np.exp(-1j * connection.transport_angle)
    differences = sparse.csr_matrix((np.concatenate([ratio, ratio.conj()]), ends), (count, count))
    frames = np.ones(count, dtype=complex)
    order, predecessor = breadth_first_order(abs(differences), 0, directed=False)
    ours = sparse.csr_matrix(
        (
            np.exp(1j * np.concatenate([connection.transport_angle, -connection.transport_angle])),
            ends,
        ),
        (count, count),
    )
    for vertex_index in order[1:]:
        our_transport = ours[vertex_index, predecessor[vertex_index]]
        difference = differences[vertex_index, predecessor[vertex_index]] * our_transport
        frames[vertex_index] = difference * frames[predecessor[vertex_index]] * our_transport.conj()
    their_transport = frames[tail] * np.exp(1j * connection.transport_angle) * frames[head].conj()
    np.testing.assert_allclose(-entry / np.abs(entry), their_transport, atol=1e-6)

    raised_transport = np.concatenate([their_transport**degree, their_transport.conj() ** degree])
    weight = np.tile(np.abs(entry), 2)
    raised = sparse.diags(their_laplacian.diagonal()) - sparse.csr_matrix(
        (weight * raised_transport, ends)
    )
    mass = np.empty(count)
    mass[vertex] = connection.mass
    actual, vectors = eigsh(raised, k=2, M=sparse.diags(mass), sigma=-1e-6)
    expected = vectors[:, np.argmin(actual)]
    z, energy = smallest_eigenvectors(connection, degree)
    assert energy[0] == pytest.approx(actual.min(), rel=1e-5)
    our_z = np.empty(count, dtype=complex)
    our_z[vertex] = z
    z_ratio = our_z * frames**degree * expected.conj()
    z_ratio *= np.conj(z_ratio.sum()) / abs(z_ratio.sum())
    # Close to singularities both vectors are small, so their angles are arbitrary.
    clear = np.abs(our_z) > 0.02 * np.abs(our_z).max()
    assert clear.mean() > 0.9
    assert np.degrees(np.abs(np.angle(z_ratio[clear]))).max() / degree < 1


@pytest.mark.slow
@pytest.mark.parametrize("degree", mainly([1, 2, 4, 6, 12], range(1, 13)))
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
    triangles = surface.corner_vertex.reshape(-1, 3)

    order = np.random.default_rng(5).permutation(len(surface.vertices))
    new_index = np.argsort(order)
    renumbered = from_triangles(surface.vertices[order], new_index[triangles])
    actual = smoothest_field(renumbered, degree).vectors
    assert angle_differences(surface, actual, expected, degree).max() < 1e-5

    rolled = from_triangles(surface.vertices, np.roll(triangles, 1, axis=1))
    actual = smoothest_field(rolled, degree).vectors
    assert angle_differences(surface, actual, expected, degree).max() < 1e-5

    rotation = Rotation.from_rotvec([0.3, 1.0, -0.4]).as_matrix()
    moved = from_triangles(3 * surface.vertices @ rotation.T + (1, 2, 3), triangles)
    actual = smoothest_field(moved, degree).vectors @ rotation
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


@pytest.mark.slow
@pytest.mark.parametrize("degree", [1, 4, *long(3, 12)])
@pytest.mark.parametrize("name", AWKWARD)
def test_meshes_that_are_not_closed_smooth_manifolds(name, degree):
    points, faces = AWKWARD[name]()
    starts = np.cumsum([0, *map(len, faces)])
    surface = build_surface(points, np.concatenate(faces), starts)
    field = smoothest_field(surface, degree)
    length = np.linalg.norm(field.vectors, axis=1)
    has_area = surface.face_normal.any(axis=1)
    np.testing.assert_allclose(length, has_area, atol=1e-6)
    assert np.abs(dot(field.vectors, surface.face_normal)).max() < 1e-6


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
