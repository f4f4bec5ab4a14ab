"""Transport, singularities and generators, against closed forms, invariances and Poincaré-Hopf."""

import numpy as np
import pytest
from field_helpers import cross_errors, random_field, with_random_members
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation
from shapes import cube, from_triangles, icosphere, plane, rebuilt, sharp_cube, torus

from rosy_addon.field.convert import Conversion, convert
from rosy_addon.field.corner_fans import average_over_fans, corner_rotations
from rosy_addon.field.curvature import curvature_field
from rosy_addon.field.frames import dot, normalize, tangent_frame, transport, view_frame
from rosy_addon.field.generate import GeneratorSettings, axis_field, generate
from rosy_addon.field.representation import (
    face_representation,
    from_representation,
    to_representation,
)
from rosy_addon.field.rosy_field import RosyField
from rosy_addon.field.singularities import find_singularities
from rosy_addon.field.surface import build_surface

coordinate = st.floats(-1, 1, allow_nan=False)
vector = st.tuples(coordinate, coordinate, coordinate).filter(lambda v: np.linalg.norm(v) > 0.1)


@given(vector, vector, coordinate)
def test_transport_is_the_minimal_rotation(a, b, angle):
    s, t = normalize(np.array(a)), normalize(np.array(b))
    if s @ t < -0.9:
        return
    x, y = tangent_frame(s)
    v = np.cos(3 * angle) * x + np.sin(3 * angle) * y
    axis = np.cross(s, t)
    turn = Rotation.from_rotvec(normalize(axis) * np.arctan2(np.linalg.norm(axis), s @ t))
    moved = transport(v, s, t)
    assert np.allclose(moved, turn.apply(v)) and np.allclose(transport(moved, t, s), v)


@given(vector)
def test_tangent_frames_are_right_handed(a):
    n = normalize(np.array(a))
    x, y = tangent_frame(n)
    assert np.allclose(np.cross(x, y), n) and x @ y == pytest.approx(0, abs=1e-12)


@given(vector.filter(lambda v: v[2] / np.linalg.norm(v) > -0.5))
def test_view_frames_are_the_transported_camera_axes(a):
    w = normalize(np.array(a))
    x, y = view_frame(w)
    camera = np.array([0.0, 0.0, 1.0])
    assert np.allclose(x, transport(np.array([1.0, 0.0, 0.0]), camera, w))
    assert np.allclose(y, transport(np.array([0.0, 1.0, 0.0]), camera, w))


@given(st.floats(-3, 3), st.floats(0.1, 5), st.integers(1, 12), st.integers(0, 11))
def test_all_members_have_one_representation(angle, rho, degree, k):
    x, y = np.array([1.0, 0, 0]), np.array([0, 1.0, 0])
    turned = angle + 2 * np.pi * k / degree
    z = to_representation(rho * (np.cos(turned) * x + np.sin(turned) * y), x, y, degree)
    assert z == pytest.approx(rho * np.exp(1j * degree * angle), abs=1e-9)
    again = to_representation(from_representation(z, x, y, degree), x, y, degree)
    assert again == pytest.approx(z, abs=1e-9)


def test_corner_rotations_match_transport():
    surface = torus(12, 8)
    x, y = surface.face_frames
    face = surface.corner_face
    rotation = corner_rotations(surface, surface.corner_normal)
    member = normalize(0.3 * x + 0.8 * y)
    moved = transport(member[face], surface.face_normal[face], surface.corner_normal)
    cx, cy = tangent_frame(surface.corner_normal)
    w = dot(member, x) + 1j * dot(member, y)
    assert np.allclose(w[face] * rotation, dot(moved, cx) + 1j * dot(moved, cy))


def test_values_are_averaged_only_within_fans():
    values, smooth = np.arange(24) + 1j, cube()
    sharp = average_over_fans(values, np.ones(24), sharp_cube().corner_fan)
    assert np.array_equal(sharp, values)
    averaged = average_over_fans(values, np.ones(24), smooth.corner_fan)
    for v in range(8):
        at_vertex = smooth.corner_vertex == v
        assert np.allclose(averaged[at_vertex], values[at_vertex].mean())


def test_sharp_edges_and_flat_faces_separate_fans():
    quads = plane(2, 1)
    shared = [v for v in range(6) if np.sum(quads.corner_vertex == v) == 2]
    for settings, count in (({}, 6), ({"sharp_edges": [shared]}, 8), ({"flat_faces": [1, 0]}, 8)):
        assert len(np.unique(rebuilt(quads, **settings).corner_fan)) == count


@pytest.mark.parametrize("degree", range(1, 13))
def test_indices_sum_to_the_euler_characteristic(degree):
    for surface, characteristic in ((icosphere(2), 2), (torus(20, 12), 0)):
        assert surface.euler_characteristic == characteristic
        _, index = find_singularities(surface, random_field(surface, degree))
        assert index.sum() == degree * characteristic


@pytest.mark.parametrize("degree", [1, 2, 3, 4, 6])
@pytest.mark.parametrize("sign", [1, -1])
def test_a_planar_singularity_has_its_index(degree, sign):
    surface = plane(21, 21)
    # The singularity is at a vertex near the center.
    vertex = int(np.argmin(np.linalg.norm(surface.vertices - [0.02, 0.03, 0], axis=1)))
    direction = surface.face_center - surface.vertices[vertex]
    angle = sign * np.arctan2(direction[:, 1], direction[:, 0]) / degree + 0.4
    field = RosyField(degree, np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1))
    vertices, index = find_singularities(surface, field)
    assert vertices.tolist() == [vertex] and index.tolist() == [sign]


@pytest.mark.parametrize("degree", [1, 3, 4, 7])
def test_results_do_not_depend_on_the_stored_member(degree):
    surface = torus(20, 12)
    field = random_field(surface, degree)
    other = with_random_members(surface, field, 3)
    assert np.allclose(face_representation(surface, field), face_representation(surface, other))
    assert np.array_equal(find_singularities(surface, field), find_singularities(surface, other))


def test_principal_directions_of_a_torus():
    surface = torus(128, 64, 1.0, 0.4)
    center = surface.face_center
    along = normalize(np.stack([-center[:, 1], center[:, 0], 0 * center[:, 0]], axis=1))
    across = np.cross(surface.face_normal, along)
    degree_2 = curvature_field(surface, 2)
    # The curvature around the tube is larger than along the ring everywhere.
    angle = np.degrees(np.arccos(np.abs(dot(normalize(degree_2.vectors), across)).clip(0, 1)))
    assert angle.max() < 0.5
    # |k1 - k2| / (|k1| + |k2|) with k1 = 1 / r, k2 = cos v / (R + r cos v)
    ring = np.hypot(center[:, 0], center[:, 1])
    k1, k2 = 1 / 0.4, (ring - 1) / 0.4 / ring
    expected = np.abs(k1 - k2) / (np.abs(k1) + np.abs(k2))
    assert np.abs(degree_2.magnitude - expected).max() < 0.03
    assert cross_errors(surface, curvature_field(surface, 4).vectors, along).max() < 0.5


def test_an_axis_is_projected():
    surface = icosphere(2)
    field = axis_field(surface, 3, (0, 0, 5))
    normal = surface.face_normal
    assert np.abs(dot(field.vectors, normal)).max() < 1e-12
    assert np.allclose(field.magnitude, np.sqrt(1 - normal[:, 2] ** 2))


@pytest.mark.parametrize("length", [1e300, 2.0**-1070])
def test_the_length_of_an_axis_does_not_count(length):
    surface = icosphere(1)
    vectors = axis_field(surface, 4, (length, 0, -length)).vectors
    np.testing.assert_array_equal(vectors, axis_field(surface, 4, (1, 0, -1)).vectors)


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("length", [1e-320, 1e-160, 1e-9])
def test_smoothing_over_no_distance_changes_nothing(length):
    surface = torus()
    vectors = generate(surface, GeneratorSettings("curvature", reach=length), 4).vectors
    np.testing.assert_array_equal(vectors, curvature_field(surface, 4).vectors)
    guides = GeneratorSettings("guided", reach=length, vectors=vectors)
    expected = generate(surface, GeneratorSettings("guided", vectors=vectors), 4).vectors
    np.testing.assert_array_equal(generate(surface, guides, 4).vectors, expected)
    again = convert(surface, RosyField(4, vectors), Conversion(smoothing_length=length))
    np.testing.assert_array_equal(again.vectors, vectors)


def test_faces_perpendicular_to_an_axis_are_undefined():
    """Also where the normal is rounded."""
    points = [(0, 0, 0), (1, 0, 0.3), (0, 1, 0.7), (5, 0, 0), (6, 0, 1), (5, 1, 0)]
    field = axis_field(from_triangles(points, [(0, 1, 2), (3, 4, 5)]), 4, (-0.3, -0.7, 1))
    assert not field.vectors[0].any() and field.vectors[1].any()


@pytest.mark.parametrize("axis", [(0, 0, 0), (np.nan, 0, 1), (1, 2)])
def test_an_axis_without_a_direction_is_refused(axis, error_of):
    assert "axis" in error_of(axis_field, plane(), 4, axis)


def test_unknown_generators_are_refused(error_of):
    assert "magic" in error_of(generate, plane(), "magic", 4)


def test_faces_with_two_equal_corners():
    whole = icosphere(2)
    corners = np.append(whole.corner_vertex, [0, 0, 5])
    surface = build_surface(whole.vertices, corners, np.arange(0, len(corners) + 1, 3))
    vectors = np.zeros((surface.face_count, 3))
    vectors[0] = surface.vertices[corners[1]] - surface.vertices[corners[0]]
    field = generate(surface, GeneratorSettings("guided", vectors=vectors), 4)
    assert field.vectors[:-1].any(axis=1).all()


@pytest.mark.parametrize("degree", [0, -1, 1000, 1.5])
def test_impossible_degrees(degree, error_of):
    assert "degree" in error_of(RosyField, degree, np.zeros((1, 3)))


def test_impossible_meshes(error_of):
    points = [[0, 0, 0], [0, np.nan, 0], [1, 0, 0]]
    assert "no faces" in error_of(build_surface, points, [], [0])
    assert "corners" in error_of(build_surface, points, [0, 1], [0, 2])
    assert "not exist" in error_of(build_surface, points, [0, 1, 3], [0, 3])
    assert "vertex 1" in error_of(build_surface, points, [0, 1, 2], [0, 3])


def test_curvatures_next_to_nothing():
    """Smaller than numbers with an inverse, on a mesh without extent, and on flat faces."""
    grid = plane(4, 4)
    points = grid.vertices + (0, 0, 5e-320) * np.random.default_rng(0).random((25, 1))
    surface = rebuilt(grid, points)
    assert np.isfinite(generate(surface, "curvature", 4).vectors).all()
    surface = rebuilt(grid, 0 * points + 1)
    settings = GeneratorSettings("curvature", reach=0.3)
    for mesh in (surface, cube()):
        assert not generate(mesh, settings, 4).vectors.any()
