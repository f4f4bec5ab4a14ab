"""Overshoot: which ends are extended, by which length, and in which direction."""

from functools import lru_cache

import numpy as np
import pytest
from harness.stroke_tracing import latitudes, pixel_lengths, turned
from shapes import icosphere, instance_of, moved, placed, plane, sharp_cube

from rosy_addon.field.frames import dot, normalize
from rosy_addon.line_drawing.outline import OUTLINE_KINDS
from rosy_addon.line_drawing.pipeline import TIP_WIDTH, draw_instances
from rosy_addon.line_drawing.stroke_ends import MIN_EXTENSION_RATIO, extend_free_ends
from rosy_addon.line_drawing.style import StrokeStyle
from rosy_addon.line_drawing.visibility import project_to_pixels, rasterize_depth
from rosy_addon.projection.camera import look_at, orthographic_camera, perspective_camera
from rosy_addon.projection.gbuffer import MeshInstance

pytestmark = pytest.mark.slow

MAX_PIXELS = 12.0

SQUARE = turned(plane(8, 8), 2)
TOP_CAMERA = orthographic_camera(look_at((0, 0, 5), (0, 0, 0), (0, 1, 0)), 300, 300, scale=3.0)

SPHERE = instance_of(icosphere(4), 4, "axis")
FRONT_CAMERA = perspective_camera(look_at((0.5, -4, 1), (0, 0, 0)), 400, 360, fov=np.radians(40))


@lru_cache(maxsize=8)
def strokes_of(instances, camera, style):
    """Draw strokes once for all tests. No test changes them."""
    return draw_instances(instances, camera, style).strokes


def draw_both(instances, camera, **options):
    """Return the same strokes without and with overshoot."""
    styles = [StrokeStyle(**options, overshoot=overshoot) for overshoot in (0, MAX_PIXELS)]
    return (strokes_of(tuple(instances), camera, style) for style in styles)


def ends_of(strokes):
    """Return the (S, 2, 3) first and last points of strokes."""
    return strokes.points[np.stack([strokes.start[:-1], strokes.start[1:] - 1], axis=1)]


def pixel_growth(plain, extended, camera):
    """Return the (S,) pixels by which strokes are extended."""
    return pixel_lengths(extended, camera) - pixel_lengths(plain, camera)


def test_extensions_at_borders_are_straight_and_of_different_lengths():
    plain, extended = draw_both([SQUARE], TOP_CAMERA, spacing=3.0)
    assert len(plain) == len(extended) > 50
    growth = np.abs(ends_of(extended)[:, :, 0]) - np.abs(ends_of(plain)[:, :, 0])
    assert np.allclose(np.abs(ends_of(plain)[:, :, 0]), 1)
    pixels = 100 * growth
    assert pixels.min() >= MIN_EXTENSION_RATIO * MAX_PIXELS - 1e-6
    assert pixels.max() <= MAX_PIXELS + 1e-6
    assert pixels.mean() == pytest.approx((1 + MIN_EXTENSION_RATIO) / 2 * MAX_PIXELS, rel=0.1)
    assert pixels.std() > 0.15 * MAX_PIXELS
    # Extensions are as straight as the field, and in its plane.
    y = extended.points[:, 1]
    assert np.abs(y - y[extended.start[:-1]][extended.stroke]).max() < 1e-6
    assert np.abs(extended.points[:, 2]).max() < 1e-6
    assert (np.diff(extended.points[:, 0])[np.diff(extended.stroke) == 0] != 0).all()


def test_extensions_cross_the_silhouette():
    plain, extended = draw_both([SPHERE], FRONT_CAMERA, spacing=9.0)
    assert len(plain) == len(extended)
    growth = pixel_growth(plain, extended, FRONT_CAMERA)
    assert growth.max() <= 2 * MAX_PIXELS + 0.5
    assert growth[growth > 1].mean() > MIN_EXTENSION_RATIO * MAX_PIXELS
    pixels, depth = project_to_pixels(extended.points, FRONT_CAMERA)
    plain_pixels = project_to_pixels(plain.points, FRONT_CAMERA)[0]
    center = project_to_pixels(np.zeros((1, 3)), FRONT_CAMERA)[0]
    max_radius = np.hypot(*(plain_pixels - center).T).max()
    radius = np.hypot(*(pixels - center).T)
    assert 0.5 * MAX_PIXELS < radius.max() - max_radius < MAX_PIXELS + 1
    # Extensions are at a constant depth, and straight.
    is_beyond = radius > max_radius + 1
    inner = is_beyond[:-2] & is_beyond[1:-1] & is_beyond[2:]
    inner &= (np.diff(extended.stroke)[1:] == 0) & (np.diff(extended.stroke)[:-1] == 0)
    assert inner.sum() > 50 and np.abs(np.diff(depth)[1:][inner]).max() < 1e-9
    assert np.abs(np.diff(pixels, 2, axis=0)[inner]).max() < 1e-6


def test_extensions_lie_on_occluders_in_front():
    occluder = MeshInstance(plane(), moved(x=1.2, z=0.7))
    plain, extended = draw_both([SQUARE, occluder], TOP_CAMERA, spacing=6.0)
    plain_end = ends_of(plain)[:, :, 0].max(axis=1)
    extended_end = ends_of(extended)[:, :, 0].max(axis=1)
    assert np.abs(plain_end - 0.2).max() < 0.02
    min_growth = 0.01 * (MIN_EXTENSION_RATIO * MAX_PIXELS - 1)
    assert (extended_end - plain_end > min_growth).all()
    on_occluder = extended.points[:, 0] > 0.22
    assert on_occluder.sum() > 100 and np.allclose(extended.points[on_occluder, 2], 0.7, atol=1e-6)
    on_square = extended.points[:, 0] < 0.18
    assert np.allclose(extended.points[on_square, 2], 0, atol=1e-6)


def test_extensions_into_the_light_follow_the_surface():
    plain, extended = draw_both([SPHERE], FRONT_CAMERA, spacing=9.0, light="lamp")
    # Where the sphere is visible, points are on it, within about half a pixel.
    pixels, _ = project_to_pixels(extended.points, FRONT_CAMERA)
    column, row = pixels.astype(int).T
    triangle = rasterize_depth([SPHERE], FRONT_CAMERA).triangle[row, column]
    facing = dot(normalize(extended.points), FRONT_CAMERA.view_directions(extended.points))
    compared = (triangle >= 0) & (facing > 0.5)
    height = np.linalg.norm(extended.points[compared], axis=1) - 1
    assert np.abs(height).max() < 0.02 and pixel_growth(plain, extended, FRONT_CAMERA).mean() > 1


def test_ends_at_gaps_and_at_neighbors_are_not_extended():
    plain, extended = draw_both([turned(SQUARE.surface, 4)], TOP_CAMERA, spacing=20.0, gaps=0.3)
    is_inner = np.abs(ends_of(plain)[:, :, :2]).max(axis=(1, 2)) < 1 - 1e-9
    assert is_inner.sum() > 50 and not is_inner.all()
    a, b = (strokes.select(is_inner) for strokes in (plain, extended))
    assert np.array_equal(a.points, b.points) and np.allclose(a.width, b.width)
    assert (pixel_growth(plain, extended, TOP_CAMERA)[~is_inner] > 1).all()
    # On the sphere, strokes end where they come too near to others.
    plain, extended = draw_both([SPHERE], FRONT_CAMERA, spacing=9.0)
    facing = dot(normalize(ends_of(plain)), FRONT_CAMERA.view_directions(ends_of(plain))) > 0.5
    assert facing.sum() > 10 and np.allclose(ends_of(plain)[facing], ends_of(extended)[facing])


def test_closed_strokes_and_outlines_are_not_extended():
    circles, occluder = latitudes(icosphere(3)), MeshInstance(plane(), moved(x=1.8, z=1.7))
    plain, extended = draw_both([circles, occluder], TOP_CAMERA, spacing=15.0, outline=1.0)
    closed = plain.closed & extended.closed
    assert closed.sum() >= 4
    assert np.array_equal(plain.select(closed).points, extended.select(closed).points)
    for kind in OUTLINE_KINDS:
        a, b = (s.select(s.family == s.names.index(kind)) for s in (plain, extended))
        assert np.array_equal(a.points, b.points) and np.allclose(a.width, b.width)
    assert (~extended.closed).any()


def test_ends_at_creases_are_extended():
    instance = instance_of(sharp_cube(), 2, (0.2, 1.0, 0.1))
    camera = orthographic_camera(look_at((3, -5, 4), (0, 0, 0)), 300, 300, scale=3.0)
    plain, extended = draw_both([instance], camera, spacing=8.0)
    assert (pixel_growth(plain, extended, camera) > 1).mean() > 0.9
    plain, extended = draw_both([instance], camera, spacing=8.0, cross_creases=True)
    assert (pixel_growth(plain, extended, camera) > 1).mean() > 0.5


def test_extensions_are_clipped_to_the_frame():
    camera = orthographic_camera(look_at((0, 0, 5), (0, 0, 0), (0, 1, 0)), 206, 206, scale=2.06)
    for options in ({}, {"hidden": True}):
        style = StrokeStyle(spacing=6, overshoot=MAX_PIXELS, **options)
        strokes = draw_instances([SQUARE], camera, style).strokes
        pixels, _ = project_to_pixels(strokes.points, camera)
        assert (pixels >= 0).all() and (pixels <= 206).all()
        assert np.abs(ends_of(strokes)[:, :, 0]).min() > 1.015


@pytest.mark.parametrize("taper", [0.0, 1.0])
def test_extensions_are_tapered(taper):
    style = StrokeStyle(spacing=6, taper=taper, overshoot=MAX_PIXELS)
    strokes = strokes_of((SQUARE,), TOP_CAMERA, style)
    tips = strokes.width[np.stack([strokes.start[:-1], strokes.start[1:] - 1])]
    assert np.allclose(tips, TIP_WIDTH if taper else 1.0)
    from_tip = np.minimum(strokes.arc, strokes.length[strokes.stroke] - strokes.arc)
    assert np.allclose(strokes.width[from_tip >= taper * 0.06 + 1e-9], 1.0)


def test_with_hidden_strokes_extensions_are_straight_in_space():
    """On a slanted plane, extensions are in the plane. Their length is along the plane."""
    slope = np.array([[0.6, 0, -0.8], [0, 1, 0], [0.8, 0, 0.6]])
    instance = MeshInstance(SQUARE.surface, placed(slope), SQUARE.field)
    style = StrokeStyle(spacing=6, hidden=True, overshoot=MAX_PIXELS)
    strokes = draw_instances([instance], TOP_CAMERA, style, clip_to_frame=False).strokes
    assert np.abs((strokes.points @ slope)[:, 2]).max() < 1e-9
    growth = np.abs(ends_of(strokes) @ slope)[:, :, 0] - 1
    assert growth.min() > 0.01 * MIN_EXTENSION_RATIO * MAX_PIXELS - 1e-6
    assert growth.max() <= 0.01 * MAX_PIXELS + 1e-6


def test_extensions_double_short_strokes():
    """Each end is extended by at most half the length."""
    traced = strokes_of((SQUARE,), TOP_CAMERA, StrokeStyle(spacing=6, taper=0))
    short = traced.runs_where(np.abs(traced.points[:, 0]) < 0.02)
    assert short.free_end_mask.all()
    extended = extend_free_ends(short, TOP_CAMERA, 100.0, rasterize_depth([SQUARE], TOP_CAMERA))
    assert np.allclose(pixel_growth(short, extended, TOP_CAMERA), 100 * short.length)
