"""Evenly spaced lines on surfaces: distances, directions, and meshes that are not simple."""

import numpy as np
import pytest
from awkward import AWKWARD
from field_helpers import awkward_surface
from scipy.spatial import cKDTree
from shapes import (
    cylinder,
    from_quads,
    icosphere,
    joined,
    placed,
    plane,
    rebuilt,
    sharp_cube,
    torus,
)

from rosy_addon.core.cache import Cache
from rosy_addon.field.directional_field import field_from_directions
from rosy_addon.field.generate import axis_field, generate
from rosy_addon.field.surface import Surface
from rosy_addon.projection.gbuffer import MeshInstance
from rosy_addon.projection.surface_lines import cached_surface_lines, rest_matrix, surface_lines

#: Part of the surface on which distances between lines differ by at most `TOLERANCE`.
SHARE, TOLERANCE = 0.95, 0.1


def lines_of(surface, field, spacing, stretch=None, display="smooth"):
    stretch = np.eye(3) if stretch is None else stretch
    return surface_lines(surface, stretch, field, display, spacing)


def gradients(lines):
    """(L, M, 3) gradients of the phases in the triangles, in lines per unit of length."""
    points = lines.tree.vertices[lines.tree.leaf_vertex]
    sides = points[:, 1:] - points[:, :1]
    change = lines.pattern.phase[..., 1:].astype(float) - lines.pattern.phase[..., :1]
    return np.einsum("lia,lma->lmi", np.linalg.pinv(sides), change)


def spacing_ratios(lines, spacing):
    """(L, M) distances between lines in the triangles, relative to the one asked for."""
    gradient = np.linalg.norm(gradients(lines), axis=2)
    return 1 / (np.maximum(gradient, 1e-15) * spacing)  # 0 where the field is undefined


def share_within(lines, spacing, tolerance=TOLERANCE):
    """The share of the area, for the worst family, where lines have the spacing.

    Triangles that are nearer to the end of a line than the spacing are left out.
    """
    ratio = spacing_ratios(lines, spacing)
    points = lines.tree.vertices[lines.tree.leaf_vertex]
    sides, center = points[:, 1:] - points[:, :1], points.mean(axis=1)
    area = np.linalg.norm(np.cross(sides[:, 0], sides[:, 1]), axis=1) / 2
    ends = center[(lines.pattern.index != 0).any(axis=1)]
    is_far = cKDTree(ends.reshape(-1, 3)).query(center)[0] > spacing
    assert area[is_far].sum() > 0.4 * area.sum()
    is_even = np.abs(ratio[is_far] - 1) <= tolerance
    return (is_even * area[is_far, None]).sum(axis=0).min() / area[is_far].sum()


# --- closed forms --------------------------------------------------------------------------------


@pytest.mark.parametrize("degree", [1, 2, 3, 4, 5, 6])
@pytest.mark.parametrize("display", ["smooth", "flat"])
def test_lines_on_a_plane_are_straight_and_exactly_spaced(degree, display):
    angle, spacing = 0.35, 0.083
    surface = plane()
    field = axis_field(surface, degree, (np.cos(angle), np.sin(angle), 0))
    lines = lines_of(surface, field, spacing, display=display)
    assert not lines.pattern.index.any()
    gradient = gradients(lines)
    directions = angle + 2 * np.pi * np.arange(degree) / degree
    across = np.stack([-np.sin(directions), np.cos(directions), 0 * directions], axis=1) / spacing
    # The families can begin with any direction, but are in counter-clockwise order.
    families = lines.pattern.index.shape[1]
    assert families == (degree // 2 if degree % 2 == 0 else degree)
    for triangle in gradient:
        rolled = [np.roll(across, shift, axis=0)[:families] for shift in range(degree)]
        errors = [np.abs(triangle - each).max() for each in rolled]
        assert min(errors) < 1e-3 / spacing


@pytest.mark.slow
@pytest.mark.parametrize("rounds", [7, 7.4, 30.5])
def test_lines_along_a_cylinder(rounds):
    """Lines parallel to the axis can only be evenly spaced if a whole number of them fits around."""
    surface = cylinder()
    spacing = 2 * np.pi / rounds
    lines = lines_of(surface, axis_field(surface, 2), spacing)
    ratio = spacing_ratios(lines, spacing)
    circumference = 2 * 96 * np.sin(np.pi / 96)
    count = circumference / spacing / ratio.mean()
    assert abs(count - np.rint(count)) < 0.02 and abs(count - rounds) < 1
    np.testing.assert_allclose(ratio, ratio.mean(), atol=0.02)


@pytest.mark.slow
@pytest.mark.parametrize(("degree", "size"), [(2, 1.0), (4, 1.0), (4, 1e-6), (4, 1e6)])
def test_rings_on_a_torus_of_any_size(degree, size):
    surface = rebuilt(torus(), torus().vertices * size)
    lines = lines_of(surface, generate(surface, "curvature", degree), 0.06 * size)
    assert share_within(lines, 0.06 * size) >= SHARE


@pytest.mark.slow
def test_distances_are_measured_after_the_stretch():
    surface = plane()
    stretch = np.diag([1.0, 3.0, 1.0])
    lines = lines_of(surface, axis_field(surface, 4, (1, 0, 0)), 0.1, stretch)
    ratio = spacing_ratios(lines, 0.1)  # `vertices` of the tree are stretched
    np.testing.assert_allclose(ratio, 1, atol=1e-3)


# --- curved surfaces -----------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize("degree", [1, 3, 4])
def test_distances_on_a_sphere(degree):
    """There are singularities, and lines end because they converge."""
    surface = icosphere(3)
    lines = lines_of(surface, generate(surface, "smoothest", degree), 0.07)
    assert lines.pattern.index.any() and share_within(lines, 0.07) >= SHARE


@pytest.mark.slow
def test_distances_on_a_mesh_of_others(shared_data):
    surface = Surface(shared_data / "meshes" / "spot.obj")
    lines = lines_of(surface, generate(surface, "form", 4), 0.015)
    assert share_within(lines, 0.015) >= SHARE


def test_phases_are_continuous_where_lines_end():
    """Along the edges of neighboring triangles, apart from the orientation of the family."""
    surface = icosphere(2)
    lines = lines_of(surface, generate(surface, "smoothest", 2), 0.1)
    vertex = lines.tree.leaf_vertex
    assert np.abs(lines.pattern.index).max() == 1
    # The middles of all edges, evaluated in both triangles.
    edges, values = [], []
    for corner, following in ((0, 1), (1, 2), (2, 0)):
        weights = np.zeros((3, len(vertex)), dtype=np.float32)
        weights[[corner, following]] = 0.5
        triangles = np.arange(len(vertex))
        phase = lines.pattern.evaluate(triangles, weights, np.zeros(len(vertex), dtype=int))
        values.append(np.abs(phase - np.rint(phase)))
        edges.append(np.sort(vertex[:, [corner, following]], axis=1))
    edges = np.concatenate(edges)
    _, edge, count = np.unique(edges, axis=0, return_inverse=True, return_counts=True)
    assert (count == 2).all()
    pairs = np.concatenate(values)[np.argsort(edge)].reshape(-1, 2)
    # Around the singular vertices, triangles have phases of their own.
    assert np.mean(np.abs(pairs[:, 0] - pairs[:, 1]) > 1e-3) < 0.005


@pytest.mark.slow
def test_lines_continue_over_a_coarse_cube():
    """Eight vertices. Form follows the edges, and lines of faces meet there."""
    surface = sharp_cube()
    lines = lines_of(surface, generate(surface, "form", 4), 0.04)
    assert len(lines.tree.leaf_root) > 1000 and share_within(lines, 0.04, 0.02) >= SHARE
    assert not lines.pattern.index.any()


@pytest.mark.slow
def test_directions_that_are_not_evenly_distributed():
    """The lines of two directions at 60 degrees have the distance that was asked for."""
    surface = plane()
    angles = np.array([0.2, 0.2 + np.pi / 3])
    half = np.stack([np.cos(angles), np.sin(angles), 0 * angles], axis=1)
    directions = np.broadcast_to(np.concatenate([half, -half]), (surface.face_count, 4, 3))
    lines = lines_of(surface, field_from_directions(surface, directions), 0.05)
    ratio = spacing_ratios(lines, 0.05)
    np.testing.assert_allclose(ratio, 1, atol=5e-3)
    gradient = gradients(lines)
    cosine = np.abs(np.einsum("li,li->l", gradient[:, 0], gradient[:, 1])) * 0.05**2
    np.testing.assert_allclose(cosine, 0.5, atol=0.01)


# --- awkward meshes ------------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize("name", AWKWARD)
@pytest.mark.parametrize("degree", [1, 4])
def test_awkward_meshes(name, degree):
    surface = awkward_surface(name)
    field = generate(surface, "smoothest", degree)
    lines = lines_of(surface, field, 0.11)
    assert np.isfinite(lines.pattern.phase).all() and np.isfinite(lines.heading).all()


@pytest.mark.slow
def test_a_hole_unused_vertices_and_two_parts():
    """A plane without one face, and another that is not connected to it."""
    surface = plane(8, 8)
    quads = np.delete(surface.corner_vertex.reshape(-1, 4), 27, axis=0)
    points = np.concatenate([surface.vertices, np.full((119, 3), 1e3)])
    both = joined(from_quads(points, quads), rebuilt(surface, surface.vertices + (5, 0, 1)))
    lines = lines_of(both, axis_field(both, 4, (1, 0.5, 0)), 0.07)
    ratio = spacing_ratios(lines, 0.07)
    np.testing.assert_allclose(ratio, 1, atol=1e-3)


def test_undefined_faces_have_no_lines():
    surface = icosphere(2)
    field = axis_field(surface, 4)
    vectors = field.vectors.copy()
    vectors[::7] = 0
    lines = lines_of(surface, type(field)(4, vectors), 0.1)
    undefined = np.isin(lines.tree.leaf_root, np.arange(0, surface.face_count, 7))
    assert np.isfinite(lines.pattern.phase).all()
    assert not lines.heading[:, undefined].any() and lines.heading[:, ~undefined].any(axis=0).all()
    ratio = spacing_ratios(lines, 0.1)
    assert np.median(np.abs(ratio[~undefined] - 1)) < 0.05


def test_the_number_of_triangles_is_bounded():
    surface = icosphere(2)
    field = generate(surface, "smoothest", 4)
    lines = surface_lines(surface, np.eye(3), field, "smooth", 0.004, max_triangles=2000)
    assert 500 < len(lines.tree.leaf_root) <= 2000 and np.isfinite(lines.pattern.phase).all()


def test_too_little_memory_is_an_error(monkeypatch, error_of):
    monkeypatch.setattr("rosy_addon.core.memory.available_memory", lambda: 1 << 20)
    surface = icosphere(2)
    message = error_of(lines_of, surface, axis_field(surface, 4), 0.02)
    assert "sphere: the spacing of lines on" in message and "choose wider lines" in message


# --- reuse ---------------------------------------------------------------------------------------


@pytest.mark.slow
def test_deformations_and_rotations_keep_the_lines():
    surface = icosphere(2)
    field = axis_field(surface, 4)
    cache = Cache()

    def cached(surface, matrix):
        return cached_surface_lines(MeshInstance(surface, matrix, field), "smooth", 0.05, cache)

    def deformed(amount):
        return rebuilt(surface, surface.vertices * (1, 1, amount), rest_vertices=surface.vertices)

    first = cached(deformed(1.2), np.eye(4))
    assert cached(deformed(1.5), np.eye(4)) is first
    turned = placed([(0.6, -0.8, 0), (0.8, 0.6, 0), (0, 0, 1)], 5)
    assert cached(deformed(1.5), turned) is first
    assert cached(deformed(1.5), turned @ np.diag([2.0, 2, 2, 1])) is not first


def test_rest_matrices_measure_lengths():
    rotation = np.array([(0.6, -0.8, 0), (0.8, 0.6, 0), (0, 0, 1.0)])
    for scale, sign in ((np.diag([1, 2, 3.0]), 1), (2 * np.eye(3), -1)):
        np.testing.assert_allclose(rest_matrix(placed(sign * rotation @ scale)), scale, atol=1e-12)
