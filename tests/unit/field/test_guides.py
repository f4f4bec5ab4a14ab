"""Guides from strokes, axes of empties, UV maps and vectors; and one-sided surfaces."""

import numpy as np
import pytest
from field_helpers import awkward_surface
from shapes import from_triangles, icosphere, joined, plane, rebuilt, torus

from rosy_addon.field.closest_point import closest_triangles
from rosy_addon.field.frames import dot, normalize
from rosy_addon.field.generate import GeneratorSettings, generate
from rosy_addon.field.guides import guides_from_axes, guides_from_strokes, guides_from_uv
from rosy_addon.field.mesh_checks import count_inconsistent_edges, orientation_warning
from rosy_addon.field.representation import face_representation, to_representation

BALL = icosphere(4)


def great_circles(count):
    """Arcs of great circles on the unit sphere."""
    axes = np.linalg.qr(np.random.default_rng(6).standard_normal((count, 3, 2)))[0]
    angle = np.linspace(0, 0.8, 40)
    return list(np.einsum("at,sia->sti", [np.cos(angle), np.sin(angle)], axes))


def stroke_error(surface, field, stroke):
    """The angle between a stroke and the mean field along it, degrees."""
    midpoint, direction = (stroke[1:] + stroke[:-1]) / 2, np.diff(stroke, axis=0)
    face = surface.triangle_face[closest_triangles(surface, midpoint)[0]]
    x, y = surface.face_frames
    target = to_representation(normalize(direction), x[face], y[face], field.degree)
    z = to_representation(field.vectors[face], x[face], y[face], field.degree)
    return abs(np.degrees(np.angle((z * target.conj()).sum())) / field.degree)


@pytest.mark.slow
@pytest.mark.parametrize("degree", [1, 4])
def test_strokes_on_a_sphere_are_followed(degree):
    strokes = great_circles(5)
    field = generate(BALL, GeneratorSettings("guided", strokes=strokes), degree)
    assert max(stroke_error(BALL, field, stroke) for stroke in strokes) < 2
    soft = generate(BALL, GeneratorSettings("guided", strokes=strokes, reach=0.005), degree)
    assert max(stroke_error(BALL, soft, stroke) for stroke in strokes) < 2


def test_strokes_far_from_the_surface_are_refused(error_of):
    for stroke, expected in (
        (((9, 9, 9), (9, 9, 8)), "no stroke is near the surface"),
        (((1, 1, 1), (1, 1, 1)), "no stroke has two different points"),
        (((0, 0, 1), (1e10, 0, 0)), "the strokes are 1e+10 long, too long for a mesh of size 2"),
        (((1e300, 0, 0), (-1e300, 0, 0)), "too long"),
    ):
        assert expected in error_of(guides_from_strokes, BALL, [np.array(stroke, float)], 4)


def test_strokes_between_tiny_parts_have_few_samples():
    """The edges of tiny parts that are far apart do not make samples of strokes ever denser."""
    part = icosphere(1, 1e-7)
    surface = joined(part, rebuilt(part, part.vertices + (2, 0, 0)))
    guides = guides_from_strokes(surface, [np.array([(0.0, 0, 0), (2, 0, 0)])], 4)
    assert (dot(guides, guides) > 0).any()


def test_only_the_parts_of_strokes_near_the_surface_count():
    near, far = np.array([(0.0, 0, 1), (0.2, 0, 1)]), np.array([(0.2, 0, 9), (9e3, 0, 9)])
    guides = guides_from_strokes(BALL, [near, np.zeros((5, 3)), far], 4)
    np.testing.assert_array_equal(guides, guides_from_strokes(BALL, [near], 4))


def test_axes_guide_the_faces_around_them():
    position, axis = np.array([(0, 0, 1.0), (1.0, 0, 0)]), np.array([(1.0, 0, 0), (0, 1.0, 1.0)])
    guides = guides_from_axes(BALL, position, axis, np.array([0.3, 0.0]), 2)
    near = np.linalg.norm(BALL.face_center - position[0], axis=1) < 0.3
    assert guides[near].any(axis=1).all() and guides.any(axis=1).sum() == near.sum() + 1
    assert (np.abs(guides[near, 0]) > 0.9).all()
    axis_guides = list(zip(position, axis, (0.3, 0.0), strict=True))
    field = generate(BALL, GeneratorSettings("guided", axis_guides=axis_guides), 2)
    np.testing.assert_allclose(np.abs(dot(field.vectors, guides))[near], 1, atol=1e-9)


def uv_of(surface, matrix):
    """The UV map (u, v) = matrix (x, y) + offset of a plane."""
    return surface.vertices[surface.corner_vertex][:, :2] @ np.transpose(matrix) + (3.0, -1.0)


@pytest.mark.parametrize("mirrored", [False, True])
@pytest.mark.parametrize("degree", [1, 2, 4, 6, 8])
def test_a_uv_map_is_followed(degree, mirrored):
    surface = plane(4, 3)
    # u is at 0.4 radians.
    rotation = np.array([(np.cos(0.4), np.sin(0.4)), (-np.sin(0.4), np.cos(0.4))])
    matrix = np.diag((5.0, -0.3 if mirrored else 0.3)) @ rotation
    guides = guides_from_uv(surface, uv_of(surface, matrix), degree)
    np.testing.assert_allclose(np.linalg.norm(guides, axis=1), 1)
    angle = np.arctan2(guides[:, 1], guides[:, 0])
    np.testing.assert_allclose(np.exp(1j * degree * angle), np.exp(1j * degree * 0.4), atol=1e-9)


def test_a_skewed_map_is_followed_equally_along_both_axes():
    surface = plane(3, 3)
    # dP/du = (1, 0) and dP/dv = (1, 1): the closest cross halves the error of 45 degrees.
    uv = uv_of(surface, np.linalg.inv([(1.0, 1.0), (0.0, 1.0)]))
    guides = guides_from_uv(surface, uv, 4)
    assert np.allclose(np.degrees(np.arctan2(guides[:, 1], guides[:, 0])) % 90, 67.5)
    np.testing.assert_allclose(np.abs(guides_from_uv(surface, uv, 2)[:, 0]), 1, atol=1e-9)


@pytest.mark.parametrize("degree", [4, 8])
@pytest.mark.parametrize("between", [1, 10, 30, 44, 46, 80, 90, 100, 136, 179, -1, -50])
def test_a_field_is_nearest_to_both_axes(degree, between):
    """Of all directions in steps of 0.01 degrees, none has a smaller largest angle to the axes."""
    surface = plane(3, 3)
    v = np.radians(between)
    uv = uv_of(surface, np.linalg.inv([(1.0, np.cos(v)), (0.0, np.sin(v))]))
    guides = guides_from_uv(surface, uv, degree)
    period = 360 / degree

    def largest_angle(member):
        apart = np.subtract.outer(member, [0, between]) % period
        return np.minimum(apart, period - apart).max(axis=-1)

    found = largest_angle(np.degrees(np.arctan2(guides[:, 1], guides[:, 0])))
    assert np.allclose(found, largest_angle(np.arange(0, period, 0.01)).min(), atol=0.01)


def test_maps_without_area_are_undefined():
    surface = plane(3, 3)
    uv = uv_of(surface, np.eye(2))
    uv[:8] = 0.5
    uv[8:12, 1] = 0.0
    assert guides_from_uv(surface, uv, 4).any(axis=1).tolist() == [False] * 3 + [True] * 6


def test_guides_of_several_kinds_are_combined(error_of):
    surface = torus(48, 24)
    vectors = np.zeros((surface.face_count, 3))
    vectors[5] = 3 * surface.face_frames[0][5]
    edges = np.stack([surface.corner_vertex, surface.corner_vertex[surface.next_corner]], axis=1)
    settings = GeneratorSettings("guided", vectors=vectors, edges=edges[800:801])
    field = generate(surface, settings, 4)
    assert np.isclose(abs(dot(normalize(vectors[5]), field.vectors[5])), 1)
    assert (field.magnitude > 0.99).all()
    assert "no guides are given" in error_of(generate, surface, "guided", 4)
    assert "no UV map" in error_of(generate, surface, "uv", 4)


# --- surfaces with one side ------------------------------------------------------------------


def test_a_moebius_strip_is_named():
    strip = awkward_surface("moebius")
    count = count_inconsistent_edges(strip)
    warning = orientation_warning(strip)
    assert count > 0 and f"at {count} edge" in warning and "Möbius strip" in warning
    assert np.allclose(generate(strip, "smoothest", 4).magnitude, 1)
    assert not orientation_warning(BALL)


def test_flipped_faces_are_counted():
    triangles = BALL.corner_vertex.reshape(-1, 3).copy()
    triangles[7] = triangles[7][::-1]
    surface = from_triangles(BALL.vertices, triangles)
    assert count_inconsistent_edges(surface) == 3
    assert np.isfinite(face_representation(surface, generate(surface, "smoothest", 4))).all()
