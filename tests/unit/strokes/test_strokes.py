"""Strokes: where they run, how far apart, what hides them, and what is written of them."""

from __future__ import annotations

import re
import sys
import xml.etree.ElementTree as ElementTree
from itertools import pairwise

import numpy as np
import pytest
from field_helpers import bumpy
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from shapes import cube, cylinder, icosphere, plane, torus

from bench.stroke_spacing import lateral_gaps
from rosy_addon.cli import main
from rosy_addon.field.frames import dot, normalize, transport
from rosy_addon.field.generate import axis_field, generate
from rosy_addon.field.mesh_io import read_mesh
from rosy_addon.field.representation import face_frames
from rosy_addon.field.rosy_field import RosyField
from rosy_addon.field.surface import build_surface
from rosy_addon.projection.camera import look_at, orbit_camera, orthographic_camera
from rosy_addon.projection.gbuffer import MeshInstance
from rosy_addon.strokes.crossings import cut_intervals, find_crossings, with_crossing_gaps
from rosy_addon.strokes.families import global_labels
from rosy_addon.strokes.head_on_ends import head_on_ends
from rosy_addon.strokes.outline import outline
from rosy_addon.strokes.placement import SeparationRules
from rosy_addon.strokes.separation import enforce_separation
from rosy_addon.strokes.singularity_seeds import singularities
from rosy_addon.strokes.spacing import (
    headlight_tone,
    pixel_spacing,
    spacing_by_curvature,
    spacing_by_foreshortening,
    spacing_by_tone,
    values_at_points,
    weight_by_tone,
)
from rosy_addon.strokes.stroke_set import Strokes
from rosy_addon.strokes.surface_particles import SurfaceParticles, trace_geodesics
from rosy_addon.strokes.svg import Pen, plotter_order, simplify_mask, svg_text
from rosy_addon.strokes.tangent_mesh import build_tangent_mesh
from rosy_addon.strokes.trace import trace_strokes
from rosy_addon.strokes.visibility import clip_to_visible, project_to_pixels

STILL = np.eye(4)


def body_of(surface, degree, angle=0.0, kind=None):
    """With a field at an angle to the first edges of the faces, or a generated one."""
    if kind is not None:
        return MeshInstance(surface, STILL, generate(surface, kind, degree))
    x, y = face_frames(surface)
    return MeshInstance(surface, STILL, RosyField(degree, np.cos(angle) * x + np.sin(angle) * y))


def straight_pieces(strokes):
    """Starts and ends of the pieces, and the triangles that they lie in."""
    stroke = strokes.stroke
    end = np.flatnonzero(np.diff(stroke, prepend=-1) == 0)
    return strokes.points[end - 1], strokes.points[end], strokes.triangle[end]


def degrees_off(ground, strokes, shares=(0.0, 0.5, 1.0)):
    """By how many degrees pieces are off the nearest member, at points along them."""
    start, end, triangle = straight_pieces(strokes)
    long = np.linalg.norm(end - start, axis=1) > 1e-9 * np.abs(strokes.points).max()
    start, end, triangle = start[long], end[long], triangle[long]
    way = normalize(end - start)
    flat = dot(way, ground.x[triangle]) + 1j * dot(way, ground.y[triangle])
    flat /= np.abs(flat)
    worst = np.zeros(len(start))
    for share in shares:
        point = start + share * (end - start)
        corner = ground.points[triangle]
        local = np.stack(
            [
                dot(point - corner[:, 0], ground.x[triangle]),
                dot(point - corner[:, 0], ground.y[triangle]),
            ],
            axis=1,
        )
        flat_corner = [
            np.stack(
                [dot(corner[:, k] - corner[:, 0], axis[triangle]) for axis in (ground.x, ground.y)],
                1,
            )
            for k in (1, 2)
        ]
        matrix = np.stack(flat_corner, axis=2)
        two = np.linalg.solve(matrix, local[..., None])[..., 0]
        weights = np.column_stack([1 - two.sum(axis=1), two])
        z = np.einsum("nk,nk->n", weights, ground.z[triangle])
        both = 1 if ground.degree % 2 == 0 else 2  # forward or backward along a member
        off = np.angle((z * (flat.conj() ** ground.degree)) ** both) / (both * ground.degree)
        worst = np.maximum(worst, np.degrees(np.abs(off)))
    return worst


def too_near(strokes, lines, least=0.5):
    """(k,) distances in spacings of points nearer to another stroke of their family than they may.

    Plain geometry: polylines cut finely, a tree, and the angle between tangents as it looks along
    the mean normal. A stroke is another to itself past three spacings of its length.
    """
    scipy = pytest.importorskip("scipy.spatial")
    place, way, normal, spacing, stroke, arc = map(
        np.concatenate, zip(*_cut_finely(strokes), strict=True)
    )
    one, two = scipy.cKDTree(place).query_pairs(least * spacing.max(), output_type="ndarray").T
    apart = np.abs(arc[one] - arc[two])
    total = strokes.length[stroke[one]]
    apart = np.where(strokes.closed[stroke[one]], np.minimum(apart, total - apart), apart)
    other = (stroke[one] != stroke[two]) | (apart > 3 * spacing[one])
    one, two = one[other], two[other]
    gap = place[two] - place[one]
    distance = np.linalg.norm(gap, axis=1)
    above = normalize(normal[one] + normal[two])
    near = distance < least * np.minimum(spacing[one], spacing[two])
    near &= dot(normal[one], normal[two]) > 0.3  # else an edge is between them, or a thin sheet
    near &= np.abs(dot(gap, above)) <= 0.5 * distance
    a, b = (normalize(w - dot(w, above)[:, None] * above) for w in (way[one], way[two]))
    near &= np.degrees(np.arccos(np.clip(np.abs(dot(a, b)), 0, 1))) < 90 / lines
    return (distance / spacing[one])[near]


def _cut_finely(strokes, share=0.05):
    """Of each stroke points, tangents, normals, spacings, its number and how far along they are."""
    for number, (a, b) in enumerate(pairwise(strokes.start)):
        points = strokes.points[a:b]
        piece = np.diff(points, axis=0)
        size = np.linalg.norm(piece, axis=1)
        arc = np.concatenate([[0], np.cumsum(size)])
        at = np.linspace(0, arc[-1], int(arc[-1] / (share * strokes.spacing[a:b].min())) + 2)
        before = np.clip(np.searchsorted(arc, at, side="right") - 1, 0, len(size) - 1)
        part = (at - arc[before]) / np.maximum(size[before], 1e-300)
        long = normalize(piece)[before]
        yield (
            points[before] + part[:, None] * piece[before],
            long,
            strokes.normal[a:b][before],
            strokes.spacing[a:b][before],
            np.full(len(at), number),
            at,
        )


def nearest_others(strokes):
    """By brute force, of strokes of one family: the least distance between points of different ones."""
    stroke, least = strokes.stroke, np.inf
    for first in range(0, len(stroke), 500):
        part = slice(first, first + 500)
        apart = np.linalg.norm(strokes.points[part, None] - strokes.points[None], axis=2)
        apart[stroke[part, None] == stroke[None]] = np.inf
        least = min(least, apart.min())
    return least


# --- where strokes run -----------------------------------------------------------------------------


@settings(max_examples=12, deadline=None)
@given(st.floats(0, np.pi), st.integers(1, 6), st.integers(1, 7))
def test_in_the_plane_strokes_are_straight_and_evenly_spaced(angle, degree, cells):
    instance = body_of(plane(cells, cells), degree, angle)
    drawn = trace_strokes(instance, 0.2)
    chord = drawn.points[drawn.start[1:] - 1] - drawn.points[drawn.start[:-1]]
    assert np.allclose(np.linalg.norm(chord, axis=1), drawn.length, rtol=1e-6)
    turn = np.angle(np.exp(1j * angle) / (chord[:, 0] + 1j * chord[:, 1]))
    lines = degree if degree % 2 else degree // 2
    off = (turn * lines / np.pi + 0.5) % 1 - 0.5
    assert np.abs(off).max() < 1e-4
    assert np.abs(drawn.points).max() <= 1 + 1e-9
    gaps = lateral_gaps(build_tangent_mesh(instance), drawn)
    assert gaps.evenness() > 0.9
    assert gaps.nearest_distance.min() > 0.5


@pytest.mark.parametrize("degree", [1, 2, 3, 4, 6])
def test_directions_are_those_of_the_field_everywhere(degree):
    surface = icosphere(3)
    instance = body_of(surface, degree, kind="smoothest")
    ground = build_tangent_mesh(instance)
    drawn = trace_strokes(instance, 0.1)
    assert degrees_off(ground, drawn).max() < 1.0


def test_on_a_torus_strokes_wind_at_the_angle_of_the_field():
    """In closed form: at an angle to the circles around the axis."""
    angle = np.radians(25)
    instance = body_of(torus(128, 64), 2, angle)
    drawn = trace_strokes(instance, 0.08)
    start, end, _ = straight_pieces(drawn)
    middle, way = (start + end) / 2, normalize(end - start)
    around = normalize(np.stack([-middle[:, 1], middle[:, 0], 0 * middle[:, 0]], axis=1))
    out = normalize(middle * (1, 1, 0))
    normal = normalize(middle - out)
    across = np.cross(normal, around)
    found = np.arctan2(dot(way, across), dot(way, around))
    off = np.degrees((found - angle + np.pi / 2) % np.pi - np.pi / 2)
    long = np.linalg.norm(end - start, axis=1) > 1e-3
    # The field is given on flat faces, 5 degrees wide: it is that of the round torus to second order.
    assert np.abs(off[long]).max() < 1.0


def test_pieces_lie_in_their_faces_and_strokes_cross_edges_without_a_gap():
    instance = body_of(icosphere(2), 4, kind="smoothest")
    ground, drawn = build_tangent_mesh(instance), trace_strokes(instance, 0.2)
    start, end, triangle = straight_pieces(drawn)
    for point in (start, end):
        above = dot(point - ground.points[triangle, 0], ground.normal[triangle])
        assert np.abs(above).max() < 1e-9
    assert np.allclose(drawn.points, ground.points_at(drawn.triangle, drawn.weights))
    assert (drawn.face == instance.surface.triangle_face[drawn.triangle]).all()


def test_strokes_look_like_the_render():
    """The pixels that strokes pass hold the field that they follow."""
    from rosy_addon.field.frames import tangent_frame, view_frame
    from rosy_addon.projection.project import project

    instance = body_of(icosphere(4), 4, kind="smoothest")
    camera = orbit_camera(instance.surface, 20, 30, 900, 900, perspective=False)
    buffer = project([instance], camera)
    shown = clip_to_visible(trace_strokes(instance, 0.1), [instance], camera)
    end = np.flatnonzero(np.diff(shown.stroke, prepend=-1) == 0)
    pixels, _ = project_to_pixels((shown.points[end] + shown.points[end - 1]) / 2, camera)
    column, row = np.floor(pixels.T).astype(int)
    place = np.searchsorted(buffer.pixel, row * camera.width + column).clip(
        0, len(buffer.pixel) - 1
    )
    same = buffer.pixel[place] == row * camera.width + column
    same &= buffer.triangle[place] == shown.triangle[end]
    normal = buffer.normal[place].astype(float)
    same &= normal[:, 2] > 0.4
    turn = camera.view[:3, :3]
    way = normalize(shown.points[end] - shown.points[end - 1]) @ turn.T
    flat = buffer.geometric_normal[place].astype(float)
    eye = buffer.view_direction[place].astype(float)
    way = transport(transport(way, flat, normal), normal, eye)
    x, y = view_frame(eye)
    angle = np.arctan2(dot(way, y), dot(way, x))
    z = buffer.representation[place]
    off = np.degrees(np.abs(np.angle(z * np.exp(-4j * angle)))) / 4
    sharp = np.abs(z) > 0.5  # elsewhere the field turns within a pixel
    assert (same & sharp).sum() > 1000
    assert np.percentile(off[same & sharp], 99) < 1.0
    assert tangent_frame is not None


def test_strokes_stop_at_creases_unless_asked():
    surface = read_cube()
    drawn = trace_strokes(MeshInstance(surface, STILL, axis_field(surface, 4, (1, 0.3, 0.2))), 0.1)
    assert all(
        len(np.unique(drawn.face[a:b])) == 1
        for a, b in zip(drawn.start, drawn.start[1:], strict=False)
    )
    over = trace_strokes(
        MeshInstance(surface, STILL, axis_field(surface, 4, (1, 0.3, 0.2))), 0.1, cross_creases=True
    )
    assert any(
        len(np.unique(over.face[a:b])) > 1 for a, b in zip(over.start, over.start[1:], strict=False)
    )


def read_cube():
    whole = cube()
    return build_surface(
        whole.vertices, whole.corner_vertex, whole.face_start, name="cube", sharp_angle=0.5
    )


def test_straight_ahead_is_a_geodesic():
    """Around a cylinder: as far up and around as in the plane that it is unrolled to."""
    surface = cylinder(64, 8)
    ground = build_tangent_mesh(body_of(surface, 2))
    count = 20
    triangle = np.full(count, 100, dtype=np.int32)
    weights = np.full((count, 3), 1 / 3)
    angle = np.linspace(0.1, 1.0, count)
    start = SurfaceParticles(triangle, weights, np.ones(count, complex), np.ones(count))
    here = ground.points_at(triangle, weights)
    around = np.cross((0, 0, 1.0), ground.normal[triangle])
    way = np.cos(angle)[:, None] * around + np.sin(angle)[:, None] * np.array([0, 0, 1.0])
    flat = dot(way, ground.x[triangle]) + 1j * dot(way, ground.y[triangle])
    now, walked = trace_geodesics(ground, start, flat, np.full(count, 0.5))
    there = ground.points_at(now.triangle, now.weights)
    inside = walked > 0.5 - 1e-9
    assert inside.any()
    assert np.allclose((there - here)[inside, 2], 0.5 * np.sin(angle)[inside], atol=1e-9)


# --- how far apart ---------------------------------------------------------------------------------


@pytest.mark.parametrize("degree", [2, 4])
def test_spacing_on_a_torus(degree):
    surface = torus()
    instance = body_of(surface, degree, kind="axis" if degree == 2 else "smoothest")
    spacing = 0.02 * surface.extent
    gaps = lateral_gaps(build_tangent_mesh(instance), trace_strokes(instance, spacing))
    assert gaps.evenness() >= 0.9
    assert gaps.nearest_distance.min() >= 0.5


@pytest.mark.parametrize("degree", [2, 4, 6])
def test_none_is_too_near_around_singularities(degree):
    instance = body_of(icosphere(4), degree, kind="smoothest")
    drawn = trace_strokes(instance, 0.09)
    assert not len(too_near(drawn, degree // 2))


def singular_body(degree, sign, at, phase):
    """In the plane, with one singularity, of index sign / degree: z^(sign / degree)."""
    surface = plane(50, 50)
    middle = surface.vertices[surface.corner_vertex].reshape(-1, 4, 3).mean(axis=1)
    around = np.arctan2(middle[:, 1] - at[1], middle[:, 0] - at[0])
    angle = sign * around / degree + phase
    way = np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)
    return MeshInstance(surface, STILL, RosyField(degree, way))


def nearest_passes(strokes, at):
    """Where strokes pass a point: by how many spacings, and on which side of it (radians)."""
    found = []
    for points, _, _, spacing, _, _ in _cut_finely(strokes):
        off = points[:, :2] - at
        radius = np.linalg.norm(off, axis=1) / spacing
        least = int(np.argmin(radius))
        if 0 < least < len(radius) - 1:
            found.append((radius[least], np.arctan2(off[least, 1], off[least, 0])))
    return np.array(sorted(found)).reshape(-1, 2)


@pytest.mark.parametrize("degree", [2, 4, 6])
@pytest.mark.parametrize("sign", [1, -1])
@pytest.mark.parametrize("phase", [0.3, 1.1])
def test_around_singularities_strokes_are_alike_on_all_sides(degree, sign, phase):
    """In closed form: N - 1 or N + 1 sectors, turned by equal angles, each with a stroke as near."""
    instance = singular_body(degree, sign, (0.013, -0.007), phase)
    ground, drawn = build_tangent_mesh(instance), trace_strokes(instance, 0.08)
    triangle, weights, index = singularities(ground)
    assert np.allclose(index, sign / degree) and len(index) == 1
    at = ground.points_at(triangle, weights)[0, :2]
    assert np.linalg.norm(at - (0.013, -0.007)) < 0.02
    sectors = degree - sign
    radius, side = nearest_passes(drawn, at)[:sectors].T
    assert len(radius) == sectors
    assert radius.max() < 1.2 and radius.max() / radius.min() < 1.05
    turn = np.diff(np.sort(side), append=np.sort(side)[0] + 2 * np.pi)
    assert np.abs(np.degrees(turn) - 360 / sectors).max() < 8
    gaps = lateral_gaps(ground, drawn)
    near = np.linalg.norm(drawn.points[gaps.point, :2] - at, axis=1) < 5 * 0.08
    gap = gaps.gap[near][gaps.has_room[near]]
    assert np.mean(np.abs(gap - 1) <= 0.25) > (0.6 if degree == 2 else 0.8)
    assert not len(too_near(drawn, degree // 2))


def test_singularities_are_found():
    """Their indices sum up to what Poincare and Hopf say.

    The surface has no symmetry, so that no zero lies on an edge.
    """
    surface = bumpy(icosphere(4))
    for degree in (1, 2, 3, 4, 6):
        ground = build_tangent_mesh(body_of(surface, degree, kind="smoothest"))
        assert np.isclose(singularities(ground)[2].sum(), 2)


def by_hand(lines, ways, spacing):
    """Strokes in a plane, of (S, n, 3) points and (S n, 3) directions."""
    count, size = len(lines), lines.shape[0] * lines.shape[1]
    return Strokes(
        points=lines.reshape(-1, 3),
        start=np.arange(count + 1) * lines.shape[1],
        family=np.zeros(count, dtype=np.int32),
        names=("family 1",),
        face=np.zeros(size, dtype=np.int32),
        triangle=np.zeros(size, dtype=np.int32),
        weights=np.full((size, 3), 1 / 3),
        normal=np.tile((0, 0, 1.0), (size, 1)),
        member=ways,
        spacing=np.full(size, spacing),
        width=np.ones(size),
        opacity=np.ones(size),
        closed=np.zeros(count, dtype=bool),
    )


def test_what_is_too_near_is_cut_back():
    """Concentric arcs put by hand, 0.3 and 0.8 spacings apart: the shorter of the first two goes."""
    instance = body_of(plane(), 2)
    ground, spacing = build_tangent_mesh(instance), 0.2
    turn = np.linspace(0.2, 3.0, 200)
    radius = spacing * np.array([1.0, 1.3, 2.1])
    arcs = np.stack([np.cos(turn), np.sin(turn), 0 * turn], axis=1)
    ways = np.stack([-np.sin(turn), np.cos(turn), 0 * turn], axis=1)
    lines = by_hand(radius[:, None, None] * arcs, np.tile(ways, (3, 1)), spacing)
    assert len(too_near(lines, 1))
    left = enforce_separation(ground, lines, 0.5)
    assert not len(too_near(left, 1))
    assert np.allclose(np.unique(np.linalg.norm(left.points, axis=1).round(9)), radius[1:])


def test_circles_of_latitude_close():
    surface = icosphere(4)
    instance = MeshInstance(surface, STILL, axis_field(surface, 4, (0, 0, 1)))
    ground, drawn = build_tangent_mesh(instance), trace_strokes(instance, 0.1)
    assert drawn.closed.sum() >= 20
    first, last = drawn.start[:-1][drawn.closed], drawn.start[1:][drawn.closed] - 1
    assert np.linalg.norm(drawn.points[first] - drawn.points[last], axis=1).max() < 1e-3 * 0.1 * 2
    # All the way around, at one height; or over both poles.
    for a, b in zip(first, last, strict=True):
        loop = drawn.points[a : b + 1]
        if np.ptp(loop[:, 2]) > 1.99:
            continue
        turn = np.unwrap(np.arctan2(loop[:, 1], loop[:, 0]))
        assert np.isclose(abs(turn[-1] - turn[0]), 2 * np.pi, atol=0.05)
        assert np.ptp(loop[:, 2]) < 0.03
    assert degrees_off(ground, drawn).max() < 1.0
    assert not len(too_near(drawn, 2))


@pytest.mark.slow
@pytest.mark.long
@pytest.mark.parametrize("degree", [2, 4, 6])
def test_spacing_on_the_bunny(shared_data, degree):
    surface = read_mesh(shared_data / "meshes" / "stanford-bunny.obj")
    instance = body_of(surface, degree, kind="smoothest")
    ground, drawn = build_tangent_mesh(instance), trace_strokes(instance, 0.012 * surface.extent)
    gaps = lateral_gaps(ground, drawn)
    assert gaps.evenness() >= 0.9
    assert not len(too_near(drawn, degree // 2))
    assert degrees_off(ground, drawn).max() < 1.0


def test_the_measure_knows_how_far_lines_are_apart():
    """Lines put by hand: 1.0, 1.2 and 1.6 spacings apart, in a plane."""
    instance = body_of(plane(), 2)
    ground = build_tangent_mesh(instance)
    drawn = trace_strokes(instance, 0.1)
    y = np.array([-0.4, -0.3, -0.18, -0.02])
    x = np.linspace(-0.9, 0.9, 181)
    points = np.stack([np.tile(x, 4), np.repeat(y, 181), np.zeros(4 * 181)], axis=1)
    lines = Strokes(
        points=points,
        start=np.arange(5) * 181,
        family=np.zeros(4, dtype=np.int32),
        names=drawn.names,
        face=np.zeros(724, dtype=np.int32),
        triangle=np.zeros(724, dtype=np.int32),
        weights=np.full((724, 3), 1 / 3),
        normal=np.tile((0, 0, 1.0), (724, 1)),
        member=np.tile((1.0, 0, 0), (724, 1)),
        spacing=np.full(724, 0.1),
        width=np.ones(724),
        opacity=np.ones(724),
        closed=np.zeros(4, dtype=bool),
    )
    gaps = lateral_gaps(ground, lines)
    middle = np.abs(points[gaps.point % 724, 0]) < 0.5
    line = gaps.point // 181
    for number, (left, right) in enumerate([(1.0, np.inf), (1.2, 1.0), (1.6, 1.2), (np.inf, 1.6)]):
        own = gaps.gap[(line == number) & middle]
        assert np.allclose(own[:, 0], left, atol=1e-6) or np.isinf(left)
        assert np.allclose(own[:, 1], right, atol=1e-6) or np.isinf(right)


def test_none_is_too_near_by_brute_force():
    instance = body_of(plane(), 2, 0.3)
    assert nearest_others(trace_strokes(instance, 0.15)) >= 0.5 * 0.15


def test_thin_sheets_do_not_interfere():
    """Two planes a hundredth of the spacing apart, facing away from each other."""
    one = plane()
    count = len(one.vertices)
    below = one.vertices - (0, 0, 0.001)
    quads = one.corner_vertex.reshape(-1, 4)
    both = np.concatenate([quads, quads[:, ::-1] + count])
    surface = build_surface(
        np.concatenate([one.vertices, below]), both.ravel(), np.arange(0, both.size + 1, 4)
    )
    instance = MeshInstance(surface, STILL, axis_field(surface, 2, (1, 0, 0)))
    drawn = trace_strokes(instance, 0.1)
    top = drawn.normal[drawn.start[:-1], 2] > 0
    assert 18 <= top.sum() <= 22 and 18 <= (~top).sum() <= 22


def test_same_strokes_again():
    one, two = (trace_strokes(body_of(icosphere(3), 4, kind="smoothest"), 0.1) for _ in range(2))
    assert np.array_equal(one.points, two.points) and np.array_equal(one.family, two.family)


# --- density ---------------------------------------------------------------------------------------


def test_darker_is_denser():
    surface = plane(20, 20)
    dark = surface.vertices[:, 0] < 0
    spacing = spacing_by_tone(0.05, np.where(dark, 0.0, 0.6))
    assert np.allclose(np.unique(spacing), (0.05, 0.125))
    drawn = trace_strokes(MeshInstance(surface, STILL, axis_field(surface, 2, (0, 1, 0))), spacing)
    x = drawn.points[drawn.start[:-1], 0]
    per_length = [drawn.length[side].sum() for side in (x < -0.1, x > 0.1)]
    assert 1.9 < per_length[0] / per_length[1] < 3.2


def test_a_ramp_of_tone_comes_out_as_a_ramp():
    """Ink is the length of strokes on an area, times the width that makes black of the narrowest."""
    surface = plane(40, 40)
    narrow = 0.025
    tone = 0.85 * (surface.vertices[:, 0] + 1) / 2
    spacing = spacing_by_tone(narrow, tone, max_ratio=1 / 0.15)
    drawn = trace_strokes(MeshInstance(surface, STILL, axis_field(surface, 2, (0, 1, 0))), spacing)
    start, end, _ = straight_pieces(drawn)
    length = np.linalg.norm(end - start, axis=1)
    edges = np.linspace(-1, 1, 6)
    ink, _ = np.histogram((start + end)[:, 0] / 2, edges, weights=length * narrow)
    ink /= 2 * np.diff(edges)
    wanted = 1 - 0.85 * ((edges[1:] + edges[:-1]) / 2 + 1) / 2
    assert (np.diff(ink) < 0).all()
    assert np.abs(ink - wanted).max() < 0.1


def test_where_it_bends_more_strokes_are_nearer():
    """On a long ball: the length of strokes on an area is one over the spacing asked for there."""
    ball = icosphere(4)
    surface = build_surface(
        ball.vertices * (1, 1, 3), ball.corner_vertex, ball.face_start, name="long ball"
    )
    spacing = spacing_by_curvature(surface, 0.06, 1.0)
    assert np.ptp(spacing) > 0.01
    instance = MeshInstance(surface, STILL, axis_field(surface, 2, (0, 0, 1)))
    ground, drawn = build_tangent_mesh(instance), trace_strokes(instance, spacing)
    corner = spacing[surface.triangle_vertex].mean(axis=1)
    start, end, triangle = straight_pieces(drawn)
    length = np.bincount(triangle, np.linalg.norm(end - start, axis=1), len(corner))
    near = corner < np.median(corner)
    for part in (near, ~near):
        asked = (ground.area[part] / corner[part]).sum()
        assert 0.8 < length[part].sum() / asked < 1.2


def test_curvature_and_light():
    surface = torus()
    spacing = spacing_by_curvature(surface, 1.0, 0.5)
    assert spacing.shape == (len(surface.vertices),) and np.ptp(spacing) > 0
    camera = orbit_camera(surface, 0, 90, 100, 100, perspective=False)
    tone = headlight_tone(MeshInstance(surface, STILL), camera)
    assert np.isclose(tone.max(), 1, atol=1e-3) and tone[surface.vertices[:, 2] < -0.3].max() == 0


def test_families_by_tone():
    instance = body_of(plane(10, 10), 4)
    drawn = trace_strokes(instance, 0.1)
    tone = values_at_points(drawn, instance.surface, (instance.surface.vertices[:, 0] + 1) / 2)
    weighed = weight_by_tone(drawn, tone, 0.4)
    for family, begins in ((0, 1.0), (1, 0.6)):
        own = weighed.select(weighed.family == family)
        x = own.points[:, 0]
        assert len(own) and x.max() < 2 * begins - 1
        # Three times as wide as the darkness, up to the whole of the pen.
        wanted = np.clip(3 * (begins - (x + 1) / 2), 0, 1)
        np.testing.assert_allclose(own.width, wanted, atol=1e-6)


@pytest.mark.parametrize("slant", [0.0, 0.8, 1.2])
def test_slanted_surfaces_are_as_dense_in_the_picture(slant):
    """Of lines of all directions, in length over area."""
    floor = plane(20, 20)
    camera = orthographic_camera(
        look_at((0, -5 * np.sin(slant), 5 * np.cos(slant)), (0, 0, 0), (0, 1, 0)), 400, 400, scale=2
    )
    turned = []
    for angle in np.linspace(0, np.pi / 2, 5)[:-1]:
        instance = MeshInstance(
            floor, STILL, axis_field(floor, 4, (np.cos(angle), np.sin(angle), 0))
        )
        spacing = spacing_by_foreshortening(instance, camera, pixel_spacing(instance, camera, 6.0))
        drawn = trace_strokes(instance, spacing)
        pixels, _ = project_to_pixels(drawn.points, camera)
        piece = np.linalg.norm(np.diff(pixels, axis=0), axis=1)
        same = np.diff(drawn.stroke) == 0
        turned.append(piece[same].sum())
    area = 400 * 400 * np.cos(slant)
    # Of two families, six pixels apart.
    assert np.mean(turned) / area == pytest.approx(2 / 6, rel=0.12)


# --- families --------------------------------------------------------------------------------------


def test_families_are_the_same_all_over_a_torus():
    instance = body_of(torus(48, 24), 4)
    assert global_labels(build_tangent_mesh(instance)) is not None
    drawn = trace_strokes(instance, 0.15)
    assert drawn.names == ("family 1", "family 2")
    middle = (drawn.start[:-1] + drawn.start[1:]) // 2
    place = drawn.points[middle]
    around = normalize(np.stack([-place[:, 1], place[:, 0], 0 * place[:, 0]], axis=1))
    along = np.abs(dot(drawn.member[middle], around)) > 0.7
    assert len(np.unique(along[drawn.family == 0])) == 1
    assert len(np.unique(along[drawn.family == 1])) == 1


def test_around_singularities_families_run_into_each_other():
    instance = body_of(icosphere(3), 4, kind="smoothest")
    assert global_labels(build_tangent_mesh(instance)) is None
    assert set(trace_strokes(instance, 0.2).family.tolist()) == {0, 1}


# --- what is done with them --------------------------------------------------------------------------


def test_taper_and_closed_strokes():
    drawn = trace_strokes(body_of(plane(), 2), 0.1).tapered(2.0, 0.2)
    assert np.allclose(drawn.width[drawn.start[:-1]], 0.2)
    assert drawn.width.max() == 1.0 and (drawn.width >= 0.2 - 1e-9).all()


def test_ends_that_meet_head_on_are_not_thinned():
    """Of two strokes nearly in line, half a spacing apart, one beside them, and one across."""
    along = np.linspace(0, 1, 11)[:, None] * np.array([1.0, 0, 0])
    spacing, off = 0.1, (0, 0.05, 0)
    lines = [
        along,
        along + (1.05, 0, 0) + off,
        along + (0, 0.1, 0),
        along[:, [1, 0, 2]] + (1.02, 0, 0),
    ]
    ways = np.repeat([[1.0, 0, 0], [1.0, 0, 0], [1.0, 0, 0], [0, 1.0, 0]], 11, axis=0)
    strokes = by_hand(np.array(lines), ways, spacing)
    # The third one's last end is beside that of the first, and meets the second one as well.
    assert head_on_ends(strokes).tolist() == [
        [False, True],
        [True, False],
        [False, True],
        [False, False],
    ]
    thin = strokes.tapered(2.0, 0.2, ~head_on_ends(strokes))
    ends = np.stack([thin.width[thin.start[:-1]], thin.width[thin.start[1:] - 1]], axis=1)
    assert np.allclose(ends, [[0.2, 1], [1, 0.2], [0.2, 1], [0.2, 0.2]])


def test_gaps_at_crossings():
    instance = body_of(plane(3, 3), 4)
    drawn = trace_strokes(instance, 0.2)
    met = find_crossings(drawn)
    first = (drawn.family == 0).sum() * (drawn.family == 1).sum()
    assert 0.8 * first <= len(met.stroke) <= first
    gapped = with_crossing_gaps(drawn, 0.3)
    assert not len(find_crossings(gapped).stroke)
    lost = drawn.length.sum() - gapped.length.sum()
    assert np.isclose(lost, len(met.stroke) * 0.3 * 0.2, rtol=0.1)
    over = gapped.select(gapped.family == 0)
    assert np.isclose(over.length.sum(), drawn.length[drawn.family == 0].sum())
    assert not len(find_crossings(with_crossing_gaps(drawn, 0.3, weave=True)).stroke)


@settings(max_examples=30, deadline=None)
@given(st.floats(0.01, 1.9), st.floats(0.01, 0.5))
def test_cuts_take_out_what_they_say(low, size):
    drawn = trace_strokes(body_of(plane(3, 3), 2), 0.2)
    left = cut_intervals(drawn, np.array([0]), np.array([low]), np.array([low + size]))
    total = drawn.length[0]
    assume(low + size < total - 1e-6 or low + size > total + 1e-6)
    taken = min(low + size, total) - min(low, total)
    assert np.isclose(drawn.length.sum() - left.length.sum(), taken, atol=1e-9)


# --- what a camera sees ------------------------------------------------------------------------------


def test_a_sphere_shows_its_near_side():
    instance = body_of(icosphere(4), 2, kind="smoothest")
    camera = orthographic_camera(look_at((0, -5, 0), (0, 0, 0)), 400, 400, scale=2.5)
    drawn = trace_strokes(instance, 0.1)
    shown = clip_to_visible(drawn, [instance], camera)
    assert shown.points[:, 1].max() < 0.06
    near = drawn.points[:, 1] < 0
    assert shown.length.sum() > 0.9 * drawn.length.sum() * near.mean()
    every = clip_to_visible(drawn, [instance], camera, remove_hidden=False)
    assert np.isclose(every.length.sum(), drawn.length.sum())


def test_others_hide_and_the_frame_cuts():
    instance = body_of(plane(), 2)
    camera = orthographic_camera(look_at((0, 0, 5), (0, 0, 0), (0, 1, 0)), 200, 200, scale=1.0)
    drawn = trace_strokes(instance, 0.05)
    shown = clip_to_visible(drawn, [instance], camera)
    assert np.abs(shown.points[:, :2]).max() <= 0.5 + 1e-9
    wall = plane()
    moved = np.eye(4)
    moved[:3, 3] = (1.0, 0, 1.0)
    left = clip_to_visible(drawn, [instance, MeshInstance(wall, moved)], camera)
    assert left.points[:, 0].max() < 0.02
    assert len(left) >= 15


def test_outlines_of_simple_bodies():
    sphere = MeshInstance(icosphere(4), STILL)
    camera = orthographic_camera(look_at((0, -5, 0), (0, 0, 0)), 400, 400, scale=2.5)
    lines = outline(sphere, camera)
    assert len(lines) == 1 and lines.closed[0] and lines.names[lines.family[0]] == "silhouettes"
    assert np.abs(lines.points[:, 1]).max() < 0.01
    assert np.isclose(lines.length[0], 2 * np.pi, rtol=0.01)
    box = outline(MeshInstance(read_cube(), STILL))
    assert np.isclose(box.length.sum(), 12) and set(box.family.tolist()) == {1}
    edge = outline(MeshInstance(plane(), STILL))
    assert np.isclose(edge.length.sum(), 8) and set(edge.family.tolist()) == {2}


# --- files -------------------------------------------------------------------------------------------


def svg_camera():
    return orthographic_camera(look_at((0, 0, 5), (0, 0, 0), (0, 1, 0)), 200, 100, scale=4.0)


def svg_of(**more):
    instance = body_of(plane(), 4)
    drawn = clip_to_visible(trace_strokes(instance, 0.2).tapered(1.0), [instance], svg_camera())
    return ElementTree.fromstring(svg_text(drawn, svg_camera(), Pen(**more))), drawn


def test_svg_has_a_layer_a_family_and_a_path_a_stroke():
    root, drawn = svg_of(millimetres=100, colours=("red", "#00f"))
    space = "{http://www.inkscape.org/namespaces/inkscape}"
    layers = root.findall("{http://www.w3.org/2000/svg}g")
    assert [layer.get(space + "label") for layer in layers] == ["paper", "family 1", "family 2"]
    assert all(layer.get(space + "groupmode") == "layer" for layer in layers)
    assert [layer.get("stroke") for layer in layers[1:]] == ["red", "#00f"]
    assert (root.get("width"), root.get("height")) == ("100mm", "50mm")
    assert root.get("viewBox") == "0 0 200 100"
    paths = list(root.iter("{http://www.w3.org/2000/svg}path"))
    assert len(paths) == len(drawn)
    for path in paths:
        assert path.get("d").endswith("Z") == (path.get("stroke") == "none")
        # An outline goes around the points of its stroke, half the width of the pen away.
        without_arcs = re.sub(r"A\S+ 0 0 1", "", path.get("d"))
        pairs = re.findall(r"(-?[\d.]+),(-?[\d.]+)", without_arcs)
        points = np.array(pairs, dtype=float)
        assert len(points) >= 2
        assert (points >= -0.51).all() and (points <= (200.51, 100.51)).all()


@pytest.mark.parametrize("plotter", [False, True])
def test_closed_strokes_are_closed_paths(plotter):
    instance = MeshInstance(icosphere(4), STILL, axis_field(icosphere(4), 4, (0, 0, 1)))
    camera = orthographic_camera(look_at((0, 0, 5), (0, 0, 0), (0, 1, 0)), 300, 200, scale=3.3)
    drawn = clip_to_visible(trace_strokes(instance, 0.15), [instance], camera)
    assert drawn.closed.any() and not drawn.closed.all()

    def paths(strokes):
        text = svg_text(strokes, camera, Pen(plotter=plotter))
        return [path.get("d") for path in ElementTree.fromstring(text).iter() if path.get("d")]

    for closed in (True, False):
        own = drawn.select(drawn.closed == closed)
        assert all(path.endswith("Z") == closed for path in paths(own))
        for path in paths(own):
            points = np.array(re.findall(r"(-?[\d.]+),(-?[\d.]+)", path), dtype=float)
            assert not (points[0] == points[-1]).all()
    # What is cut is open.
    half = drawn.runs_where(drawn.points[:, 0] > 0)
    assert not any(path.endswith("Z") for path in paths(half))


def test_outlines_hold_as_much_ink_as_their_strokes():
    """In closed form: the mean width times the length; the round ends are left out."""
    root, drawn = svg_of(width=3.0, paper=None)
    pixels, _ = project_to_pixels(drawn.points, svg_camera())
    step = np.hypot(*np.diff(pixels, axis=0).T) * (np.diff(drawn.stroke) == 0)
    mean = (drawn.width[1:] + drawn.width[:-1]) / 2
    ink = np.bincount(drawn.stroke[1:], 3.0 * mean * step)
    areas = []
    for path in root.iter("{http://www.w3.org/2000/svg}path"):
        pairs = re.findall(r"(-?[\d.]+),(-?[\d.]+)", re.sub(r"A\S+ 0 0 1", "", path.get("d")))
        x, y = np.array(pairs, dtype=float).T
        areas.append(abs(x @ np.roll(y, 1) - y @ np.roll(x, 1)) / 2)
    by_family = np.argsort(drawn.family, kind="stable")
    assert np.allclose(areas, ink[by_family], rtol=0.03, atol=0.2)


def test_plotters_get_whole_lines_in_a_short_order():
    root, drawn = svg_of(plotter=True, paper=None)
    paths = list(root.iter("{http://www.w3.org/2000/svg}path"))
    assert len(paths) == len(drawn)
    assert all(path.get("stroke-width") is None for path in paths)


@settings(max_examples=30, deadline=None)
@given(st.integers(1, 60), st.integers(0, 10**6))
def test_pen_order_is_a_short_permutation(count, seed):
    random = np.random.default_rng(seed)
    first, last = random.random((2, count, 2))
    order, turned = plotter_order(first, last)
    assert sorted(order.tolist()) == list(range(count))
    begin = np.where(turned[:, None], last[order], first[order])
    end = np.where(turned[:, None], first[order], last[order])
    travel = np.linalg.norm(begin[1:] - end[:-1], axis=1).sum()
    plain = np.linalg.norm(first[1:] - last[:-1], axis=1).sum()
    assert travel <= plain + 1e-9 or count < 6


@settings(max_examples=40, deadline=None)
@given(st.lists(st.integers(2, 40), min_size=1, max_size=4), st.integers(0, 10**6))
def test_simplified_lines_stay_near(sizes, seed):
    random = np.random.default_rng(seed)
    start = np.concatenate([[0], np.cumsum(sizes)])
    points = np.cumsum(random.normal(size=(start[-1], 2)), axis=0)
    kept = simplify_mask(points, start, 0.5)
    assert kept[start[:-1]].all() and kept[start[1:] - 1].all()
    for a, b in pairwise(start):
        left = points[a:b][kept[a:b]]
        for point in points[a:b]:
            along = left[1:] - left[:-1]
            off = point - left[:-1]
            square = np.maximum((along**2).sum(axis=1), 1e-300)
            share = np.clip((off * along).sum(axis=1) / square, 0, 1)
            assert np.linalg.norm(off - share[:, None] * along, axis=1).min() <= 0.5 + 1e-9


def write_ball(path):
    surface = icosphere(3)
    lines = [f"v {x} {y} {z}" for x, y, z in surface.vertices]
    lines += [
        "f " + " ".join(str(v + 1) for v in face) for face in surface.corner_vertex.reshape(-1, 3)
    ]
    path.write_text("\n".join(lines) + "\n")


def test_command_line(tmp_path, capsys, monkeypatch):
    mesh, out = tmp_path / "ball.obj", tmp_path / "ball.svg"
    write_ball(mesh)
    command = [
        "strokes",
        str(mesh),
        "--generate",
        "smoothest",
        "--spacing",
        "12",
        "--size",
        "300x200",
    ]
    assert main([*command, "-o", str(out), "--outline", "--gaps", "0.3", "--tone"]) == 0
    root = ElementTree.parse(out).getroot()
    assert len(root.findall("{http://www.w3.org/2000/svg}g")) == 4
    once = out.read_bytes()
    assert main([*command, "-o", str(out), "--outline", "--gaps", "0.3", "--tone"]) == 0
    assert out.read_bytes() == once
    assert main([*command, "-o", str(tmp_path / "ball.png")]) == 2
    assert "ball.png" in capsys.readouterr().err
    for words, wanted in (
        (["--camera", "Close"], "ball.obj: --camera applies only to .blend files"),
        (["--frames", "1-3"], "ball.obj: --frames applies only to .blend files"),
        (["--tone", "--light", "scene"], "ball.obj: has no lights"),
    ):
        assert main([*command, "-o", str(out), *words]) == 2
        assert wanted in capsys.readouterr().err
    assert main(["strokes", "-o", str(out)]) == 2
    assert "give a mesh file" in capsys.readouterr().err
    monkeypatch.setitem(sys.modules, "bpy", None)
    assert main(["strokes", "scene.blend", "-o", str(out)]) == 2
    assert "needs Blender" in capsys.readouterr().err


# --- what is wrong is said ---------------------------------------------------------------------------


def test_wrong_input_is_one_line(error_of):
    surface = plane()
    instance = body_of(surface, 4)
    assert "above 0" in error_of(trace_strokes, instance, 0.0)
    assert "too many" in error_of(trace_strokes, instance, 1e-6)
    assert "no field" in error_of(trace_strokes, MeshInstance(surface, STILL), 0.1)
    assert "zero everywhere" in error_of(
        trace_strokes, MeshInstance(surface, STILL, RosyField(4, np.zeros((16, 3)))), 0.1
    )
    assert "per vertex" in error_of(trace_strokes, instance, np.ones(7))
    assert "min_separation" in error_of(SeparationRules, min_separation=1.2)
    assert "min_length" in error_of(SeparationRules, min_length=5.0, max_length=3.0)
