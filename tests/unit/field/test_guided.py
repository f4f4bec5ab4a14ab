"""Guided fields: exact and soft guides, edges, features, and invariance to numbering."""

import numpy as np
import pytest
import scipy.sparse as sparse
from field_helpers import angle_differences, as_scipy, bumpy
from scipy.sparse.linalg import spsolve
from shapes import cube, from_quads, grid_of_quads, icosphere, joined, plane, rebuilt, torus

from rosy_addon.field.connection import build_connection, laplacian
from rosy_addon.field.edge_guides import coherent_edge_guides
from rosy_addon.field.frames import dot, normalize
from rosy_addon.field.generate import GeneratorSettings, generate
from rosy_addon.field.guided_system import guided_field
from rosy_addon.field.guides import feature_edges, guides_from_edges
from rosy_addon.field.representation import to_representation
from rosy_addon.field.singularities import find_singularities
from rosy_addon.field.smoothest import smoothest_field
from rosy_addon.field.surface_averages import SurfaceAverages


def random_guides(surface, count, seed=0):
    """Random unit tangents on `count` random faces, zero on the others."""
    random = np.random.default_rng(seed)
    chosen = random.choice(surface.face_count, count, replace=False)
    guides = np.zeros((surface.face_count, 3))
    vectors = random.standard_normal((count, 3))
    guides[chosen] = normalize(np.cross(surface.face_normal[chosen], vectors))
    return guides


@pytest.mark.parametrize("degree", [1, 2, 3, 4, 6])
def test_hard_guides_are_met_exactly(degree):
    for surface in (bumpy(icosphere(4)), torus(40, 20)):
        guides = random_guides(surface, 12)
        hard = guides.any(axis=1)
        field = guided_field(surface, degree, guides, 0.0, hard)
        assert angle_differences(surface, field.vectors, guides, degree)[hard].max() < 1e-9
        np.testing.assert_allclose(np.linalg.norm(field.vectors, axis=1), 1, atol=1e-9)
        assert find_singularities(surface, field)[1].sum() == degree * surface.euler_characteristic


def test_soft_guides_match_a_direct_solver():
    degree, surface = 4, bumpy(icosphere(4))
    guides, weight = random_guides(surface, 30), 40.0
    x, y = surface.face_frames
    connection = build_connection(surface)
    frame_angle = SurfaceAverages(surface, connection, x, y).frame_angle
    # One row for each corner of a face with a guide, one column for each node.
    corner = np.flatnonzero(np.repeat(guides.any(axis=1), 3))
    shape = len(corner), connection.node_count
    entries = np.arange(len(corner)), connection.corner_node[corner]
    root_weight = np.sqrt(weight * np.repeat(connection.area / 3, 3)[corner])
    values = root_weight * np.exp(1j * degree * frame_angle[corner])
    transport_matrix = sparse.csr_matrix((values, entries), shape)
    target = root_weight * np.repeat(to_representation(guides, x, y, degree), 3)[corner]
    matrix = as_scipy(laplacian(connection, degree)) + transport_matrix.getH() @ transport_matrix
    z = spsolve(matrix.tocsc(), transport_matrix.getH() @ target)
    on_corner = (z[connection.corner_node] * np.exp(1j * degree * frame_angle)).reshape(-1, 3)
    actual = guided_field(surface, degree, guides, weight).vectors
    angle = np.angle(to_representation(actual, x, y, degree) * on_corner.mean(axis=1).conj())
    assert np.abs(angle).max() < 1e-5


def test_a_component_without_guides_has_the_smoothest_field():
    ball = icosphere(2)
    both = joined(ball, rebuilt(ball, ball.vertices + 5))
    guides = np.zeros((both.face_count, 3))
    guides[0] = normalize(np.cross(both.face_normal[0], [0.0, 0.0, 1.0])[None])[0]
    field = guided_field(both, 4, guides, 1.0)
    np.testing.assert_allclose(np.linalg.norm(field.vectors, axis=1), 1, atol=1e-9)
    unguided = slice(ball.face_count, None)
    assert np.array_equal(field.vectors[unguided], smoothest_field(both, 4).vectors[unguided])


def test_no_guide_at_all_is_an_error(error_of):
    assert "guides are zero" in error_of(guided_field, plane(), 4, np.zeros((16, 3)), 1.0)


# --- edges -----------------------------------------------------------------------------------------


def test_the_edges_of_a_cube_are_sharp_and_guide_all_its_faces():
    box = cube()
    ends = feature_edges(box, 0.5)
    assert len(ends) == 12
    along = np.abs(guides_from_edges(box, ends, 4)).max(axis=1)
    np.testing.assert_allclose(along, 1, atol=1e-12)
    # In degree 2 the edges of a square cancel.
    assert not guides_from_edges(box, ends, 2).any() and not len(feature_edges(box, 2.0))


def test_borders_are_features():
    square = plane(6, 6)
    ends = feature_edges(square, 0.5)
    assert len(ends) == 24
    guides = guides_from_edges(square, ends, 4)
    field = guided_field(square, 4, guides, 0.0, guides.any(axis=1))
    np.testing.assert_allclose(np.abs(field.vectors).max(axis=1), 1, atol=1e-6)


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


def test_all_edges_of_a_cube_are_followed():
    box = cube()
    ends = feature_edges(box, 1.0)
    assert (coherent_edge_guides(box, ends, 4) == guides_from_edges(box, ends, 4)).all()


def test_guides_lie_in_their_faces():
    points = np.array([[0, 0, 0], [1, 0, 0.2], [1, 1, 0], [0, 1, 0.3]], dtype=float)
    bent = from_quads(points, np.array([[0, 1, 2, 3]]))
    guides = guides_from_edges(bent, [[1, 0]], 3)
    assert abs(dot(guides, bent.face_normal)[0]) < 1e-12 and guides[0] @ [1, 0, 0] > 0.9


def test_curvature_spreads_into_flat_regions():
    """A quarter of a tube between two flat parts, which take its directions."""
    count, turns = 60, np.linspace(0, np.pi / 2, 13)
    # The tube is along y. The flat parts are three units long.
    flap = np.linspace(3, 0, 16)[:-1]
    x = np.concatenate([-flap, np.sin(turns), np.full(15, 1.0)])
    z = np.concatenate([np.full(15, 1.0), np.cos(turns), -flap[::-1]])
    y = np.linspace(0, 6, count)
    points = np.stack(np.broadcast_arrays(x[:, None], y, z[:, None]), axis=-1).reshape(-1, 3)
    quads, _ = grid_of_quads(len(x) - 1, count - 1, False, False)
    surface = from_quads(points, quads)
    flat = surface.face_center[:, 0] < -1
    assert generate(surface, "curvature", 4).magnitude[flat].max() < 1e-3
    field = generate(surface, GeneratorSettings("curvature", reach=0.05), 4)
    np.testing.assert_allclose(field.magnitude, 1, atol=1e-6)
    assert np.abs(field.vectors[flat]).max(axis=1).min() > np.cos(np.radians(1))


@pytest.mark.parametrize("degree", [1, 4, 6])
def test_features_of_a_cube(degree, error_of):
    box = icosphere(3)
    cubic = rebuilt(box, box.vertices / np.abs(box.vertices).max(axis=1)[:, None])
    field = generate(cubic, GeneratorSettings("features", sharp_angle=0.9), degree)
    # The corners are triangles, on which the field is singular by symmetry.
    assert (field.magnitude < 0.5).sum() in (0, 8)
    assert "no border or sharp edge" in error_of(generate, icosphere(3), "features", degree)
