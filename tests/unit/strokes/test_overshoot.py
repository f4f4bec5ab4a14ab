"""Strokes that run on: which of their ends, how far, which way, and where that is in space."""

from __future__ import annotations

import numpy as np
import pytest
from shapes import cube, icosphere, moved, plane

from rosy_addon.field.frames import dot, normalize
from rosy_addon.field.generate import GeneratorSettings, axis_field, generate
from rosy_addon.field.surface import build_surface
from rosy_addon.projection.camera import look_at, orthographic_camera, perspective_camera
from rosy_addon.projection.gbuffer import MeshInstance
from rosy_addon.strokes.outline import OUTLINE_KINDS
from rosy_addon.strokes.overshoot import MIN_EXTENSION_RATIO, extend_free_ends
from rosy_addon.strokes.pipeline import TIP_WIDTH, draw_bodies
from rosy_addon.strokes.style import StrokeStyle
from rosy_addon.strokes.svg import Pen, svg_text
from rosy_addon.strokes.visibility import clip_to_visible, project_to_pixels, rasterize_depth

STILL = np.eye(4)
ALONG_X = GeneratorSettings("axis", (1.0, 0.0, 0.0))
FAR = 12.0

SQUARE = MeshInstance(plane(8, 8), STILL, generate(plane(8, 8), ALONG_X, 2))
ABOVE = orthographic_camera(look_at((0, 0, 5), (0, 0, 0), (0, 1, 0)), 300, 300, scale=3.0)

BALL = MeshInstance(icosphere(4), STILL, generate(icosphere(4), "smoothest", 4))
FRONT = perspective_camera(look_at((0.5, -4, 1), (0, 0, 0)), 400, 360, fov=np.radians(40))


def both(instances, camera, **more):
    """The same strokes without, and with, ends that run on."""
    return (
        draw_bodies(instances, camera, StrokeStyle(**more, overshoot=far)).strokes
        for far in (0, FAR)
    )


def ends_of(strokes):
    return strokes.points[np.stack([strokes.start[:-1], strokes.start[1:] - 1], axis=1)]


def growth(plain, longer, camera):
    """(S,) pixels by which strokes are longer."""
    lengths = []
    for strokes in (plain, longer):
        pixels, _ = project_to_pixels(strokes.points, camera)
        step = np.hypot(*np.diff(pixels, axis=0).T)
        own = np.diff(strokes.stroke) == 0
        lengths.append(np.bincount(strokes.stroke[1:][own], step[own]))
    return lengths[1] - lengths[0]


def test_at_a_border_lines_go_straight_on_some_farther_than_others():
    plain, longer = both([SQUARE], ABOVE, spacing=3.0)
    assert len(plain) == len(longer) > 50
    more = np.abs(ends_of(longer)[:, :, 0]) - np.abs(ends_of(plain)[:, :, 0])
    assert np.allclose(np.abs(ends_of(plain)[:, :, 0]), 1)
    pixels = 100 * more
    assert pixels.min() >= MIN_EXTENSION_RATIO * FAR - 1e-6 and pixels.max() <= FAR + 1e-6
    assert pixels.mean() == pytest.approx((1 + MIN_EXTENSION_RATIO) / 2 * FAR, rel=0.1)
    assert pixels.std() > 0.15 * FAR
    # As straight as the field, and in its plane.
    y = longer.points[:, 1]
    assert np.abs(y - y[longer.start[:-1]][longer.stroke]).max() < 1e-6
    assert np.abs(longer.points[:, 2]).max() < 1e-6
    assert (np.diff(longer.points[:, 0])[np.diff(longer.stroke) == 0] != 0).all()


def test_without_it_nothing_changes():
    plain, again = (
        draw_bodies([BALL], FRONT, StrokeStyle(spacing=9, **more)).strokes
        for more in ({}, {"overshoot": 0.0})
    )
    assert np.array_equal(plain.points, again.points) and np.array_equal(plain.width, again.width)


def test_past_a_silhouette_lines_cross_it():
    plain, longer = both([BALL], FRONT, spacing=9.0)
    assert len(plain) == len(longer)
    more = growth(plain, longer, FRONT)
    assert more.max() <= 2 * FAR + 0.5 and more[more > 1].mean() > MIN_EXTENSION_RATIO * FAR
    pixels, depth = project_to_pixels(longer.points, FRONT)
    place = np.clip(pixels.astype(int), 0, (399, 359))
    beyond = rasterize_depth([BALL], FRONT).triangle[place[:, 1], place[:, 0]] < 0
    rim = project_to_pixels(plain.points, FRONT)[0]
    middle = project_to_pixels(np.zeros((1, 3)), FRONT)[0]
    radius = np.hypot(*(rim - middle).T).max()
    out = np.hypot(*(pixels - middle).T)
    assert beyond.sum() > 200 and out.max() < radius + FAR + 1
    assert out.max() > radius + 0.5 * FAR
    # At one depth, and straight.
    checked = 0
    for first, last in zip(longer.start[:-1], longer.start[1:], strict=True):
        for part in (slice(first, first + 4), slice(last - 4, last)):
            if not (beyond[part].all() and (out[part] > radius + 1).all()):
                continue
            assert np.ptp(depth[part]) < 1e-9
            steps = np.diff(pixels[part], axis=0)
            assert np.allclose(steps, steps[:1], atol=1e-6)
            checked += 1
    assert checked > 20


def test_lines_have_the_direction_that_they_had():
    plain, longer = both([BALL], FRONT, spacing=9.0)
    before, after = (project_to_pixels(strokes.points, FRONT)[0] for strokes in (plain, longer))
    turned = []
    for number, (last, was) in enumerate(
        zip(longer.start[1:] - 1, plain.start[1:] - 1, strict=True)
    ):
        if np.allclose(longer.points[last], plain.points[was]):
            continue
        size = was - plain.start[number]
        if size < 40:
            continue
        tail = after[last] - after[last - 3]
        had = before[was - 8] - before[was - 12]
        turned.append(tail @ had / np.linalg.norm(tail) / np.linalg.norm(had))
    assert len(turned) > 15
    assert np.median(turned) > np.cos(np.radians(4)) and np.min(turned) > np.cos(np.radians(30))


def test_what_is_in_front_is_crossed_on_it():
    wall = MeshInstance(plane(), moved(x=1.2, z=0.7))
    plain, longer = both([SQUARE, wall], ABOVE, spacing=6.0)
    right = ends_of(longer)[:, :, 0].max(axis=1)
    was = ends_of(plain)[:, :, 0].max(axis=1)
    assert (
        np.abs(was - 0.2).max() < 0.02
        and (right - was > 0.01 * (MIN_EXTENSION_RATIO * FAR - 1)).all()
    )
    over = longer.points[:, 0] > 0.22
    assert over.sum() > 100 and np.allclose(longer.points[over, 2], 0.7, atol=1e-6)
    under = longer.points[:, 0] < 0.18
    assert np.allclose(longer.points[under, 2], 0, atol=1e-6)


def test_where_the_light_lifts_the_pen_lines_run_on_along_the_surface():
    plain, longer = both([BALL], FRONT, spacing=6.0, tone=True, light="lamp")
    # Off the ball in no place that the ball is seen at, by more than what half a pixel is there.
    pixels, _ = project_to_pixels(longer.points, FRONT)
    place = pixels.astype(int)
    there = rasterize_depth([BALL], FRONT)
    triangle = there.triangle[place[:, 1], place[:, 0]]
    toward = dot(normalize(longer.points), FRONT.view_directions(longer.points))
    facing = (triangle >= 0) & (toward > 0.5)
    off = np.linalg.norm(longer.points[facing], axis=1) - 1
    assert np.abs(off).max() < 0.02
    # Ink, width times length in the picture, is hardly more.
    ink = []
    for strokes in (plain, longer):
        flat, _ = project_to_pixels(strokes.points, FRONT)
        step = np.hypot(*np.diff(flat, axis=0).T) * (np.diff(strokes.stroke) == 0)
        light = normalize(strokes.points) @ (FRONT.view[:3, :3].T @ [-0.5, 0.6, 0.62])
        bins = np.digitize(light[1:], [0.0, 0.3, 0.6, 0.9])
        ink.append(np.bincount(bins, strokes.width[1:] * step, 5))
    more = ink[1] / ink[0]
    assert more.min() > 1 and more.max() < 1.1


def test_ends_at_gaps_and_at_neighbours_stay():
    crossed = MeshInstance(SQUARE.surface, STILL, axis_field(SQUARE.surface, 4, (1, 0, 0)))
    plain, longer = both([crossed], ABOVE, spacing=20.0, gaps=0.3)
    inner = np.abs(ends_of(plain)[:, :, :2]).max(axis=(1, 2)) < 1 - 1e-9
    assert inner.sum() > 50 and not inner.all()
    for number in np.flatnonzero(inner):
        one, other = (strokes.select([number]) for strokes in (plain, longer))
        assert np.array_equal(one.points, other.points) and np.allclose(one.width, other.width)
    assert (growth(plain, longer, ABOVE)[~inner] > 1).all()
    # On the ball lines end where there is no room left for them.
    plain, longer = both([BALL], FRONT, spacing=9.0)
    facing = dot(normalize(ends_of(plain)), FRONT.view_directions(ends_of(plain))) > 0.5
    assert facing.sum() > 10
    assert np.allclose(ends_of(plain)[facing], ends_of(longer)[facing])


def test_closed_lines_and_outlines_have_no_ends():
    rings = MeshInstance(icosphere(4), STILL, axis_field(icosphere(4), 4, (0, 0, 1)))
    plain, longer = both([rings], ABOVE, spacing=12.0, outline=True)
    closed = plain.closed & longer.closed
    assert closed.sum() >= 4
    for number in np.flatnonzero(closed):
        assert np.array_equal(plain.select([number]).points, longer.select([number]).points)
    wall = MeshInstance(plane(), moved(x=1.2, z=1.7))
    plain, longer = both([rings, wall], ABOVE, spacing=12.0, outline=True)
    for kind in OUTLINE_KINDS:
        one, other = (s.select(s.family == s.names.index(kind)) for s in (plain, longer))
        assert np.array_equal(one.points, other.points) and np.allclose(one.width, other.width)
    assert (~longer.closed).any()


def test_creases_end_lines_unless_they_cross():
    whole = cube()
    box = build_surface(
        whole.vertices, whole.corner_vertex, whole.face_start, name="cube", sharp_angle=0.5
    )
    instance = MeshInstance(box, STILL, axis_field(box, 2, (0.2, 1.0, 0.1)))
    camera = orthographic_camera(look_at((3, -5, 4), (0, 0, 0)), 300, 300, scale=3.0)
    plain, longer = both([instance], camera, spacing=8.0)
    assert (growth(plain, longer, camera) > 1).mean() > 0.9
    plain, longer = both([instance], camera, spacing=8.0, cross_creases=True)
    assert (growth(plain, longer, camera) > 1).mean() > 0.5


def test_the_frame_cuts_them():
    near = orthographic_camera(look_at((0, 0, 5), (0, 0, 0), (0, 1, 0)), 206, 206, scale=2.06)
    for more in ({}, {"hidden": True}):
        made = draw_bodies([SQUARE], near, StrokeStyle(spacing=6, overshoot=FAR, **more)).strokes
        pixels, _ = project_to_pixels(made.points, near)
        assert (pixels >= 0).all() and (pixels <= 206).all()
        assert np.abs(ends_of(made)[:, :, 0]).min() > 1.015


@pytest.mark.parametrize("taper", [0.0, 1.0])
def test_they_get_thinner_as_the_taper_says(taper):
    made = draw_bodies([SQUARE], ABOVE, StrokeStyle(spacing=6, taper=taper, overshoot=FAR)).strokes
    tips = made.width[np.stack([made.start[:-1], made.start[1:] - 1], axis=1)]
    assert np.allclose(tips, TIP_WIDTH if taper else 1.0)
    from_tip = np.minimum(made.arc, made.length[made.stroke] - made.arc)
    assert np.allclose(made.width[from_tip >= taper * 0.06 + 1e-9], 1.0)
    assert not taper or made.width[from_tip < 0.03].max() < 0.7


def test_kept_behind_they_run_on_in_space():
    """On a slope: in its plane, whatever the camera sees of it."""
    slope = np.eye(4)
    slope[:3, :3] = [[0.6, 0, -0.8], [0, 1, 0], [0.8, 0, 0.6]]
    instance = MeshInstance(SQUARE.surface, slope, SQUARE.field)
    made = draw_bodies(
        [instance], ABOVE, StrokeStyle(spacing=6, hidden=True, overshoot=FAR), clip_to_frame=False
    ).strokes
    local = made.points @ slope[:3, :3]
    assert np.abs(local[:, 2]).max() < 1e-9
    out = np.abs(ends_of(made) @ slope[:3, :3])[:, :, 0] - 1
    assert out.min() > 0.01 * MIN_EXTENSION_RATIO * FAR - 1e-6 and out.max() <= 0.01 * FAR + 1e-6


def test_beside_and_behind_the_eye_nothing_breaks():
    surface = plane(20, 20, size=40.0)
    floor = MeshInstance(surface, STILL, generate(surface, ALONG_X, 2))
    camera = perspective_camera(look_at((0, -10, 3), (0, 0, 0)), 200, 150, fov=np.radians(40))
    for more in ({}, {"hidden": True}):
        made = draw_bodies(
            [floor], camera, StrokeStyle(spacing=20, overshoot=FAR, **more), clip_to_frame=False
        )
        assert np.isfinite(made.strokes.points).all() and np.isfinite(made.strokes.width).all()
        assert np.abs(made.strokes.points[:, 2]).max() < 1e-3


def test_plotters_and_strokes_that_are_too_short():
    longer = draw_bodies([BALL], FRONT, StrokeStyle(spacing=9, overshoot=FAR)).strokes
    assert svg_text(longer, FRONT, Pen(plotter=True)).count("<path") == len(longer)
    traced = draw_bodies([SQUARE], ABOVE, StrokeStyle(spacing=6, taper=0)).strokes
    short = traced.runs_where(np.abs(traced.points[:, 0]) < 0.02)
    assert short.free_end_mask.all()
    more = growth(short, extend_free_ends(short, ABOVE, 100.0, [SQUARE]), ABOVE)
    assert np.allclose(more, 100 * short.length)  # as long again as they were


def test_no_end_is_loose_unless_something_ended_it():
    traced = draw_bodies([SQUARE], ABOVE, StrokeStyle(spacing=6, taper=0)).strokes
    assert (
        not traced.free_end_mask.any()
        and not clip_to_visible(traced, [SQUARE], ABOVE).free_end_mask.any()
    )


def test_wrong_input_is_one_line(error_of):
    assert "setting 'overshoot' is -1, expected a number from 0" in error_of(
        StrokeStyle, overshoot=-1
    )
