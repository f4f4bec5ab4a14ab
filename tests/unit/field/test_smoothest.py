"""Smoothest fields, against closed forms, random starts, mirror images and another library."""

import awkward
import numpy as np
import pytest
import scipy.sparse as sparse
from field_helpers import angle_differences, bumpy, symmetric_head
from scipy.optimize import minimize
from scipy.sparse.linalg import eigsh
from scipy.spatial.distance import cdist
from shapes import (
    cube,
    cylinder,
    from_quads,
    from_triangles,
    icosphere,
    joined,
    plane,
    rebuilt,
    tetrahedron,
    torus,
    walls_of,
)

from rosy_addon.core.errors import RosyError
from rosy_addon.field import smoothest
from rosy_addon.field.analysis import dirichlet_energy
from rosy_addon.field.connection import build_connection, laplacian
from rosy_addon.field.generate import generate
from rosy_addon.field.singularities import find_singularities
from rosy_addon.field.smoothest import eigenproblem, smoothest_field, spectral_shift
from rosy_addon.field.unit_descent import face_energy

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
    assert build_connection(from_triangles(points, [[0, 1, 2], [0, 3, 4]])).node_count == 6


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
    both = joined(ball, tiny)
    field, alone = smoothest_field(both, 4), smoothest_field(ball, 4)
    assert np.isfinite(field.vectors).all()
    assert dirichlet_energy(both, field) == pytest.approx(dirichlet_energy(ball, alone), rel=0.02)


# --- rotation -----------------------------------------------------------------------------------------


@pytest.mark.parametrize("degree", range(1, 7))
def test_the_mirror_image_has_the_mirrored_field(degree):
    image = from_triangles(BALL.vertices @ MIRROR, BALL.corner_vertex.reshape(-1, 3)[:, ::-1])
    expected = smoothest_field(BALL, degree).vectors
    actual = smoothest_field(image, degree).vectors @ MIRROR
    assert np.degrees(angle_differences(BALL, actual, expected, degree).max()) < 0.1


@pytest.mark.parametrize("degree", [1, 2, 3, 6])
def test_a_mirror_symmetric_surface_has_a_symmetric_field(degree):
    """In degrees 4 and 5, an asymmetric field has 4 % less energy on this head."""
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


# --- energy ---------------------------------------------------------------------------------------

CUBE_OF_TRIANGLES = from_triangles(cube().vertices, cube().triangle_vertex)
OCTAHEDRON = from_triangles(*awkward.octahedron())


@pytest.mark.parametrize(
    ("surface", "degree", "index"),
    [
        (cube(), 4, [1] * 8),
        (CUBE_OF_TRIANGLES, 4, [1] * 8),
        (OCTAHEDRON, 3, [1] * 6),
        (OCTAHEDRON, 6, [2] * 6),
        (tetrahedron(), 4, [2] * 4),
    ],
)
def test_fields_that_turn_nowhere(surface, degree, index):
    """The angle defect of each vertex is a multiple of 2 pi / N: such a field has no energy."""
    field = smoothest_field(surface, degree)
    assert dirichlet_energy(surface, field) == pytest.approx(0, abs=1e-6)
    assert find_singularities(surface, field)[1].tolist() == index


@pytest.mark.parametrize("degree", [1, 2, 4, 6])
@pytest.mark.parametrize("subdivisions", [0, 1, 2])
def test_no_random_start_has_less_energy(degree, subdivisions):
    surface = bumpy(icosphere(subdivisions))
    energy = face_energy(surface, degree, np.ones(surface.face_count, dtype=bool))

    def value(angle):
        products = energy.products(np.exp(1j * angle))
        return 2 * (energy.weight - products.real).sum(), 2 * energy.sums(products.imag)

    random = np.random.default_rng(1)
    starts = random.uniform(0, 2 * np.pi, (20, surface.face_count))
    least = min(minimize(value, start, jac=True, method="L-BFGS-B").fun for start in starts)
    assert dirichlet_energy(surface, smoothest_field(surface, degree)) <= 1.001 * least + 1e-6


@pytest.mark.parametrize(("degree", "least"), [(2, 60.0819), (4, 0.0)])
def test_a_frame_of_few_quads(degree, least):
    """Genus 2. The least energy of 90 random starts; degree 4 turns nowhere, as angle defects are multiples of 90."""
    solid = np.ones((9, 7, 2), dtype=bool)
    solid[[2, 3, 5, 6], 2:5] = False
    frame = from_quads(*walls_of(solid))
    assert frame.face_count == 206 and frame.euler_characteristic == -2
    assert dirichlet_energy(frame, smoothest_field(frame, degree)) <= 1.001 * least + 1e-6


def test_another_eigenvector_gives_less_energy():
    """From the second one, the field has no singularities. From the first, it has four, and an energy of 73."""
    surface = bumpy(torus(60, 30))
    field = smoothest_field(surface, 2)
    assert dirichlet_energy(surface, field) < 41
    assert not len(find_singularities(surface, field)[0])


@pytest.mark.slow
def test_coarse_start_reaches_the_energy_of_a_fine_one(monkeypatch):
    """The search starts on a coarse multigrid level."""
    surface = bumpy(icosphere(3))
    energies = []
    for unknowns in (smoothest.START_UNKNOWNS, 50_000):
        monkeypatch.setattr(smoothest, "START_UNKNOWNS", unknowns)
        energies.append(dirichlet_energy(surface, smoothest_field(surface, 4)))
    assert energies[0] < 1.02 * energies[1]


@pytest.mark.slow
@pytest.mark.parametrize("degree", [2, 4])
@pytest.mark.parametrize(
    "surface",
    [bumpy(icosphere(4)), bumpy(torus(60, 30)), joined(icosphere(3), torus())],
    ids=["ball", "torus", "both"],
)
def test_no_other_kind_has_less_energy(surface, degree):
    energy = dirichlet_energy(surface, smoothest_field(surface, degree))
    for kind in ("form", "curvature", "features"):
        try:
            other = generate(surface, kind, degree)
        except RosyError:  # no sharp edge
            continue
        assert energy <= 1.001 * dirichlet_energy(surface, other)


def test_parts_of_very_different_sizes_are_solved_alone():
    """Diffusion times are relative to the area of each component."""
    ball = bumpy(icosphere(3))
    alone = dirichlet_energy(ball, smoothest_field(ball, 4))
    both = joined(ball, rebuilt(ball, 1e-3 * ball.vertices + 9))
    assert dirichlet_energy(both, smoothest_field(both, 4)) == pytest.approx(2 * alone, rel=0.04)


def test_slivers_do_not_hide_other_faces():
    """Half of the edges are those of slivers, whose height is a rounding error. The search ends."""
    x, y, z = 2.942049503326416, 2.4556283950805664, 2.0361483097076416
    corners = cube().vertices * (x, y, z)
    line = np.outer(range(1, 5), np.float32([-0.0346824, 0.05744636, 0.0728727]))
    slivers = [[0, 8, 9], [0, 9, 10], [0, 10, 11]]
    triangles = [[0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], *slivers]
    surface = from_triangles(np.concatenate([corners, line]), triangles)
    assert generate(surface, "form", 4).vectors[:4].any(axis=1).all()
