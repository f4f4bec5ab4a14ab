"""Strokes: directions, spacing, families and visibility."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from field_helpers import bumpy
from harness.stroke_spacing import lateral_gaps
from harness.stroke_tracing import latitudes, planar_strokes, trace_strokes, turned, visible_strokes
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.special import ellipe
from shapes import (
    cylinder,
    from_quads,
    icosphere,
    instance_of,
    joined,
    moved,
    plane,
    rebuilt,
    sharp_cube,
    torus,
)

from rosy_addon.field.frames import dot, normalize
from rosy_addon.field.rosy_field import RosyField
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
from rosy_addon.line_drawing.surface_particles import SurfaceParticles, trace_geodesics
from rosy_addon.line_drawing.tangent_mesh import build_tangent_mesh
from rosy_addon.line_drawing.visibility import clip_to_visible, project_to_pixels
from rosy_addon.projection.camera import look_at, orbit_camera, orthographic_camera
from rosy_addon.projection.gbuffer import MeshInstance
from rosy_addon.projection.pixel_neighbors import screen_jacobians
from rosy_addon.projection.project import project


def segments_of(strokes):
    """Return the starts and ends of all segments, and their triangles."""
    end = np.flatnonzero(np.diff(strokes.stroke, prepend=-1) == 0)
    return strokes.points[end - 1], strokes.points[end], strokes.triangle[end]


# --- directions ------------------------------------------------------------------------------------


@pytest.mark.slow
@settings(max_examples=8)
@given(st.floats(0, np.pi), st.integers(1, 6), st.integers(1, 7))
def test_in_the_plane_strokes_are_straight_and_evenly_spaced(angle, degree, cells):
    instance = turned(plane(cells, cells), degree, angle)
    strokes = trace_strokes(instance, 0.2)
    chord = strokes.points[strokes.start[1:] - 1] - strokes.points[strokes.start[:-1]]
    assert np.allclose(np.linalg.norm(chord, axis=1), strokes.length, rtol=1e-6)
    chord_angle = np.angle(np.exp(1j * angle) / (chord[:, 0] + 1j * chord[:, 1]))
    line_count = degree if degree % 2 else degree // 2
    error = (chord_angle * line_count / np.pi + 0.5) % 1 - 0.5
    assert np.abs(error).max() < 1e-4 and np.abs(strokes.points).max() <= 1 + 1e-9
    gaps = lateral_gaps(build_tangent_mesh(instance), strokes)
    assert gaps.evenness > 0.9 and gaps.nearest > 0.5


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
    camera = orbit_camera(instance.surface.vertices, 20, 30, 600, 600, perspective=False)
    gbuffer = project([instance], camera)
    visible = visible_strokes(trace_strokes(instance, 0.1), [instance], camera)
    end = np.flatnonzero(np.diff(visible.stroke, prepend=-1) == 0)
    places, _ = project_to_pixels(visible.points, camera)
    column, row = np.floor((places[end] + places[end - 1]).T / 2).astype(int)
    pixel = row * camera.width + column
    index = np.searchsorted(gbuffer.pixel, pixel).clip(0, len(gbuffer.pixel) - 1)
    compared = gbuffer.pixel[index] == pixel
    compared &= gbuffer.triangle[index] == visible.triangle[end]
    compared &= gbuffer.normal[index, 2] > 0.8
    # Where z is smaller, the field turns within a pixel.
    z = gbuffer.representation[index]
    compared &= np.abs(z) > 0.5
    angle = np.angle(z)[:, None] / 4 + [0, np.pi / 2]
    x, y = screen_jacobians(gbuffer)[index].T[..., None]
    line = (places[end] - places[end - 1]) @ [1, 1j]
    off = np.angle(line[:, None] / (x * np.cos(angle) + y * np.sin(angle)))
    error = np.degrees(np.abs((off + np.pi / 2) % np.pi - np.pi / 2).min(axis=1))
    assert compared.sum() > 1000 and np.percentile(error[compared], 99) < 1.0


@pytest.mark.slow
def test_strokes_stop_at_creases_unless_asked():
    instance = instance_of(sharp_cube(), 4, (1, 0.3, 0.2))

    def face_counts(strokes):
        return [len(np.unique(strokes.face[a:b])) for a, b in pairwise(strokes.start)]

    assert set(face_counts(trace_strokes(instance, 0.1))) == {1}
    assert max(face_counts(trace_strokes(instance, 0.1, cross_creases=True))) > 1


def test_straight_ahead_is_a_geodesic():
    """Geodesics on a cylinder are straight lines in the plane to which it is unrolled."""
    mesh = build_tangent_mesh(turned(cylinder(64, 8), 2))
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
@pytest.mark.parametrize("surface", [torus(64, 32), icosphere(4)], ids=["torus", "sphere"])
def test_strokes_are_even_and_not_too_close(surface):
    """On the sphere, also around singularities."""
    instance = instance_of(surface, 4)
    strokes = trace_strokes(instance, 0.03 * surface.extent)
    gaps = lateral_gaps(build_tangent_mesh(instance), strokes)
    assert gaps.nearest >= 0.5 and gaps.evenness >= 0.9


@pytest.mark.slow
@pytest.mark.parametrize(("degree", "sign", "phase"), [(2, -1, 1.1), (4, 1, 0.3)])
def test_around_singularities_strokes_are_alike_on_all_sides(degree, sign, phase):
    """There are N - 1 or N + 1 equal sectors. The closest stroke has the same distance in each."""
    center, surface = (0.013, -0.007), plane(50, 50)
    x, y = (surface.face_center[:, :2] - center).T
    instance = turned(surface, degree, (sign * np.arctan2(y, x) / degree + phase)[:, None])
    mesh, strokes = build_tangent_mesh(instance), trace_strokes(instance, 0.08)
    triangle, weights, index = singularities(mesh)
    assert np.allclose(index, sign / degree) and len(index) == 1
    found_center = mesh.points_at(triangle, weights)[0, :2]
    assert np.linalg.norm(found_center - center) < 0.02
    fine = strokes.subdivided(np.full(len(strokes.points), 16))
    offset = (fine.points[:, :2] - found_center) @ [1, 1j]
    sectors, nearest = degree - sign, offset[np.abs(offset).argmin()]
    sector = np.rint(np.angle(offset / nearest) * sectors / (2 * np.pi)).astype(int) % sectors
    radius = np.full(sectors, np.inf)
    np.minimum.at(radius, sector, np.abs(offset))
    np.testing.assert_allclose(radius, radius.mean(), rtol=0.03)
    assert lateral_gaps(mesh, strokes).nearest >= 0.5


@pytest.mark.slow
def test_singularities_are_found():
    """The sum of the indices is the Euler characteristic (Poincare-Hopf theorem), also if zeros are on edges."""
    for surface in (bumpy(icosphere(4)), icosphere(3), icosphere(2), bumpy(torus(60, 30))):
        for degree in (1, 2, 3, 4, 6):
            mesh = build_tangent_mesh(instance_of(surface, degree))
            index = singularities(mesh)[2]
            assert np.isclose(index.sum(), surface.euler_characteristic)


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
    instance = latitudes(icosphere(4))
    mesh, strokes = build_tangent_mesh(instance), trace_strokes(instance, 0.1)
    loops = strokes.select(strokes.closed)
    assert len(loops) >= 20
    gap = loops.points[loops.start[1:] - 1] - loops.points[loops.start[:-1]]
    assert np.linalg.norm(gap, axis=1).max() < 1e-3 * 0.1 * 2
    for first, last in pairwise(loops.start):
        x, y, z = loops.points[first:last].T
        assert np.ptp(z) < 0.03
        longitude = np.unwrap(np.arctan2(y, x))
        assert np.isclose(abs(longitude[-1] - longitude[0]), 2 * np.pi, atol=0.05)
    assert lateral_gaps(mesh, strokes).nearest >= 0.5


def test_thin_sheets_do_not_interfere():
    """Two planes are a hundredth of the spacing apart and face away from each other."""
    upper = plane()
    lower = from_quads(upper.vertices - (0, 0, 0.001), upper.corner_vertex.reshape(-1, 4)[:, ::-1])
    strokes = trace_strokes(instance_of(joined(upper, lower), 2, (1, 0, 0)), 0.1)
    is_upper = strokes.normal[strokes.start[:-1], 2] > 0
    assert 18 <= is_upper.sum() <= 22 and 18 <= (~is_upper).sum() <= 22


# --- density ---------------------------------------------------------------------------------------


@pytest.mark.slow
def test_ink_coverage_follows_a_ramp_of_tone():
    """Coverage is the length of strokes per area, times the width that is solid at the minimum."""
    surface = plane(40, 40)
    width = 0.025
    spacing = width * spacing_by_tone(0.85 * (surface.vertices[:, 0] + 1) / 2, max_ratio=1 / 0.15)
    instance = instance_of(surface, 2, (0, 1, 0))
    start, end, _ = segments_of(trace_strokes(instance, spacing))
    length = np.linalg.norm(end - start, axis=1)
    bins = np.linspace(-1, 1, 6)
    coverage, _ = np.histogram((start + end)[:, 0] / 2, bins, weights=length * width)
    coverage /= 2 * np.diff(bins)
    expected = 1 - 0.85 * ((bins[1:] + bins[:-1]) / 2 + 1) / 2
    assert (np.diff(coverage) < 0).all() and np.abs(coverage - expected).max() < 0.1


def test_the_spacing_is_proportional_to_the_radius_of_curvature():
    """The smaller one of an ellipsoid, in closed form. The spacing is at least a half of the median."""
    sphere = icosphere(4)
    spacing = spacing_by_curvature(rebuilt(sphere, sphere.vertices * (1, 1, 3)), 1.0)
    squared = 9 - 8 * sphere.vertices[:, 2] ** 2
    radius = np.minimum(squared**1.5, squared**0.5) / 3
    ratio = (spacing / radius)[spacing > 0.5]
    np.testing.assert_allclose(ratio, np.median(ratio), rtol=0.05)


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


@pytest.mark.parametrize("slant", [0.0, 0.4, 0.8])
def test_slanted_surfaces_are_as_dense_in_the_picture(slant):
    """The mean length in the picture of lines of all directions is an elliptic integral."""
    eye = 0, -5 * np.sin(slant), 5 * np.cos(slant)
    camera = orthographic_camera(look_at(eye, (0, 0, 0), (0, 1, 0)), 400, 400, scale=2)
    spacing = spacing_in_picture(build_tangent_mesh(turned(plane(), 4)), camera, 6.0)
    length = 2 / np.pi * ellipe(np.sin(slant) ** 2)
    np.testing.assert_allclose(spacing.values, 6 / 200 * length / np.cos(slant), rtol=0.02)


# --- families --------------------------------------------------------------------------------------


@pytest.mark.slow
def test_families_are_consistent_on_a_torus():
    instance = turned(torus(48, 24), 4)
    assert global_labels(build_tangent_mesh(instance)) is not None
    strokes = trace_strokes(instance, 0.15)
    assert strokes.names == ("family 1", "family 2")
    middle = (strokes.start[:-1] + strokes.start[1:]) // 2
    around = normalize(np.cross((0, 0, 1), strokes.points[middle]))
    is_around = np.abs(dot(strokes.member[middle], around)) > 0.7
    for family in (0, 1):
        assert len(np.unique(is_around[strokes.family == family])) == 1


@pytest.mark.slow
def test_no_global_families_around_singularities():
    instance = instance_of(icosphere(3), 4)
    assert global_labels(build_tangent_mesh(instance)) is None
    assert set(trace_strokes(instance, 0.2).family.tolist()) == {0, 1}


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
    assert np.isclose(clip_to_visible(strokes, camera, None).length.sum(), strokes.length.sum())


@pytest.mark.slow
def test_strokes_are_clipped_by_occluders_and_by_the_frame():
    instance = turned(plane(), 2)
    camera = orthographic_camera(look_at((0, 0, 5), (0, 0, 0), (0, 1, 0)), 200, 200, scale=1.0)
    strokes = trace_strokes(instance, 0.05)
    in_frame = visible_strokes(strokes, [instance], camera)
    assert np.abs(in_frame.points[:, :2]).max() <= 0.5 + 1e-9
    occluder = MeshInstance(plane(), moved(x=1.0, z=1.0))
    visible = visible_strokes(strokes, [instance, occluder], camera)
    assert visible.points[:, 0].max() < 0.02 and len(visible) >= 15


def test_outlines_of_simple_shapes():
    sphere = MeshInstance(icosphere(4), np.eye(4))
    camera = orthographic_camera(look_at((0, -5, 0), (0, 0, 0)), 400, 400, scale=2.5)
    lines = outline_strokes(sphere, camera)
    assert len(lines) == 1 and lines.closed[0] and lines.names[lines.family[0]] == "silhouettes"
    assert np.abs(lines.points[:, 1]).max() < 0.01
    assert np.isclose(lines.length[0], 2 * np.pi, rtol=0.01)
    box = outline_strokes(MeshInstance(sharp_cube(), np.eye(4)), camera)
    assert np.isclose(box.length.sum(), 12) and set(box.family.tolist()) == {1}
    edge = outline_strokes(MeshInstance(plane(), np.eye(4)), camera)
    assert np.isclose(edge.length.sum(), 8) and set(edge.family.tolist()) == {2}


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
