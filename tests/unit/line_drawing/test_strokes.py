"""Strokes: directions, spacing, families, visibility, and SVG files."""

from __future__ import annotations

import re
import sys
import xml.etree.ElementTree as ElementTree
from dataclasses import replace
from itertools import pairwise, product

import numpy as np
import pytest
from conftest import long, mainly
from field_helpers import bumpy
from harness.stroke_spacing import lateral_gaps
from harness.stroke_tracing import trace_strokes, visible_strokes
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from shapes import cylinder, icosphere, instance_of, plane, sharp_cube, torus

from rosy_addon.cli.parser import main
from rosy_addon.core.errors import RosyError
from rosy_addon.field.frames import dot, normalize, transport, view_frame
from rosy_addon.field.generate import axis_field
from rosy_addon.field.representation import face_frames
from rosy_addon.field.rosy_field import RosyField
from rosy_addon.field.surface import build_surface
from rosy_addon.line_drawing.crossings import cut_intervals, find_crossings, with_crossing_gaps
from rosy_addon.line_drawing.families import global_labels
from rosy_addon.line_drawing.outline import outline_strokes
from rosy_addon.line_drawing.seeding import singularities
from rosy_addon.line_drawing.separation import enforce_separation
from rosy_addon.line_drawing.spacing import (
    spacing_by_curvature,
    spacing_by_tone,
    spacing_in_picture,
    values_at_points,
    weight_by_tone,
)
from rosy_addon.line_drawing.stroke_ends import head_on_ends
from rosy_addon.line_drawing.stroke_set import Strokes
from rosy_addon.line_drawing.surface_particles import SurfaceParticles, trace_geodesics
from rosy_addon.line_drawing.svg import Pen, plotter_order, simplify_mask, svg_text
from rosy_addon.line_drawing.tangent_mesh import build_tangent_mesh
from rosy_addon.line_drawing.visibility import clip_to_visible, project_to_pixels
from rosy_addon.projection.camera import look_at, orbit_camera, orthographic_camera
from rosy_addon.projection.gbuffer import MeshInstance
from rosy_addon.projection.project import project

IDENTITY = np.eye(4)


def turned(surface, degree, angle=0.0):
    """Return an instance with a field at an angle to the first edges of its faces."""
    x, y = face_frames(surface)
    return MeshInstance(surface, IDENTITY, RosyField(degree, np.cos(angle) * x + np.sin(angle) * y))


def segments_of(strokes):
    """Return the starts and ends of all segments, and their triangles."""
    end = np.flatnonzero(np.diff(strokes.stroke, prepend=-1) == 0)
    return strokes.points[end - 1], strokes.points[end], strokes.triangle[end]


def direction_errors(mesh, strokes, fractions=(0.0, 0.5, 1.0)):
    """Return the angles in degrees between segments and the nearest member at points along them."""
    start, end, triangle = segments_of(strokes)
    is_long = np.linalg.norm(end - start, axis=1) > 1e-9 * np.abs(strokes.points).max()
    start, end, triangle = start[is_long], end[is_long], triangle[is_long]
    direction = normalize(end - start)
    tangent = dot(direction, mesh.x[triangle]) + 1j * dot(direction, mesh.y[triangle])
    tangent /= np.abs(tangent)
    corner = mesh.points[triangle]
    edges = [planar(mesh, triangle, corner[:, k] - corner[:, 0]) for k in (1, 2)]
    matrix = np.stack(edges, axis=2)
    max_error = np.zeros(len(start))
    for fraction in fractions:
        point = planar(mesh, triangle, start + fraction * (end - start) - corner[:, 0])
        last_weights = np.linalg.solve(matrix, point[..., None])[..., 0]
        weights = np.column_stack([1 - last_weights.sum(axis=1), last_weights])
        z = np.einsum("nk,nk->n", weights, mesh.z[triangle])
        # Segments run forward or backward along a member.
        power = 1 if mesh.degree % 2 == 0 else 2
        error = np.angle((z * (tangent.conj() ** mesh.degree)) ** power) / (power * mesh.degree)
        max_error = np.maximum(max_error, np.degrees(np.abs(error)))
    return max_error


def planar(mesh, triangle, vectors):
    """Return the (n, 2) components of (n, 3) vectors in the frames of triangles."""
    return np.stack([dot(vectors, axis[triangle]) for axis in (mesh.x, mesh.y)], axis=1)


# --- directions ------------------------------------------------------------------------------------


@pytest.mark.slow
@settings(max_examples=12, deadline=None)
@given(st.floats(0, np.pi), st.integers(1, 6), st.integers(1, 7))
def test_in_the_plane_strokes_are_straight_and_evenly_spaced(angle, degree, cells):
    instance = turned(plane(cells, cells), degree, angle)
    strokes = trace_strokes(instance, 0.2)
    chord = strokes.points[strokes.start[1:] - 1] - strokes.points[strokes.start[:-1]]
    assert np.allclose(np.linalg.norm(chord, axis=1), strokes.length, rtol=1e-6)
    chord_angle = np.angle(np.exp(1j * angle) / (chord[:, 0] + 1j * chord[:, 1]))
    line_count = degree if degree % 2 else degree // 2
    error = (chord_angle * line_count / np.pi + 0.5) % 1 - 0.5
    assert np.abs(error).max() < 1e-4
    assert np.abs(strokes.points).max() <= 1 + 1e-9
    gaps = lateral_gaps(build_tangent_mesh(instance), strokes)
    assert gaps.evenness() > 0.9
    assert gaps.nearest_distance.min() > 0.5


@pytest.mark.slow
@pytest.mark.parametrize("degree", [3, *long(1, 2, 4, 6)])
def test_directions_are_those_of_the_field_everywhere(degree):
    surface = icosphere(3)
    instance = instance_of(surface, degree)
    mesh = build_tangent_mesh(instance)
    strokes = trace_strokes(instance, 0.1)
    assert direction_errors(mesh, strokes).max() < 1.0


@pytest.mark.slow
def test_segments_lie_in_their_faces_and_strokes_cross_edges_without_a_gap():
    instance = instance_of(icosphere(2), 4)
    mesh, strokes = build_tangent_mesh(instance), trace_strokes(instance, 0.2)
    start, end, triangle = segments_of(strokes)
    for point in (start, end):
        height = dot(point - mesh.points[triangle, 0], mesh.normal[triangle])
        assert np.abs(height).max() < 1e-9
    assert np.allclose(strokes.points, mesh.points_at(strokes.triangle, strokes.weights))
    assert (strokes.face == instance.surface.triangle_face[strokes.triangle]).all()


@pytest.mark.slow
def test_strokes_look_like_the_render():
    """Strokes have the direction of the field in the G-buffer at the pixels that they cross."""
    instance = instance_of(icosphere(4), 4)
    camera = orbit_camera(instance.surface.vertices, 20, 30, 900, 900, perspective=False)
    gbuffer = project([instance], camera)
    visible = visible_strokes(trace_strokes(instance, 0.1), [instance], camera)
    end = np.flatnonzero(np.diff(visible.stroke, prepend=-1) == 0)
    pixels, _ = project_to_pixels((visible.points[end] + visible.points[end - 1]) / 2, camera)
    column, row = np.floor(pixels.T).astype(int)
    pixel = row * camera.width + column
    index = np.searchsorted(gbuffer.pixel, pixel).clip(0, len(gbuffer.pixel) - 1)
    compared = gbuffer.pixel[index] == pixel
    compared &= gbuffer.triangle[index] == visible.triangle[end]
    normal = gbuffer.normal[index].astype(float)
    compared &= normal[:, 2] > 0.4
    rotation = camera.view[:3, :3]
    direction = normalize(visible.points[end] - visible.points[end - 1]) @ rotation.T
    geometric_normal = gbuffer.geometric_normal[index].astype(float)
    view_direction = gbuffer.view_direction[index].astype(float)
    direction = transport(direction, geometric_normal, normal)
    direction = transport(direction, normal, view_direction)
    x, y = view_frame(view_direction)
    angle = np.arctan2(dot(direction, y), dot(direction, x))
    z = gbuffer.representation[index]
    error = np.degrees(np.abs(np.angle(z * np.exp(-4j * angle)))) / 4
    # Where z is smaller, the field turns within a pixel.
    compared &= np.abs(z) > 0.5
    assert compared.sum() > 1000
    assert np.percentile(error[compared], 99) < 1.0


@pytest.mark.slow
def test_strokes_stop_at_creases_unless_asked():
    surface = sharp_cube()
    instance = MeshInstance(surface, IDENTITY, axis_field(surface, 4, (1, 0.3, 0.2)))

    def face_counts(strokes):
        return [len(np.unique(strokes.face[a:b])) for a, b in pairwise(strokes.start)]

    assert set(face_counts(trace_strokes(instance, 0.1))) == {1}
    assert max(face_counts(trace_strokes(instance, 0.1, cross_creases=True))) > 1


def test_straight_ahead_is_a_geodesic():
    """Geodesics on a cylinder are straight lines in the plane to which it is unrolled."""
    surface = cylinder(64, 8)
    mesh = build_tangent_mesh(turned(surface, 2))
    count = 20
    triangle = np.full(count, 100, dtype=np.int32)
    weights = np.full((count, 3), 1 / 3)
    angle = np.linspace(0.1, 1.0, count)
    particles = SurfaceParticles(triangle, weights, np.ones(count, complex), np.ones(count))
    start = mesh.points_at(triangle, weights)
    around = np.cross((0, 0, 1.0), mesh.normal[triangle])
    direction = np.cos(angle)[:, None] * around + np.sin(angle)[:, None] * np.array([0, 0, 1.0])
    tangent = dot(direction, mesh.x[triangle]) + 1j * dot(direction, mesh.y[triangle])
    arrived, _, walked = trace_geodesics(mesh, particles, tangent, np.full(count, 0.5))
    end = mesh.points_at(arrived.triangle, arrived.weights)
    inside = walked > 0.5 - 1e-9
    assert inside.any()
    assert np.allclose((end - start)[inside, 2], 0.5 * np.sin(angle)[inside], atol=1e-9)


# --- separation ------------------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize(
    ("surface", "degree", "kind"),
    [
        (torus(64, 32), 4, "smoothest"),
        (icosphere(4), 4, "smoothest"),
        *long((torus(64, 32), 2, "axis"), (icosphere(4), 2, "smoothest")),
        *long((icosphere(4), 6, "smoothest")),
    ],
)
def test_strokes_are_even_and_not_too_close(surface, degree, kind):
    """On the sphere, also around singularities."""
    instance = instance_of(surface, degree, kind)
    strokes = trace_strokes(instance, 0.03 * surface.extent)
    gaps = lateral_gaps(build_tangent_mesh(instance), strokes)
    assert gaps.nearest_distance.min() >= 0.5
    assert gaps.evenness() >= 0.9


def instance_with_singularity(degree, sign, center, phase):
    """Return a plane whose field has one singularity of index sign / degree."""
    surface = plane(50, 50)
    face_center = surface.vertices[surface.corner_vertex].reshape(-1, 4, 3).mean(axis=1)
    polar_angle = np.arctan2(face_center[:, 1] - center[1], face_center[:, 0] - center[0])
    angle = sign * polar_angle / degree + phase
    direction = np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)
    return MeshInstance(surface, IDENTITY, RosyField(degree, direction))


def closest_approaches(strokes, center):
    """Return (k, 2): how close strokes pass a point in spacings, and at which polar angle, sorted.

    Strokes whose closest point is one of their ends are left out.
    """
    fine, found = strokes.subdivided(np.full(len(strokes.points), 16)), []
    for first, last in pairwise(fine.start):
        offset = fine.points[first:last, :2] - center
        radius = np.linalg.norm(offset, axis=1) / fine.spacing[first:last]
        closest = int(np.argmin(radius))
        if 0 < closest < len(radius) - 1:
            found.append((radius[closest], np.arctan2(offset[closest, 1], offset[closest, 0])))
    return np.array(sorted(found)).reshape(-1, 2)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("degree", "sign", "phase"),
    mainly([(2, -1, 1.1), (4, 1, 0.3)], product([2, 4, 6], [1, -1], [0.3, 1.1])),
)
def test_around_singularities_strokes_are_alike_on_all_sides(degree, sign, phase):
    """There are N - 1 or N + 1 equal sectors. The closest stroke has the same distance in each."""
    center, spacing = (0.013, -0.007), 0.08
    instance = instance_with_singularity(degree, sign, center, phase)
    mesh, strokes = build_tangent_mesh(instance), trace_strokes(instance, spacing)
    triangle, weights, index = singularities(mesh)
    assert np.allclose(index, sign / degree) and len(index) == 1
    found_center = mesh.points_at(triangle, weights)[0, :2]
    assert np.linalg.norm(found_center - center) < 0.02
    sectors = degree - sign
    radius, polar_angle = closest_approaches(strokes, found_center)[:sectors].T
    assert len(radius) == sectors
    assert radius.max() < 1.2 and radius.max() / radius.min() < 1.05
    polar_angle = np.sort(polar_angle)
    sector_angle = np.diff(polar_angle, append=polar_angle[0] + 2 * np.pi)
    assert np.abs(np.degrees(sector_angle) - 360 / sectors).max() < 8
    gaps = lateral_gaps(mesh, strokes)
    distance = np.linalg.norm(strokes.points[gaps.point, :2] - found_center, axis=1)
    near = distance < 5 * spacing
    gap = gaps.gap[near][gaps.has_room[near]]
    assert np.mean(np.abs(gap - 1) <= 0.25) > (0.6 if degree == 2 else 0.8)
    assert gaps.nearest_distance.min() >= 0.5


def test_singularities_are_found():
    """The sum of the indices is the Euler characteristic (Poincare-Hopf theorem).

    The surface has no symmetry, so that no zero lies on an edge.
    """
    surface = bumpy(icosphere(4))
    for degree in (1, 2, 3, 4, 6):
        mesh = build_tangent_mesh(instance_of(surface, degree))
        assert np.isclose(singularities(mesh)[2].sum(), 2)


def planar_strokes(points, directions, spacing):
    """Return strokes in a plane from (S, n, 3) points and (S n, 3) directions."""
    stroke_count, point_count = len(points), points.shape[0] * points.shape[1]
    return Strokes(
        points=points.reshape(-1, 3),
        start=np.arange(stroke_count + 1) * points.shape[1],
        family=np.zeros(stroke_count, dtype=np.int32),
        names=("family 1",),
        face=np.zeros(point_count, dtype=np.int32),
        triangle=np.zeros(point_count, dtype=np.int32),
        weights=np.full((point_count, 3), 1 / 3),
        normal=np.tile((0, 0, 1.0), (point_count, 1)),
        member=directions,
        spacing=np.full(point_count, spacing),
        width=np.ones(point_count),
        closed=np.zeros(stroke_count, dtype=bool),
    )


def test_strokes_that_are_too_close_are_cut():
    """Of concentric arcs, 0.3 and 0.8 spacings apart, the shorter of the first two is removed."""
    spacing = 0.2
    mesh = build_tangent_mesh(turned(plane(), 2))
    angle = np.linspace(0.2, 3.0, 200)
    radius = spacing * np.array([1.0, 1.3, 2.1])
    arc = np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)
    directions = np.stack([-np.sin(angle), np.cos(angle), 0 * angle], axis=1)
    strokes = planar_strokes(radius[:, None, None] * arc, np.tile(directions, (3, 1)), spacing)
    remaining = enforce_separation(mesh, strokes, 0.5)
    assert np.allclose(np.unique(np.linalg.norm(remaining.points, axis=1).round(9)), radius[1:])


@pytest.mark.slow
def test_circles_of_latitude_close():
    surface = icosphere(4)
    instance = MeshInstance(surface, IDENTITY, axis_field(surface, 4, (0, 0, 1)))
    mesh, strokes = build_tangent_mesh(instance), trace_strokes(instance, 0.1)
    loops = strokes.select(strokes.closed)
    assert len(loops) >= 20
    gap = loops.points[loops.start[1:] - 1] - loops.points[loops.start[:-1]]
    assert np.linalg.norm(gap, axis=1).max() < 1e-3 * 0.1 * 2
    # Loops go around the axis at constant height, or over both poles.
    for first, last in pairwise(loops.start):
        x, y, z = loops.points[first:last].T
        if np.ptp(z) < 1.99:
            assert np.ptp(z) < 0.03
            longitude = np.unwrap(np.arctan2(y, x))
            assert np.isclose(abs(longitude[-1] - longitude[0]), 2 * np.pi, atol=0.05)
    assert direction_errors(mesh, strokes).max() < 1.0
    assert lateral_gaps(mesh, strokes).nearest_distance.min() >= 0.5


def test_thin_sheets_do_not_interfere():
    """Two planes are a hundredth of the spacing apart and face away from each other."""
    upper = plane()
    lower_vertices = upper.vertices - (0, 0, 0.001)
    quads = upper.corner_vertex.reshape(-1, 4)
    faces = np.concatenate([quads, quads[:, ::-1] + len(upper.vertices)])
    surface = build_surface(
        np.concatenate([upper.vertices, lower_vertices]),
        faces.ravel(),
        np.arange(0, faces.size + 1, 4),
    )
    instance = MeshInstance(surface, IDENTITY, axis_field(surface, 2, (1, 0, 0)))
    strokes = trace_strokes(instance, 0.1)
    is_upper = strokes.normal[strokes.start[:-1], 2] > 0
    assert 18 <= is_upper.sum() <= 22 and 18 <= (~is_upper).sum() <= 22


@pytest.mark.slow
def test_same_strokes_again():
    a, b = (trace_strokes(instance_of(icosphere(3), 4), 0.2) for _ in range(2))
    assert np.array_equal(a.points, b.points) and np.array_equal(a.family, b.family)


# --- density ---------------------------------------------------------------------------------------


@pytest.mark.slow
def test_ink_coverage_follows_a_ramp_of_tone():
    """Coverage is the length of strokes per area, times the width that is solid at the minimum."""
    surface = plane(40, 40)
    width = 0.025
    tone = 0.85 * (surface.vertices[:, 0] + 1) / 2
    spacing = spacing_by_tone(width, tone, max_ratio=1 / 0.15)
    instance = MeshInstance(surface, IDENTITY, axis_field(surface, 2, (0, 1, 0)))
    start, end, _ = segments_of(trace_strokes(instance, spacing))
    length = np.linalg.norm(end - start, axis=1)
    bins = np.linspace(-1, 1, 6)
    coverage, _ = np.histogram((start + end)[:, 0] / 2, bins, weights=length * width)
    coverage /= 2 * np.diff(bins)
    expected = 1 - 0.85 * ((bins[1:] + bins[:-1]) / 2 + 1) / 2
    assert (np.diff(coverage) < 0).all()
    assert np.abs(coverage - expected).max() < 0.1


@pytest.mark.slow
def test_strokes_are_denser_where_the_surface_is_more_curved():
    """On an ellipsoid, the length of strokes per area is one over the required spacing."""
    sphere = icosphere(4)
    surface = build_surface(
        sphere.vertices * (1, 1, 3), sphere.corner_vertex, sphere.face_start, name="ellipsoid"
    )
    spacing = spacing_by_curvature(surface, 0.06, 1.0)
    assert np.ptp(spacing) > 0.01
    instance = MeshInstance(surface, IDENTITY, axis_field(surface, 2, (0, 0, 1)))
    mesh = build_tangent_mesh(instance)
    triangle_spacing = spacing[surface.triangle_vertex].mean(axis=1)
    start, end, triangle = segments_of(trace_strokes(instance, spacing))
    length = np.bincount(triangle, np.linalg.norm(end - start, axis=1), len(triangle_spacing))
    dense = triangle_spacing < np.median(triangle_spacing)
    for region in (dense, ~dense):
        expected = (mesh.area[region] / triangle_spacing[region]).sum()
        assert 0.8 < length[region].sum() / expected < 1.2


def test_families_by_tone():
    instance = turned(plane(10, 10), 4)
    strokes = trace_strokes(instance, 0.1)
    tone = values_at_points(strokes, instance.surface, (instance.surface.vertices[:, 0] + 1) / 2)
    weighted = weight_by_tone(strokes, tone, 0.4)
    for family, onset_tone in ((0, 1.0), (1, 0.6)):
        selected = weighted.select(weighted.family == family)
        x = selected.points[:, 0]
        assert len(selected) and x.max() < 2 * onset_tone - 1
        # The width is three times the darkness, at most the full width.
        expected = np.clip(3 * (onset_tone - (x + 1) / 2), 0, 1)
        np.testing.assert_allclose(selected.width, expected, atol=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("slant", [0.8, *long(0.0, 1.2)])
def test_slanted_surfaces_are_as_dense_in_the_picture(slant):
    """The density is the length of lines per area in the picture, averaged over directions."""
    floor = plane(20, 20)
    camera = orthographic_camera(
        look_at((0, -5 * np.sin(slant), 5 * np.cos(slant)), (0, 0, 0), (0, 1, 0)), 400, 400, scale=2
    )
    lengths = []
    for angle in np.linspace(0, np.pi / 2, 5)[:-1]:
        instance = MeshInstance(
            floor, IDENTITY, axis_field(floor, 4, (np.cos(angle), np.sin(angle), 0))
        )
        spacing = spacing_in_picture(build_tangent_mesh(instance), camera, 6.0).values
        strokes = trace_strokes(instance, spacing)
        pixels, _ = project_to_pixels(strokes.points, camera)
        segment_length = np.linalg.norm(np.diff(pixels, axis=0), axis=1)
        lengths.append(segment_length[np.diff(strokes.stroke) == 0].sum())
    area = 400 * 400 * np.cos(slant)
    # There are two families, six pixels apart.
    assert np.mean(lengths) / area == pytest.approx(2 / 6, rel=0.12)


# --- families --------------------------------------------------------------------------------------


@pytest.mark.slow
def test_families_are_consistent_on_a_torus():
    instance = turned(torus(48, 24), 4)
    assert global_labels(build_tangent_mesh(instance)) is not None
    strokes = trace_strokes(instance, 0.15)
    assert strokes.names == ("family 1", "family 2")
    middle = (strokes.start[:-1] + strokes.start[1:]) // 2
    x, y, _ = strokes.points[middle].T
    around = normalize(np.stack([-y, x, 0 * x], axis=1))
    is_around = np.abs(dot(strokes.member[middle], around)) > 0.7
    assert len(np.unique(is_around[strokes.family == 0])) == 1
    assert len(np.unique(is_around[strokes.family == 1])) == 1


@pytest.mark.slow
def test_no_global_families_around_singularities():
    instance = instance_of(icosphere(3), 4)
    assert global_labels(build_tangent_mesh(instance)) is None
    assert set(trace_strokes(instance, 0.2).family.tolist()) == {0, 1}


# --- tapers, ends and crossings ----------------------------------------------------------------------


def test_taper_and_closed_strokes():
    strokes = trace_strokes(turned(plane(), 2), 0.1).tapered(2.0, 0.2)
    assert np.allclose(strokes.width[strokes.start[:-1]], 0.2)
    assert strokes.width.max() == 1.0 and (strokes.width >= 0.2 - 1e-9).all()


def test_ends_that_meet_head_on_are_not_tapered():
    """Stroke 1 continues stroke 0 at half a spacing, 2 is beside 0, and 3 is perpendicular to it."""
    along = np.linspace(0, 1, 11)[:, None] * np.array([1.0, 0, 0])
    points = [
        along,
        along + (1.05, 0.05, 0),
        along + (0, 0.1, 0),
        along[:, [1, 0, 2]] + (1.02, 0, 0),
    ]
    directions = np.repeat([[1.0, 0, 0], [1.0, 0, 0], [1.0, 0, 0], [0, 1.0, 0]], 11, axis=0)
    strokes = planar_strokes(np.array(points), directions, 0.1)
    # The last end of stroke 2 is beside that of stroke 0, and also meets stroke 1.
    assert head_on_ends(strokes).tolist() == [
        [False, True],
        [True, False],
        [False, True],
        [False, False],
    ]
    tapered = strokes.tapered(2.0, 0.2, ~head_on_ends(strokes))
    first, last = tapered.start[:-1], tapered.start[1:] - 1
    end_width = np.stack([tapered.width[first], tapered.width[last]], axis=1)
    assert np.allclose(end_width, [[0.2, 1], [1, 0.2], [0.2, 1], [0.2, 0.2]])


def test_parallel_strokes_do_not_cross():
    """Their direction and their places are exact, but for rounding off the plane."""
    random = np.random.default_rng(0)
    step = np.array([1 / 64, 1 / 128, 0])
    start = random.integers(0, 1024, (100, 1, 3)) / 1024 * (1, 1, 0)
    points = start + np.arange(11)[:, None] * step
    points[..., 2] = random.normal(scale=1e-16, size=points.shape[:2])
    directions = np.tile(normalize(step), (points[..., 0].size, 1))
    assert not len(find_crossings(planar_strokes(points, directions, 0.1)).stroke)


@pytest.mark.parametrize("columns", [3, 7])
def test_gaps_at_crossings(columns):
    """All strokes cross all others once; some do so at the edges of triangles."""
    instance = instance_of(plane(columns, columns), 4)
    strokes = trace_strokes(instance, 0.2)
    crossings = find_crossings(strokes)
    max_count = (strokes.family == 0).sum() * (strokes.family == 1).sum()
    assert len(crossings.stroke) == max_count
    gapped = with_crossing_gaps(strokes, 0.3)
    assert not len(find_crossings(gapped).stroke)
    removed_length = strokes.length.sum() - gapped.length.sum()
    assert np.isclose(removed_length, len(crossings.stroke) * 0.3 * 0.2, rtol=0.1)
    for family in (
        0,
        1,
    ):  # strokes pass over and under in turn, so each family has half of the gaps
        cut = strokes.length[strokes.family == family].sum()
        cut -= gapped.length[gapped.family == family].sum()
        assert np.isclose(cut, removed_length / 2, rtol=0.1)


@pytest.mark.slow
@settings(max_examples=30, deadline=None)
@given(st.floats(0.01, 1.9), st.floats(0.01, 0.5))
def test_cut_intervals_remove_their_length(low, size):
    strokes = trace_strokes(instance_of(plane(3, 3), 2), 0.2)
    remaining = cut_intervals(strokes, np.array([0]), np.array([low]), np.array([low + size]))
    total = strokes.length[0]
    assume(low + size < total - 1e-6 or low + size > total + 1e-6)
    removed_length = min(low + size, total) - min(low, total)
    assert np.isclose(strokes.length.sum() - remaining.length.sum(), removed_length, atol=1e-9)


# --- visibility --------------------------------------------------------------------------------------


@pytest.mark.slow
def test_a_sphere_shows_its_near_side():
    instance = instance_of(icosphere(4), 2)
    camera = orthographic_camera(look_at((0, -5, 0), (0, 0, 0)), 400, 400, scale=2.5)
    strokes = trace_strokes(instance, 0.1)
    visible = visible_strokes(strokes, [instance], camera)
    assert visible.points[:, 1].max() < 0.06
    start, end, _ = segments_of(strokes)
    is_near_side = (start + end)[:, 1] < 0
    near_length = np.linalg.norm(end - start, axis=1)[is_near_side].sum()
    assert np.isclose(visible.length.sum(), near_length, rtol=0.02)
    unclipped = clip_to_visible(strokes, camera, None)
    assert np.isclose(unclipped.length.sum(), strokes.length.sum())


@pytest.mark.slow
def test_strokes_are_clipped_by_occluders_and_by_the_frame():
    instance = turned(plane(), 2)
    camera = orthographic_camera(look_at((0, 0, 5), (0, 0, 0), (0, 1, 0)), 200, 200, scale=1.0)
    strokes = trace_strokes(instance, 0.05)
    in_frame = visible_strokes(strokes, [instance], camera)
    assert np.abs(in_frame.points[:, :2]).max() <= 0.5 + 1e-9
    matrix = np.eye(4)
    matrix[:3, 3] = (1.0, 0, 1.0)
    occluder = MeshInstance(plane(), matrix)
    visible = visible_strokes(strokes, [instance, occluder], camera)
    assert visible.points[:, 0].max() < 0.02
    assert len(visible) >= 15


def test_outlines_of_simple_shapes():
    sphere = MeshInstance(icosphere(4), IDENTITY)
    camera = orthographic_camera(look_at((0, -5, 0), (0, 0, 0)), 400, 400, scale=2.5)
    lines = outline_strokes(sphere, camera)
    assert len(lines) == 1 and lines.closed[0] and lines.names[lines.family[0]] == "silhouettes"
    assert np.abs(lines.points[:, 1]).max() < 0.01
    assert np.isclose(lines.length[0], 2 * np.pi, rtol=0.01)
    box = outline_strokes(MeshInstance(sharp_cube(), IDENTITY), camera)
    assert np.isclose(box.length.sum(), 12) and set(box.family.tolist()) == {1}
    edge = outline_strokes(MeshInstance(plane(), IDENTITY), camera)
    assert np.isclose(edge.length.sum(), 8) and set(edge.family.tolist()) == {2}


# --- files -------------------------------------------------------------------------------------------


def svg_camera():
    return orthographic_camera(look_at((0, 0, 5), (0, 0, 0), (0, 1, 0)), 200, 100, scale=4.0)


def svg_of(**pen_options):
    """Return the root element of an SVG file, and its strokes."""
    instance = turned(plane(), 4)
    strokes = visible_strokes(trace_strokes(instance, 0.2).tapered(1.0), [instance], svg_camera())
    return ElementTree.fromstring(svg_text(strokes, svg_camera(), Pen(**pen_options))), strokes


def path_points(data):
    """Return the (n, 2) points of SVG path data, without the radii of arcs."""
    without_arcs = re.sub(r"A\S+ 0 0 1", "", data)
    return np.array(re.findall(r"(-?[\d.]+),(-?[\d.]+)", without_arcs), dtype=float)


@pytest.mark.parametrize("color", ["", "\x1b[31m", "blakc", "#12", "#gggggg", 'red" x="', "#00f\n"])
def test_color_must_be_one_of_svg(color):
    with pytest.raises(RosyError, match="is not a color"):
        Pen(colors=("Navy", "#00F", color))


def test_svg_has_one_layer_per_family_and_one_path_per_stroke():
    root, strokes = svg_of(millimeters=100, colors=("red", "#00f"))
    inkscape = "{http://www.inkscape.org/namespaces/inkscape}"
    layers = root.findall("{http://www.w3.org/2000/svg}g")
    assert [layer.get(inkscape + "label") for layer in layers] == ["paper", "family 1", "family 2"]
    assert all(layer.get(inkscape + "groupmode") == "layer" for layer in layers)
    assert [layer.get("stroke") for layer in layers[1:]] == ["red", "#00f"]
    assert (root.get("width"), root.get("height")) == ("100mm", "50mm")
    assert root.get("viewBox") == "0 0 200 100"
    paths = list(root.iter("{http://www.w3.org/2000/svg}path"))
    assert len(paths) == len(strokes)
    for path in paths:
        assert path.get("d").endswith("Z") == (path.get("stroke") == "none")
        # An outline is half the width of the pen away from its stroke.
        points = path_points(path.get("d"))
        assert len(points) >= 2
        assert (points >= -0.51).all() and (points <= (200.51, 100.51)).all()


@pytest.mark.slow
@pytest.mark.parametrize("plotter", [False, True])
def test_closed_strokes_are_closed_paths(plotter):
    """Without their last point, which is the first one. Strokes that are cut are open."""
    instance = MeshInstance(icosphere(4), IDENTITY, axis_field(icosphere(4), 4, (0, 0, 1)))
    camera = orthographic_camera(look_at((0, 0, 5), (0, 0, 0), (0, 1, 0)), 300, 200, scale=3.3)
    strokes = visible_strokes(trace_strokes(instance, 0.15), [instance], camera)
    cut = strokes.runs_where(strokes.points[:, 0] > 0)
    for part in (strokes.select(strokes.closed), strokes.select(~strokes.closed), cut):
        text = svg_text(part, camera, Pen(plotter=plotter))
        paths = [path.get("d") for path in ElementTree.fromstring(text).iter() if path.get("d")]
        assert paths and all(data.endswith("Z") == part.closed.any() for data in paths)
        for data in paths:
            points = path_points(data)
            assert not (points[0] == points[-1]).all()


def test_outlines_hold_as_much_ink_as_their_strokes():
    """The area of an outline is the mean width times the length, without the round ends."""
    root, strokes = svg_of(width=3.0, paper=None)
    pixels, _ = project_to_pixels(strokes.points, svg_camera())
    length = np.hypot(*np.diff(pixels, axis=0).T) * (np.diff(strokes.stroke) == 0)
    mean_width = (strokes.width[1:] + strokes.width[:-1]) / 2
    expected = np.bincount(strokes.stroke[1:], 3.0 * mean_width * length)
    areas = []
    for path in root.iter("{http://www.w3.org/2000/svg}path"):
        x, y = path_points(path.get("d")).T
        areas.append(abs(x @ np.roll(y, 1) - y @ np.roll(x, 1)) / 2)
    by_family = np.argsort(strokes.family, kind="stable")
    assert np.allclose(areas, expected[by_family], rtol=0.03, atol=0.2)


@settings(max_examples=30, deadline=None)
@given(st.integers(1, 60), st.integers(0, 10**6))
def test_plotter_order_is_a_permutation_with_little_travel(count, seed):
    random = np.random.default_rng(seed)
    first, last = random.random((2, count, 2))
    order, is_reversed = plotter_order(first, last)
    assert sorted(order.tolist()) == list(range(count))
    begin = np.where(is_reversed[:, None], last[order], first[order])
    end = np.where(is_reversed[:, None], first[order], last[order])
    travel = np.linalg.norm(begin[1:] - end[:-1], axis=1).sum()
    unordered_travel = np.linalg.norm(first[1:] - last[:-1], axis=1).sum()
    assert travel <= unordered_travel + 1e-9 or count < 6


@settings(max_examples=40, deadline=None)
@given(st.lists(st.integers(2, 40), min_size=1, max_size=4), st.integers(0, 10**6))
def test_simplified_lines_stay_within_the_tolerance(sizes, seed):
    random = np.random.default_rng(seed)
    start = np.concatenate([[0], np.cumsum(sizes)])
    points = np.cumsum(random.normal(size=(start[-1], 2)), axis=0)
    kept = simplify_mask(points, start, 0.5)
    assert kept[start[:-1]].all() and kept[start[1:] - 1].all()
    for a, b in pairwise(start):
        simplified = points[a:b][kept[a:b]]
        chord = np.diff(simplified, axis=0)
        delta = points[a:b, None] - simplified[:-1]
        fraction = np.clip((delta * chord).sum(axis=2) / (chord**2).sum(axis=1), 0, 1)
        distance = np.linalg.norm(delta - fraction[..., None] * chord, axis=2)
        assert distance.min(axis=1).max() <= 0.5 + 1e-9


@pytest.mark.slow
def test_command_line(tmp_path, capsys, monkeypatch):
    mesh, out = tmp_path / "ball.obj", tmp_path / "ball.svg"
    ball = icosphere(3)
    rows = [f"v {x} {y} {z}" for x, y, z in ball.vertices]
    mesh.write_text("\n".join(rows + [f"f {a} {b} {c}" for a, b, c in ball.triangle_vertex + 1]))
    command = [
        "strokes",
        str(mesh),
        "--generate",
        "smoothest",
        "--set",
        "spacing=12",
        "-o",
        str(out),
    ]
    contents = []
    for _ in range(2):
        options = "--size 300x200 --set outline=on --set gaps=0.3 --set light=lamp"
        assert main([*command, *options.split()]) == 0
        contents.append(out.read_bytes())
    assert contents[0] == contents[1]
    root = ElementTree.fromstring(contents[0])
    assert len(root.findall("{http://www.w3.org/2000/svg}g")) == 4
    for arguments, message in (
        (["-o", str(tmp_path / "ball.png")], "ball.png"),
        (["--camera", "Close"], "ball.obj: --camera applies only to .blend files"),
        (["--frames", "1-3"], "ball.obj: --frames applies only to .blend files"),
        (["--set", "light=scene"], "ball.obj: has no lights"),
        (["--set", "taper=-1"], "setting 'taper' is -1.0, expected a number from 0"),
        (["--set", "wobble=1"], "--set wobble=1: unknown setting 'wobble'"),
        (["--set", "light"], "--set light: expected NAME=VALUE"),
    ):
        assert main([*command, *arguments]) == 2
        assert message in capsys.readouterr().err
    assert main(["strokes", "-o", str(out)]) == 2
    assert "give a mesh file" in capsys.readouterr().err
    monkeypatch.setitem(sys.modules, "bpy", None)
    assert main(["strokes", "scene.blend", "-o", str(out)]) == 2
    assert "needs Blender" in capsys.readouterr().err


# --- errors ------------------------------------------------------------------------------------------


def test_errors_are_one_line(error_of):
    instance = turned(plane(), 4)
    nothing = RosyField(4, np.zeros((16, 3)))
    for field, spacing, message in (
        (instance.field, 0.0, "above 0"),
        (instance.field, 1e-6, "too many"),
        (None, 0.1, "no field"),
        (nothing, 0.1, "zero everywhere"),
    ):
        assert message in error_of(trace_strokes, replace(instance, field=field), spacing)
