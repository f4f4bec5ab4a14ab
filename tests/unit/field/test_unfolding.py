"""Folded and reversed faces: found, mended, and without an influence on fields that follow the form."""

import numpy as np
import pytest
from awkward import AWKWARD
from field_helpers import awkward_surface, cross_errors, ellipsoid
from shapes import cube, icosphere, plane, rebuilt, tetrahedron, torus

from rosy_addon.field.frames import dot
from rosy_addon.field.generate import generate
from rosy_addon.field.surface import Surface
from rosy_addon.field.unfolding import folded_faces, unfolded

#: Share of folded faces, and the largest median and 95th percentile of the angle in degrees to the field
#: without them.
BOUNDS = [(0.0003, 0.4, 2.0), (0.0035, 0.6, 4.0), (0.012, 1.2, 8.0), (0.035, 3.0, 15.0)]


def with_folds(surface: Surface, share: float) -> Surface:
    """Move one vertex of a share of the triangles over the opposite edge, by half the height."""
    triangles, vertices = surface.triangle_vertex, surface.vertices.copy()
    is_used = np.zeros(len(vertices), dtype=bool)
    left = round(share * len(triangles))
    for triangle in np.random.default_rng(0).permutation(len(triangles)):
        a, b, c = triangles[triangle]
        ring = np.unique(triangles[(triangles == a).any(axis=1)])
        if left and not is_used[ring].any():
            edge = vertices[c] - vertices[b]
            foot = vertices[b] + edge * ((vertices[a] - vertices[b]) @ edge) / (edge @ edge)
            vertices[a] = foot - 0.5 * (vertices[a] - foot)
            is_used[ring] = True
            left -= 1
    return rebuilt(surface, vertices)


def with_reversed_faces(surface: Surface, share: float) -> Surface:
    triangles = surface.triangle_vertex.copy()
    is_reversed = np.random.default_rng(0).random(len(triangles)) < share
    triangles[is_reversed] = triangles[is_reversed, ::-1]
    return Surface(surface.vertices, triangles)


@pytest.mark.slow
@pytest.mark.parametrize("make", [with_folds, with_reversed_faces])
@pytest.mark.parametrize(("share", "median", "most"), BOUNDS)
def test_the_field_of_the_form_hardly_changes(make, share, median, most):
    surface = ellipsoid(4)
    damaged = make(surface, share)
    assert (dot(damaged.face_normal, surface.face_normal) < 0).any()
    field = generate(damaged, "form", 4)
    np.testing.assert_allclose(np.linalg.norm(field.vectors, axis=1), 1)
    np.testing.assert_allclose(dot(field.vectors, damaged.face_normal), 0, atol=1e-9)
    errors = cross_errors(surface, field.vectors, generate(surface, "form", 4).vectors)
    assert np.median(errors) <= median and np.percentile(errors, 95) <= most


def test_folded_faces_are_found_and_unfolded():
    surface = ellipsoid(4)
    damaged = with_folds(surface, 0.01)
    is_folded = dot(damaged.face_normal, surface.face_normal) < 0
    np.testing.assert_array_equal(folded_faces(damaged), is_folded)
    assert not folded_faces(unfolded(damaged)).any()


@pytest.mark.parametrize("share", [0.1, 0.5])
def test_reversed_faces_are_oriented(share):
    """However many they are: all edges are interior again."""
    surface = icosphere(3)
    oriented = unfolded(with_reversed_faces(surface, share))
    assert len(oriented.edges.interior) == len(surface.edges.interior)
    sign = dot(oriented.face_normal, surface.face_normal)
    np.testing.assert_allclose(sign, sign[0])


def needle() -> Surface:
    """A tip much narrower than 90 degrees."""
    return rebuilt(tetrahedron(), tetrahedron().vertices @ np.diag([0.05, 0.05, 1.0]))


def groove() -> Surface:
    """A strip that runs back at 60 degrees between two planes, as the side of a dovetail."""
    profile = np.array([[-1, 0], [0, 0], [-0.1, -0.173], [1, -0.173]])
    points = [[along, *point] for along in range(4) for point in profile]
    corner = np.array([[4 * i + j for j in range(3)] for i in range(3)]).ravel()[:, None]
    return Surface(points, np.concatenate([corner + (0, 4, 5), corner + (0, 5, 1)]))


@pytest.mark.parametrize("make", [cube, torus, plane, tetrahedron, needle, groove])
def test_clean_surfaces_stay_as_they_are(make):
    surface = make()
    assert unfolded(surface) is surface


@pytest.mark.parametrize("name", AWKWARD)
def test_awkward_meshes(name):
    surface = unfolded(awkward_surface(name))
    assert np.isfinite(surface.vertices).all()
    assert surface.face_count == awkward_surface(name).face_count
