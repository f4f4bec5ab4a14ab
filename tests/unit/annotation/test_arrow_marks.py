"""Arrowheads over the lines of pictures: their directions, their spacing, and where there are none."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.distance import pdist
from shapes import from_quads, globe, icosphere, instance_of, plane, rebuilt, torus

from rosy_addon.annotation.arrow_marks import (
    FILL_COLOR,
    NOTCH,
    WIDTH,
    ArrowMarks,
    arrow_marks,
    spaced_points,
    surface_places,
)
from rosy_addon.annotation.draw_marks import draw_arrows
from rosy_addon.compositor.look import Look
from rosy_addon.core.cache import Cache
from rosy_addon.core.color import from_hex, to_linear
from rosy_addon.field.directional_field import field_directions, field_from_directions
from rosy_addon.field.generate import GeneratorSettings, generate
from rosy_addon.field.rosy_field import RosyField
from rosy_addon.line_drawing.visibility import project_to_pixels
from rosy_addon.projection.camera import (
    look_at,
    orbit_camera,
    orthographic_camera,
    perspective_camera,
)
from rosy_addon.projection.gbuffer import MeshInstance
from rosy_addon.rendering.draw import draw_picture
from rosy_addon.rendering.view_input import ViewInput

CAMERA = perspective_camera(look_at((2.5, -3.0, 1.5), (0, 0, 0)), 480, 400, fov=0.7)


def arrows(instances, camera=CAMERA, spacing=24.0, size=8.0, **options) -> ArrowMarks:
    return arrow_marks(instances, camera, spacing, size, **options)


def rectangle(normal_up=True):
    corners = np.array([[-2, -1, 0], [2, -1, 0], [2, 1, 0], [-2, 1, 0]], dtype=float)
    return from_quads(corners, np.arange(4)[:: 1 if normal_up else -1])


def on_screen(camera, points):
    return project_to_pixels(points, camera)[0]


def angle_errors(marks, directions, camera=CAMERA, step=1e-4):
    """(D, n) angles on screen between arrowheads and directions in space, radians."""
    ends = [on_screen(camera, marks.anchor + step * direction) for direction in directions]
    expected = (np.array(ends) - marks.place) @ [1, 1j]
    return np.abs(np.angle(marks.direction @ [1, 1j] / expected))


@pytest.mark.parametrize("normal_up", [True, False])
@pytest.mark.parametrize("case", ["one", "three", "five", "two without opposites"])
def test_arrowheads_point_along_the_directions_of_a_field(case, normal_up):
    """On both sides of a plane, in perspective."""
    surface = rectangle(normal_up)
    member = np.array([np.cos(0.4), np.sin(0.4), 0.0])
    if case == "two without opposites":
        other = [np.cos(1.5), np.sin(1.5), 0.0]
        field = field_from_directions(surface, np.array([[member, other]]))
    else:
        field = RosyField({"one": 1, "three": 3, "five": 5}[case], member[None])
    directions = field_directions(surface, field)[0]
    camera = perspective_camera(look_at((1.5, -2.5, 2.5), (0, 0, 0)), 480, 320, fov=0.9)
    marks = arrows([MeshInstance(surface, np.eye(4), field)], camera, spacing=50.0)
    np.testing.assert_allclose(on_screen(camera, marks.anchor), marks.place, atol=1e-6)
    error = angle_errors(marks, directions, camera)
    assert len(marks) > 15 and np.degrees(error.min(axis=0)).max() < 0.5
    # All directions of a place are there.
    assert (np.unique(error.argmin(axis=0), return_counts=True)[1] > len(marks) / 8).all()
    assert len(marks) > 0.9 * len(directions) * len(np.unique(marks.place, axis=0))
    if len(directions) > 1:
        ahead = ((marks.position - marks.place) * marks.direction).sum(axis=1)
        np.testing.assert_allclose(np.hypot(*(marks.position - marks.place).T), ahead, atol=1e-9)
        assert case.startswith("two") or pdist(marks.position).min() > 0.8 * WIDTH * marks.size
    else:
        np.testing.assert_array_equal(marks.position, marks.place)


def test_arrowheads_follow_the_smooth_field_of_curved_surfaces():
    surface = globe(24, 48)
    field = RosyField(1, np.cross([0.0, 0.0, 1.0], surface.face_normal))
    marks = arrows([MeshInstance(surface, np.eye(4), field)])
    error = angle_errors(marks, [np.cross([0.0, 0.0, 1.0], marks.anchor)])
    assert len(marks) > 60 and np.degrees(error).max() < 1.0


@pytest.mark.parametrize("subdivisions", [5, 3])
@pytest.mark.parametrize("is_exact", [True, False])
def test_places_are_even_and_on_the_side_that_the_camera_sees(subdivisions, is_exact):
    surface = icosphere(subdivisions)
    camera = orthographic_camera(look_at((0, -3, 0.0), (0, 0, 0)), 400, 400, scale=2.2)
    marks = arrows([instance_of(surface, 1)], camera, spacing=25.0, is_exact=is_exact)
    assert pdist(marks.position).min() >= 25.0 and (marks.anchor[:, 1] < 0).all()
    radius = 400 / 2.2
    y, x = np.mgrid[:400:2, :400:2] + 0.5
    inside = np.hypot(x - 200, y - 200) < 0.95 * radius
    points = np.stack([x[inside], y[inside]], axis=1)
    nearest = np.min([np.hypot(*(points - position).T) for position in marks.position], axis=0)
    # But for places where the field is undefined or points at the camera.
    assert np.quantile(nearest, 0.99) < 1.25 * 25.0 and nearest.max() < 2.5 * 25.0


@pytest.mark.slow
def test_nothing_is_drawn_where_a_surface_is_hidden_or_outside():
    ball, wall = icosphere(4), rectangle()
    turned = np.array([[1, 0, 0, 0.6], [0, 0, -1, -1.5], [0, 1, 0, 0], [0, 0, 0, 1.0]])
    marks = arrows([instance_of(ball, 1), MeshInstance(wall, turned, None)])
    assert 0 < len(marks) < 0.8 * len(arrows([instance_of(ball, 1)]))
    ray = CAMERA.eye - marks.anchor
    share = (-1.5 - marks.anchor[:, 1]) / ray[:, 1]
    x, _, z = (marks.anchor + share[:, None] * ray).T
    assert not ((share > 0) & (share < 1) & (np.abs(x - 0.6) < 2) & (np.abs(z) < 1)).any()
    assert ((marks.place >= 0) & (marks.place <= (480, 400))).all()
    planes = np.zeros((6, 4))
    planes[:, 3] = 1.0
    planes[0] = (1.0, 0.0, 0.0, 0.0)
    cut = arrows([instance_of(ball, 1)], clip_planes=planes)
    assert len(cut) and (cut.anchor[:, 0] > -1e-9).all()


@pytest.mark.parametrize("degree", [2, 4, 6])
def test_lines_without_a_direction_have_no_arrowheads(degree):
    assert not len(arrows([instance_of(icosphere(2), degree)]))


def test_undefined_faces_have_no_arrowheads():
    surface = globe(24, 48)
    field = generate(surface, GeneratorSettings("smoothest"), 1)
    is_south = surface.face_center[:, 2] < 0
    field = replace(field, vectors=np.where(is_south[:, None], 0.0, field.vectors))
    marks = arrows([MeshInstance(surface, np.eye(4), field)])
    assert len(marks) and (marks.anchor[:, 2] > -0.01).all()
    nowhere = replace(field, vectors=0 * field.vectors)
    assert not len(arrows([MeshInstance(surface, np.eye(4), nowhere)]))


def test_an_object_that_is_scaled_to_a_plane_has_arrowheads():
    flat = np.diag([1.0, 0.0, 1.0, 1.0])
    assert len(arrows([replace(instance_of(icosphere(3), 1), matrix=flat)])) > 50


@pytest.mark.slow
def test_arrowheads_stay_on_the_surface_while_the_camera_turns():
    instance = instance_of(torus(96, 48), 1)
    marks = [
        arrows([instance], orbit_camera(instance.surface.vertices, azimuth, 40, 480, 400))
        for azimuth in (20.0, 20.0, 20.5)
    ]
    np.testing.assert_array_equal(marks[0].position, marks[1].position)
    before, after = ({tuple(np.round(point, 6)) for point in mark.anchor} for mark in marks[1:])
    assert len(before) > 60 and len(before & after) > 0.95 * len(before)


def test_places_do_not_depend_on_how_a_mesh_is_deformed():
    surface = icosphere(4)
    stretched = rebuilt(surface, surface.vertices * (1, 1, 1.1), rest_vertices=surface.vertices)
    cache = Cache()
    places = [surface_places(shape, 0.1, cache) for shape in (surface, stretched)]
    assert places[0] is places[1] and places[0].distance[-1] == places[0].finest <= 0.1
    corners = surface.vertices[surface.triangle_vertex[places[0].triangle]]
    points = np.einsum("nk,nki->ni", places[0].barycentric, corners)
    for number in range(1, len(points)):
        nearest = np.linalg.norm(points[:number] - points[number], axis=1).min()
        assert nearest >= places[0].distance[number]
    # Even: no point of the surface is far from all places.
    apart = np.linalg.norm(surface.vertices[:, None] - points, axis=2).min(axis=1)
    assert apart.max() < 1.5 * places[0].finest


def test_a_large_floor_around_the_camera_is_covered_evenly():
    """Places need no more than the part of a face that is in view."""
    floor, field = plane(1, 1, 1000.0), RosyField(1, np.array([[0.2, 1.0, 0.0]]))
    camera = perspective_camera(look_at((0, 0, 1.7), (10, 0, -2)), 480, 320, fov=1.0)
    marks = arrows([MeshInstance(floor, np.eye(4), field)], camera, spacing=24.0)
    assert pdist(marks.position).min() >= 24.0
    lower = np.mgrid[10:470:8, 10:120:8].reshape(2, -1).T
    nearest = np.min([np.hypot(*(lower - place).T) for place in marks.place], axis=0)
    assert nearest.max() < 1.5 * 24.0


@pytest.mark.parametrize("size", [(160, 90), (60, 20, 40)])
def test_points_are_chosen_in_their_order(size):
    """As by taking one after the other."""
    position = np.random.default_rng(3).random((600, len(size))) * size - 30
    expected = []
    for number, place in enumerate(position):
        if all(np.linalg.norm(place - position[other]) >= 11.0 for other in expected):
            expected.append(number)
    assert spaced_points(position, 11.0).tolist() == expected
    assert not len(spaced_points(position[:0], 11.0))


def test_an_arrowhead_has_its_shape_and_its_outline():
    rgba = np.zeros((60, 80, 4), dtype=np.float32)
    direction = np.array([[np.cos(0.5), np.sin(0.5)]])
    place = np.array([[40.2, 30.7]])
    marks = ArrowMarks(np.zeros((1, 3)), place, place, direction, 24.0)
    picture = draw_arrows(rgba, marks)
    fill = to_linear(from_hex(FILL_COLOR))[0]
    dark = np.where(picture[..., 3] > 0, (1 - picture[..., 0]) / (1 - fill), 0)
    y, x = np.mgrid[:60, :80] + 0.5
    along = (x - 40.2) * direction[0, 0] + (y - 30.7) * direction[0, 1]
    # A quadrilateral with a notch; its narrow end is ahead.
    assert dark.sum() == pytest.approx(24 * 24 * WIDTH * (1 - NOTCH) / 2, rel=0.02)
    assert (dark * (along < 0)).sum() > 1.8 * (dark * (along > 0)).sum()
    assert (dark[np.abs(along) > 12.7] == 0).all() and picture[30, 40, 3] == 1
    sides = 2 * 24 * (np.hypot(1, WIDTH / 2) + np.hypot(NOTCH, WIDTH / 2))
    assert picture[..., 3].sum() - dark.sum() == pytest.approx(2.4 * sides, rel=0.1)
    none = ArrowMarks(np.zeros((0, 3)), *np.zeros((3, 0, 2)), 24.0)
    np.testing.assert_array_equal(draw_arrows(rgba, none), rgba)
    beside = replace(marks, position=np.array([[-300.0, 30.0]]))
    np.testing.assert_array_equal(draw_arrows(rgba, beside), rgba)


@pytest.mark.parametrize("distance", [65536.0, 1.0, 50.0])
def test_any_distance_and_any_unit_can_be_drawn(distance):
    instance = instance_of(icosphere(2), 3)
    for unit in ("pixels", "scene"):
        look = Look(length=4, unit=unit, unit_size=0.01, arrows=distance)
        picture = draw_picture(ViewInput((instance,), CAMERA.resized(60, 50), look))
        assert np.isfinite(picture.rgba).all()
