"""Drawings of several instances: families, density, light, and the geometry of the strokes."""

from dataclasses import replace

import numpy as np
import pytest
from harness.stroke_tracing import trace_strokes, turned
from listeners import cancel_at
from scipy.spatial import cKDTree
from shapes import from_triangles, icosphere, instance_of, moved, plane, rebuilt, sharp_cube

from rosy_addon.compositor.shading import Light
from rosy_addon.core.progress import listening
from rosy_addon.field.frames import dot, normalize
from rosy_addon.line_drawing import lateral_neighbors, seeding, separation, visibility
from rosy_addon.line_drawing.drawing_outputs import offset_toward_camera, stroke_geometry
from rosy_addon.line_drawing.outline import OUTLINE_KINDS
from rosy_addon.line_drawing.pipeline import draw_instances
from rosy_addon.line_drawing.spacing import lit_tone
from rosy_addon.line_drawing.style import StrokeStyle
from rosy_addon.line_drawing.svg import Pen
from rosy_addon.line_drawing.visibility import pixel_size, project_to_pixels
from rosy_addon.projection.camera import (
    look_at,
    orbit_camera,
    orthographic_camera,
    perspective_camera,
)
from rosy_addon.projection.gbuffer import MeshInstance

SPHERE = instance_of(icosphere(3), 4)
CAMERA = perspective_camera(look_at((0.5, -4, 1), (0, 0, 0)), 240, 200, fov=np.radians(40))
ORTHOGRAPHIC = orthographic_camera(look_at((0.5, -4, 1), (0, 0, 0)), 240, 200, scale=2.5)


@pytest.mark.slow
def test_families_of_several_instances_are_merged_by_name():
    degree_6 = instance_of(icosphere(3), 6, matrix=moved(x=0.9))
    occluder = MeshInstance(plane(), moved(z=-1.0))
    style = StrokeStyle(spacing=16, outline=1.0)
    drawing = draw_instances([occluder, SPHERE, degree_6], CAMERA, style)
    strokes = drawing.strokes
    assert strokes.names == ("family 1", "family 2", "family 3", *OUTLINE_KINDS)
    for instance, expected in ((1, {0, 1}), (2, {0, 1, 2})):
        families = set(strokes.family[drawing.instance_index == instance].tolist())
        assert families - {3, 4, 5} == expected and 3 in families
    assert set(drawing.instance_index.tolist()) == {1, 2}
    # Points are on the sphere of their instance.
    is_first = (drawing.instance_index == 1)[strokes.stroke]
    center = np.where(is_first[:, None], 0.0, [0.9, 0, 0])
    assert np.abs(np.linalg.norm(strokes.points - center, axis=1) - 1).max() < 0.02


@pytest.mark.slow
def test_a_floor_that_continues_behind_the_camera_is_drawn():
    """Beside the camera, outside the frame, spacings in pixels are almost zero in world space."""
    floor = turned(plane(60, 60, size=40.0), 2)
    camera = perspective_camera(look_at((0, -10, 3), (0, 0, 0)), 200, 150, fov=np.radians(40))
    drawing = draw_instances([floor], camera, StrokeStyle(spacing=10, overshoot=12.0))
    pixels, depth = project_to_pixels(drawing.strokes.points, camera)
    assert len(drawing.strokes) > 10 and depth.min() > 0
    assert (pixels >= -1e-6).all() and (pixels <= np.array([200, 150]) + 1e-6).all()


@pytest.mark.parametrize("distance", [0.1, 0.2])
def test_spacings_in_world_units_do_not_depend_on_the_camera(distance):
    camera = orthographic_camera(look_at((0, 0, 5), (0, 0, 0), (0, 1, 0)), 300, 300, scale=3.0)
    style = StrokeStyle(unit="world", distance=distance, hidden=True)
    drawing = draw_instances([turned(plane(8, 8), 2)], camera, style)
    # The total length is the area, 2 by 2, divided by the distance.
    assert np.isclose(drawing.strokes.length.sum(), 4 / distance, rtol=0.12)


def test_light_is_that_of_lambert():
    """The tones are in closed form on a sphere, whose normals are its points."""
    normal = normalize(SPHERE.surface.vertices)
    rotation = CAMERA.view[:3, :3]
    sun = Light("sun", np.array([0.6, 0.0, 0.8]), np.ones(3), 0.7)
    position = np.array([0.3, -1.7, 2.0])
    point = Light("point", rotation @ position + CAMERA.view[:3, 3], np.array([0, 1.0, 0]), 1.5)
    to_light = position - SPHERE.surface.vertices
    sun_tone = 0.7 * np.maximum(normal @ (rotation.T @ sun.vector), 0)
    point_tone = 1.5 * 0.7152 * np.maximum(dot(normal, normalize(to_light)), 0)
    point_tone /= dot(to_light, to_light)
    for lights, tone in (
        ([sun], sun_tone),
        ([point], point_tone),
        ([sun, point], sun_tone + point_tone),
        ([], np.maximum(dot(normal, CAMERA.view_directions(SPHERE.surface.vertices)), 0)),
    ):
        np.testing.assert_allclose(lit_tone(SPHERE, CAMERA, lights), np.minimum(tone, 1), atol=0.02)


@pytest.mark.slow
@pytest.mark.parametrize("camera", [CAMERA, ORTHOGRAPHIC], ids=["perspective", "orthographic"])
def test_offset_toward_the_camera_keeps_the_picture_and_clears_the_surface(camera):
    strokes = draw_instances([SPHERE], camera, StrokeStyle(spacing=16)).strokes
    points = offset_toward_camera(strokes, camera, 2.0)
    pixels, depth = project_to_pixels(strokes.points, camera)
    offset_pixels, offset_depth = project_to_pixels(points, camera)
    np.testing.assert_allclose(offset_pixels, pixels, atol=1e-6)
    pixel = pixel_size(strokes.points, camera)
    assert ((depth - offset_depth) / pixel > 1.9).all()
    # A ribbon of 2 pixels extends into a slope by 1 pixel times its steepness.
    facing = dot(strokes.normal, camera.view_directions(strokes.points))
    compared = facing > 0.15
    steepness = np.sqrt(1 - facing[compared] ** 2) / facing[compared]
    offset = np.linalg.norm(points - strokes.points, axis=1)[compared]
    assert (offset / pixel[compared] > steepness).all()


@pytest.mark.slow
def test_stroke_geometry_has_the_width_and_colors_of_the_pen():
    drawing = draw_instances([SPHERE], CAMERA, StrokeStyle(spacing=20, taper=0.0))
    geometry = stroke_geometry(drawing, CAMERA, Pen(width=3.0, colors=["#112233", "#445566"]))
    np.testing.assert_allclose(2 * geometry.radius / pixel_size(geometry.points, CAMERA), 3.0)
    assert geometry.colors == ["#112233", "#445566"]
    hidden = draw_instances([SPHERE], CAMERA, StrokeStyle(spacing=20, hidden=True))
    offset_points = stroke_geometry(hidden, CAMERA, Pen(width=3.0)).points
    assert np.linalg.norm(offset_points, axis=1).min() > 1
    assert len(hidden.strokes) > len(drawing.strokes)


@pytest.mark.parametrize("tilt", [0.8, 1.4, 2.8])
def test_seeding_ends_where_shading_normals_are_steep(tilt):
    """As on polygons that are not flat: strokes beside each other still find each other."""
    flat = plane(2, 2)
    normal = np.tile((0.0, np.sin(tilt), np.cos(tilt)), (len(flat.corner_vertex), 1))
    with listening(cancel_at(300)):
        strokes = trace_strokes(turned(rebuilt(flat, corner_normal=normal), 2), 0.1)
    assert 30 < strokes.length.sum() < 50


@pytest.mark.slow
def test_blocks_do_not_change_strokes(monkeypatch):
    style = StrokeStyle(spacing=16, outline=1.0)
    expected = draw_instances([SPHERE], CAMERA, style).strokes
    for module, name in (
        (separation, "BLOCK_POINTS"),
        (visibility, "BLOCK_POINTS"),
        (visibility, "SMOOTHED_POINTS"),
        (seeding, "SEED_BATCH_SIZE"),
        (lateral_neighbors, "PAIR_BLOCK"),
    ):
        monkeypatch.setattr(module, name, 100)
    strokes = draw_instances([SPHERE], CAMERA, style).strokes
    for name, values in vars(expected).items():
        np.testing.assert_array_equal(getattr(strokes, name), values, err_msg=name)


def test_seeding_ends_where_all_strokes_are_short():
    """Short strokes seeded each other in turn for ever on faces of a few spacings."""
    points = [(1, 1, 1), (-1, -1, 1), (-1, 1, -1), (1, -1, -1)]
    triangles = [(0, 1, 2), (0, 3, 1), (0, 2, 3), (1, 3, 2)]
    surface = from_triangles(points, triangles, sharp_angle=0.5)
    instance = instance_of(surface, 6)
    camera = orbit_camera(surface.vertices, 45, 20, 150, 100)
    with listening(cancel_at(300)):
        draw_instances([instance], camera, StrokeStyle(curvature=0.5, hidden=True))


@pytest.mark.slow
def test_errors(error_of):
    behind, away = replace(SPHERE, matrix=moved(y=-50.0)), replace(SPHERE, matrix=moved(x=9.0))
    pixel = float(pixel_size(SPHERE.world_points(), CAMERA).min())
    for instance, settings, message in (
        (replace(SPHERE, field=None), {}, "no object has a field"),
        (behind, {}, "no stroke is visible"),
        (away, {}, "no stroke is visible"),
        (SPHERE, {"spacing": 500}, "no stroke fits"),
        (SPHERE, {"unit": "world", "distance": 0.4 * pixel}, "strokes would be 0.4 pixels"),
    ):
        assert message in error_of(draw_instances, [instance], CAMERA, StrokeStyle(**settings))
    assert "pen" in error_of(Pen, width=0.0)
    style = StrokeStyle(hidden=True, spacing=1)
    unseen = draw_instances([behind], CAMERA, style, clip_to_frame=False)
    assert 20 < len(unseen.strokes) < 2000


@pytest.mark.slow
def test_swelling_strokes_are_evenly_spaced():
    """They are where strokes without a tone are, and their width is the darkness."""
    style = StrokeStyle(spacing=16, taper=0.0, hidden=True)
    even = draw_instances([SPHERE], CAMERA, style).strokes
    swelling_style = replace(style, light="headlight", swell=1.0)
    swelling = draw_instances([SPHERE], CAMERA, swelling_style).strokes
    denser = draw_instances([SPHERE], CAMERA, replace(style, light="headlight")).strokes
    distances = [cKDTree(even.points).query(each.points)[0] for each in (swelling, denser)]
    share, share_of_denser = (np.mean(distance < 1e-6) for distance in distances)
    assert share > 0.9 > 0.5 > share_of_denser
    first = swelling.family[swelling.stroke] == 0
    to_eye = CAMERA.view_directions(swelling.points)
    darkness = 1 - np.clip(dot(normalize(swelling.points), to_eye), 0, 1)
    np.testing.assert_allclose(swelling.width[first], darkness[first], atol=0.05)


# --- creases -------------------------------------------------------------------------------------

CUBE_CAMERA = orthographic_camera(look_at((3, -5, 4), (0, 0, 0)), 300, 300, scale=2.0)


@pytest.mark.slow
@pytest.mark.parametrize("light", ["none", "scene"])
def test_spacing_and_width_are_even_up_to_creases(light):
    """A flat face under a sun has one tone and, without perspective, one spacing."""
    style = StrokeStyle(spacing=7.0, light=light, layering=0.0, taper=0.0)
    # Different tones on the three faces of the cube that the camera sees.
    lights = [Light("sun", np.array([-0.8, 0.3, 0.52]), np.ones(3), 0.9)]
    cube = instance_of(sharp_cube(), 4, (0.2, 1.0, 0.1))
    strokes = draw_instances([cube], CUBE_CAMERA, style, lights=lights).strokes
    assert len(np.unique(strokes.face)) == 3
    spacings = set()
    for face in np.unique(strokes.face):
        spacing, width = strokes.spacing[strokes.face == face], strokes.width[strokes.face == face]
        assert np.ptp(spacing) < 1e-6 * spacing.max() and np.ptp(width) < 1e-6
        spacings.add(round(float(spacing[0]), 6))
    assert len(spacings) == 3


@pytest.mark.slow
def test_strokes_reach_creases_at_full_width():
    """Only ends inside faces are tapered: at creases, tapered ends leave a pale margin."""
    instance = instance_of(sharp_cube(), 4)
    strokes = draw_instances([instance], CUBE_CAMERA, StrokeStyle(spacing=7.0, taper=0.8)).strokes
    ends = np.concatenate([strokes.start[:-1], strokes.start[1:] - 1])
    at_crease = (np.abs(np.abs(strokes.points[ends] - 0.5) - 0.5) < 1e-6).sum(axis=1) >= 2
    assert at_crease.sum() > 60 and strokes.width[ends][at_crease].min() == 1
    assert strokes.width[ends][~at_crease].min() < 0.5
