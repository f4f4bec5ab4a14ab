"""Fields that follow the form, against closed forms, with noise, and on the first meshes people try."""

from dataclasses import replace

import numpy as np
import pytest
from field_helpers import cross_errors, ellipsoid
from shapes import cube, cylinder, icosphere, plane, rebuilt, roughened, torus

from rosy_addon.field.analysis import dirichlet_energy
from rosy_addon.field.connection import build_connection
from rosy_addon.field.creases import filtered_normals, principal_extent, salient_edges
from rosy_addon.field.feature_curvature import noise_sample
from rosy_addon.field.frames import dot, normalize
from rosy_addon.field.generate import generate
from rosy_addon.field.guides import feature_edges
from rosy_addon.field.singularities import find_singularities
from rosy_addon.field.surface import Surface
from rosy_addon.field.surface_averages import SurfaceAverages

AXES = np.array([1.0, 0.8, 0.6])

#: Half a turn about x.
OVER = np.diag([1.0, -1.0, -1.0])

#: Angle from which a single edge counts as sharp.
SHARP_EDGE = np.radians(30)


def with_noise(surface: Surface, share: float) -> Surface:
    """Displace the vertices along their normals by a share of the diagonal of the bounding box."""
    return roughened(surface, share * np.linalg.norm(np.ptp(surface.vertices, axis=0)))


def direction_on_torus(center: np.ndarray) -> np.ndarray:
    return normalize(np.cross((0, 0, 1), center))


def direction_on_ellipsoid(center: np.ndarray) -> np.ndarray:
    """A principal direction, an eigenvector of the tangential part of the Hessian of the quadric."""
    normal = normalize(center / AXES**2)
    tangential = np.eye(3) - normal[:, :, None] * normal[:, None, :]
    operator = tangential @ np.diag(1 / AXES**2) @ tangential
    return np.linalg.eigh(operator)[1][:, :, 2]  # the normal has the eigenvalue 0, the smallest


def salient(surface: Surface) -> np.ndarray:
    return salient_edges(surface, *filtered_normals(surface))


@pytest.mark.slow
@pytest.mark.parametrize("form, share, bound", [("torus", 0.002, 4.0), ("ellipsoid", 0.0, 0.5)])
def test_principal_directions_with_noise(form, share, bound):
    surface = torus(200, 100) if form == "torus" else ellipsoid(5)
    surface = with_noise(surface, share) if share else surface
    field = generate(surface, "form", 4)
    center = surface.face_center
    expected = direction_on_torus(center) if form == "torus" else direction_on_ellipsoid(center)
    assert np.median(cross_errors(surface, field.vectors, expected)) <= bound


def test_lines_run_around_a_torus_tube():
    """In the direction of the greater curvature, where both principal directions are clear."""
    surface = torus()
    field = generate(surface, "form", 2)
    outside = np.hypot(*surface.face_center[:, :2].T) > 1
    assert np.abs(dot(field.vectors, direction_on_torus(surface.face_center)))[outside].max() < 0.02


def test_noise_is_measured():
    for surface, share in ((torus(200, 100), 0.002), (ellipsoid(5), 0.0005)):
        noisy = with_noise(surface, share)
        _, angle = filtered_normals(noisy)
        sample = noise_sample(noisy, angle)
        expected = share * np.linalg.norm(np.ptp(surface.vertices, axis=0))
        assert np.sqrt(dot(sample, sample).mean()) == pytest.approx(expected, rel=0.2)


@pytest.mark.slow
def test_a_ball_has_no_clear_direction():
    ball = icosphere(4)
    assert (generate(ball, "form", 4).vectors == generate(ball, "smoothest", 4).vectors).all()


@pytest.mark.parametrize("share", [0.0005, 0.002])
def test_a_noisy_ball_has_as_few_singularities_as_possible(share):
    ball = with_noise(icosphere(4), share)
    vertices, index = find_singularities(ball, generate(ball, "form", 4))
    assert len(vertices) == 8 and (index == 1).all()


@pytest.mark.parametrize("surface", [cube(), plane(8, 8)], ids=["cube", "plane"])
def test_the_field_follows_sharp_edges_and_borders(surface):
    members = np.sort(np.abs(generate(surface, "form", 4).vectors), axis=1)
    np.testing.assert_allclose(members, [[0, 0, 1]] * surface.face_count, atol=1e-9)


def test_salient_edges():
    """All edges of a cube, the border of an open tube but none of its eight edges, none of noise."""
    assert len(salient(cube())) == 12
    tube = cylinder(8, 3)
    border = salient(tube)
    assert len(border) == 16 and len(np.unique(tube.vertices[border.ravel(), 2])) == 2
    assert len(salient(icosphere(1))) == 0 and len(salient(with_noise(torus(200, 100), 0.001))) == 0


def three_cylinders(count: int) -> Surface:
    """The intersection of three cylinders of radius 1: the sides of a cube, projected from its center.

    Each side is a grid, and the diagonals of its quads continue the sharp edges.
    """
    t = np.tan(np.linspace(-np.pi / 4, np.pi / 4, count + 1))
    top = np.stack([*np.meshgrid(t, t, indexing="ij"), np.ones((count + 1,) * 2)], axis=-1)
    i, j = np.divmod(np.arange(count**2), count)
    a = i * (count + 1) + j
    b, c, d = a + count + 1, a + count + 2, a + 1
    is_rising = ((2 * i + 1 - count) * (2 * j + 1 - count) > 0)[:, None]
    first = np.where(is_rising, np.stack([a, b, c], axis=1), np.stack([a, b, d], axis=1))
    second = np.where(is_rising, np.stack([a, c, d], axis=1), np.stack([b, c, d], axis=1))
    turns = [over @ np.roll(np.eye(3), k, 0) for k in range(3) for over in (np.eye(3), OVER)]
    points = np.concatenate([top.reshape(-1, 3) @ turn for turn in turns])
    triangles = np.concatenate([first, second])
    triangles = np.concatenate([triangles + k * top[..., 0].size for k in range(6)])
    _, kept, vertex = np.unique(points.round(6), axis=0, return_index=True, return_inverse=True)
    points = points[kept]
    square = points**2
    radius = np.sqrt((square.sum(axis=1)[:, None] - square).max(axis=1))
    return Surface(points / radius[:, None], vertex.ravel()[triangles])


def test_edges_that_fade_where_cylinders_intersect():
    """One singularity at each corner, where three cylinders meet, as for a field along the edges alone.

    The cylinders curve along the diagonals of their parts, at 45 degrees to the edges. Toward the six other
    corners, the edges are less and less sharp.
    """
    surface = three_cylinders(20)
    assert surface.euler_characteristic == 2
    expected = {tuple(np.sort(ends)) for ends in feature_edges(surface, SHARP_EDGE)}
    assert {tuple(np.sort(ends)) for ends in salient(surface)} == expected
    field = generate(surface, "form", 4)
    vertices, index = find_singularities(surface, field)
    np.testing.assert_allclose(np.abs(surface.vertices[vertices]), 0.5**0.5, atol=1e-6)
    assert len(vertices) == 8 and (index == 1).all()
    features = generate(surface, "features", 4)
    assert dirichlet_energy(surface, field) < 1.05 * dirichlet_energy(surface, features)


@pytest.mark.parametrize("degree", [1, 3, 6])
def test_other_degrees_are_smoothest(degree):
    surface = torus(24, 12)
    smoothest = generate(surface, "smoothest", degree)
    assert (generate(surface, "form", degree).vectors == smoothest.vectors).all()


def test_the_principal_extent():
    """That of a sphere is its diameter, that of a square its side, however they are turned or divided."""
    assert principal_extent(icosphere(4)) == pytest.approx(2, rel=1e-3)
    turn, _ = np.linalg.qr(np.random.default_rng(1).standard_normal((3, 3)))
    for square in (plane(1, 1), plane(7, 3)):
        for linear in (np.eye(3), turn):
            side = np.ptp(square.vertices[:, 0])
            turned = rebuilt(square, square.vertices @ linear + 5)
            assert principal_extent(turned) == pytest.approx(side)


def averages_of(surface: Surface) -> SurfaceAverages:
    return SurfaceAverages(surface, build_connection(surface), *surface.face_frames)


def test_averages_of_numbers_below_all_normal_ones():
    """They are 0, without an overflow of their inverse."""
    averages = averages_of(icosphere(1))
    sums = averages.node_sums(np.full(averages.surface.face_count, 1e-320), 0)
    assert sums.any() and not averages.smooth(averages.laplacian(0), 0.1, sums).any()


def test_averages_with_an_indefinite_matrix():
    """Obtuse triangles have negative weights: conjugate gradients end at their last good step."""
    averages = averages_of(icosphere(0))
    # With unit masses, five neighbors and 4 on the diagonal, the sum of every row is 0.
    matrix = averages.laplacian(0)
    matrix = replace(matrix, data=np.where(matrix.data > 0, 4.0, -1.0).astype(np.float32))
    mass = averages.connection.positive_mass
    assert not averages.smooth(matrix, float(mass.mean()), np.ones(len(mass))).any()
