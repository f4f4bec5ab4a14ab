"""Drawings of several bodies: what is in them, how dense it is, and the lines that are made of them."""

from __future__ import annotations

import numpy as np
import pytest
from shapes import icosphere, moved, plane

from rosy_addon.compositor.shading import KEY_LIGHT, Light
from rosy_addon.field.frames import dot, normalize
from rosy_addon.field.generate import GeneratorSettings, generate
from rosy_addon.projection.camera import look_at, orthographic_camera, perspective_camera
from rosy_addon.projection.gbuffer import MeshInstance
from rosy_addon.strokes.pipeline import (
    draw_bodies,
    offset_toward_camera,
    simplify_strokes,
    stroke_geometry,
)
from rosy_addon.strokes.spacing import lit_tone
from rosy_addon.strokes.style import StrokeStyle
from rosy_addon.strokes.svg import Pen
from rosy_addon.strokes.visibility import pixel_size, project_to_pixels

STILL = np.eye(4)
ALONG_X = GeneratorSettings("axis", (1.0, 0.0, 0.0))
BALL = MeshInstance(icosphere(3), STILL, generate(icosphere(3), "smoothest", 4))
CAMERA = perspective_camera(look_at((0.5, -4, 1), (0, 0, 0)), 240, 200, fov=np.radians(40))


def test_families_of_several_bodies_are_one_by_name():
    six = MeshInstance(icosphere(3), moved(x=0.9), generate(icosphere(3), "smoothest", 6))
    screen = MeshInstance(plane(), moved(z=-1.0))
    made = draw_bodies([screen, BALL, six], CAMERA, StrokeStyle(spacing=12, outline=True))
    names = made.strokes.names
    assert names == ("family 1", "family 2", "family 3", "silhouettes", "creases", "borders")
    for instance, families in ((1, {0, 1}), (2, {0, 1, 2})):
        own = set(made.strokes.family[made.body_index == instance].tolist())
        assert own - {3, 4, 5} == families and 3 in own
    assert set(made.body_index.tolist()) == {1, 2}
    # Points are on the sphere that their body is.
    middle = np.where((made.body_index == 1)[made.strokes.stroke, None], 0.0, [0.9, 0, 0])
    assert np.abs(np.linalg.norm(made.strokes.points - middle, axis=1) - 1).max() < 0.02


def test_a_floor_that_runs_on_behind_the_eye_is_drawn():
    """Spacings in pixels are next to nothing beside the eye; nobody looks there."""
    surface = plane(60, 60, size=40.0)
    floor = MeshInstance(surface, STILL, generate(surface, ALONG_X, 2))
    camera = perspective_camera(look_at((0, -10, 3), (0, 0, 0)), 200, 150, fov=np.radians(40))
    made = draw_bodies([floor], camera, StrokeStyle(spacing=10))
    pixels, depth = project_to_pixels(made.strokes.points, camera)
    assert len(made.strokes) > 10 and depth.min() > 0
    assert (pixels >= -1e-6).all() and (pixels <= np.array([200, 150]) + 1e-6).all()


@pytest.mark.parametrize("distance", [0.1, 0.2])
def test_spacings_in_units_do_not_ask_the_camera(distance):
    square = MeshInstance(plane(8, 8), STILL, generate(plane(8, 8), ALONG_X, 2))
    camera = orthographic_camera(look_at((0, 0, 5), (0, 0, 0), (0, 1, 0)), 300, 300, scale=3.0)
    made = draw_bodies([square], camera, StrokeStyle(unit="world", distance=distance, hidden=True))
    # The area, 2 by 2, over the distance.
    assert np.isclose(made.strokes.length.sum(), 4 / distance, rtol=0.12)


def test_light_is_that_of_lambert():
    """In closed form on a sphere, whose normals are its points."""
    normal = normalize(BALL.surface.vertices)
    turn = CAMERA.view[:3, :3]
    sun = Light("sun", np.array([0.6, 0.0, 0.8]), np.ones(3), 0.7)
    place = np.array([0.3, -1.7, 2.0])
    point = Light("point", turn @ place + CAMERA.view[:3, 3], np.array([0, 1.0, 0]), 1.5)
    bright = 0.7 * np.maximum(normal @ (turn.T @ sun.vector), 0)
    np.testing.assert_allclose(lit_tone(BALL, CAMERA, [sun]), bright, atol=0.01)
    way = place - BALL.surface.vertices
    near = 1.5 * 0.7152 * np.maximum(dot(normal, normalize(way)), 0) / dot(way, way)
    np.testing.assert_allclose(lit_tone(BALL, CAMERA, [point]), np.minimum(near, 1), atol=0.01)
    both = np.minimum(bright + near, 1)
    np.testing.assert_allclose(lit_tone(BALL, CAMERA, [sun, point]), both, atol=0.02)


def test_light_makes_room():
    manner = StrokeStyle(unit="world", distance=0.05, tone=True)
    made = draw_bodies([BALL], CAMERA, manner, lights=[KEY_LIGHT]).strokes
    light = normalize(made.points) @ (CAMERA.view[:3, :3].T @ KEY_LIGHT.vector)
    assert made.spacing[light > 0.8].mean() > 2.5 * made.spacing[light < 0.0].mean()
    assert light.max() < 0.97 and made.width[light > 0.9].max() < 0.35
    # One family in the lights, both in the dark.
    families = [np.unique(made.family[made.stroke][part]) for part in (light > 0.75, light < 0.2)]
    assert [len(found) for found in families] == [1, 2]


def test_thinned_lines_miss_nothing():
    strokes = draw_bodies([BALL], CAMERA, StrokeStyle(spacing=12)).strokes
    thin = simplify_strokes(strokes, CAMERA)
    assert len(thin) == len(strokes) and len(thin.points) < 0.5 * len(strokes.points)
    np.testing.assert_array_equal(thin.points[thin.start[:-1]], strokes.points[strokes.start[:-1]])
    # Every point that was left out is near the piece between those that stayed.
    pixel = pixel_size(strokes.points, CAMERA)
    worst = 0.0
    for number in range(len(strokes)):
        was = slice(*strokes.start[number : number + 2])
        left = thin.points[slice(*thin.start[number : number + 2])]
        along = np.diff(left, axis=0)
        off = strokes.points[was][:, None] - left[:-1]
        share = np.einsum("nki,ki->nk", off, along) / (along**2).sum(axis=1)
        off = off - np.clip(share, 0, 1)[..., None] * along
        nearest = np.sqrt((off**2).sum(axis=2)).min(axis=1)
        worst = max(worst, float((nearest / pixel[was]).max()))
    assert worst < 0.11


@pytest.mark.parametrize("ortho", [False, True])
def test_lifted_lines_stay_in_the_picture_and_off_the_surface(ortho):
    camera = CAMERA
    if ortho:
        camera = orthographic_camera(look_at((0.5, -4, 1), (0, 0, 0)), 240, 200, scale=2.5)
    strokes = draw_bodies([BALL], camera, StrokeStyle(spacing=12)).strokes
    points = offset_toward_camera(strokes, camera, 2.0)
    before, depth = project_to_pixels(strokes.points, camera)
    after, nearer = project_to_pixels(points, camera)
    np.testing.assert_allclose(after, before, atol=1e-6)
    pixel = pixel_size(strokes.points, camera)
    assert ((depth - nearer) / pixel > 1.9).all()
    # A ribbon of 2 pixels reaches into the slope by 1 pixel times its steepness.
    eye = -camera.view[:3, :3].T @ camera.view[:3, 3]
    toward = normalize(eye - strokes.points) if not ortho else camera.view[2, :3]
    facing = dot(strokes.normal, np.broadcast_to(toward, strokes.points.shape))
    clear = facing > 0.15
    slope = np.sqrt(1 - facing[clear] ** 2) / facing[clear]
    lift = np.linalg.norm(points - strokes.points, axis=1)[clear]
    assert (lift / pixel[clear] > slope).all()


def test_lines_have_the_width_of_the_pen():
    made = draw_bodies([BALL], CAMERA, StrokeStyle(spacing=12, taper=0.0))
    lines = stroke_geometry(made, CAMERA, Pen(width=3.0, colours=["#112233", "#445566"]))
    np.testing.assert_allclose(2 * lines.radius / pixel_size(lines.points, CAMERA), 3.0)
    assert lines.colors == ["#112233", "#445566"]
    hidden = draw_bodies([BALL], CAMERA, StrokeStyle(spacing=12, hidden=True))
    raised = stroke_geometry(hidden, CAMERA, Pen(width=3.0)).points
    assert np.linalg.norm(raised, axis=1).min() > 1 and len(hidden.strokes) > len(made.strokes)


def test_what_is_wrong_is_said(error_of):
    assert "no object has a field" in error_of(draw_bodies, [MeshInstance(plane(), STILL)], CAMERA)
    behind = MeshInstance(BALL.surface, moved(y=-50.0), BALL.field)
    assert "no stroke is visible" in error_of(draw_bodies, [behind], CAMERA)
    unseen = draw_bodies([behind], CAMERA, StrokeStyle(hidden=True, spacing=1), clip_to_frame=False)
    assert 20 < len(unseen.strokes) < 2000
    assert "no stroke fits" in error_of(draw_bodies, [BALL], CAMERA, StrokeStyle(spacing=500))
    away = MeshInstance(BALL.surface, moved(x=9.0), BALL.field)
    assert "no stroke is visible" in error_of(draw_bodies, [away], CAMERA)
    assert "setting 'spacing' is 0, expected a number from 0.5" in error_of(StrokeStyle, spacing=0)
    assert "setting 'curvature' is nan" in error_of(StrokeStyle, curvature=np.nan)
    assert "'sun', expected one of headlight, lamp, scene" in error_of(StrokeStyle, light="sun")
    assert "pen" in error_of(Pen, width=0.0)
