"""Outlines in pictures: silhouettes without gaps, creases without specks."""

import numpy as np
import pytest
from harness.outline_marks import visible_silhouettes
from harness.stroke_tracing import pixel_lengths
from scipy.spatial import cKDTree
from shapes import capped_cylinder, icosphere, instance_of, plane, rebuilt, torus

import rosy_addon.api as rf
from rosy_addon.line_drawing.outline import OUTLINE_KINDS
from rosy_addon.line_drawing.pipeline import draw_instances
from rosy_addon.line_drawing.style import StrokeStyle
from rosy_addon.line_drawing.visibility import project_to_pixels
from rosy_addon.projection.camera import look_at, orbit_camera, orthographic_camera
from rosy_addon.projection.gbuffer import MeshInstance

#: Outlines shorter than this in pixels are specks.
MIN_MARK_PX = 6.0


def outlines_of(surface, camera):
    """Return the outlines of a drawing."""
    instance = instance_of(surface, 4, (0.1, 0.2, 1))
    strokes = draw_instances([instance], camera, StrokeStyle(spacing=40, outline=1.0)).strokes
    kinds = [strokes.names.index(kind) for kind in OUTLINE_KINDS]
    return strokes.select(np.isin(strokes.family, kinds))


def coverage(lines, surface, camera, tolerance):
    """Return the share of the visible silhouettes of a surface that is near an outline."""
    border, _ = visible_silhouettes(MeshInstance(surface, np.eye(4)), camera)
    pixels, _ = project_to_pixels(lines.points, camera)
    is_first = np.zeros(len(pixels), dtype=bool)
    is_first[lines.start[:-1]] = True
    # Points are about a pixel apart.
    assert np.linalg.norm(np.diff(pixels, axis=0), axis=1)[~is_first[1:]].max() < 1.5
    return np.mean(cKDTree(pixels).query(border)[0] <= tolerance)


def closed_cylinder(columns):
    """Return a cylinder with ends, whose edges are sharp above 60 degrees."""
    return rebuilt(capped_cylinder(columns), sharp_angle=np.pi / 3)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("coarse", "dense"),
    [
        (torus(48, 12, 1, 0.25), torus(384, 192, 1, 0.25)),
        (closed_cylinder(32), closed_cylinder(256)),
        (icosphere(3), icosphere(5)),
    ],
    ids=["torus", "cylinder", "sphere"],
)
def test_silhouettes_of_coarse_meshes_are_those_of_the_smooth_surface(coarse, dense):
    camera = orbit_camera(dense.vertices, -26, 8, 300, 300)
    lines = outlines_of(coarse, camera)
    assert pixel_lengths(lines, camera).min() >= MIN_MARK_PX and len(lines) <= 4
    assert coverage(lines, dense, camera, tolerance=2.5) >= 0.98


@pytest.mark.slow
def test_silhouettes_of_flat_faces_are_edges():
    flat = rebuilt(icosphere(3), flat_faces=np.ones(icosphere(3).face_count, dtype=bool))
    camera = orbit_camera(flat.vertices, 20, 10, 300, 300)
    lines = outlines_of(flat, camera)
    assert set(lines.family.tolist()) == {lines.names.index("silhouettes")}
    assert pixel_lengths(lines, camera).min() >= MIN_MARK_PX
    assert coverage(lines, flat, camera, tolerance=1.0) >= 0.98


def test_walls_seen_almost_edge_on_have_outlines():
    """Also if the angle to the line of sight is so small that its square is not a number."""
    corners = [[0, 0, 0], [0, 0, 2.5], [0, 1.3, 2.5], [0, 1.3, 0]]
    wall = rf.Surface(corners, [[0, 1, 2], [0, 2, 3]], name="wall", up="y")
    field = rf.along_axis(wall, (0, 1, 0.3), 2)
    rf.strokes(wall, field, view=(-3.5e-160, 0), size=(15, 28), outline=1.0)


@pytest.mark.slow
def test_a_silhouette_on_the_far_side_is_hidden():
    """Inside the hole of a torus, only one of two silhouettes is visible where they run in parallel."""
    surface = torus(96, 48, 1, 0.4)
    camera = orthographic_camera(look_at((0, -5, 1.2), (0, 0, 0)), 300, 300, scale=3)
    lines = outlines_of(surface, camera)
    to_eye = camera.view_directions(lines.points)
    ring = lines.points[:, :2] / np.linalg.norm(lines.points[:, :2], axis=1)[:, None]
    # On the far outer side and the near inner side, another part of the torus is in front.
    is_inside = np.linalg.norm(lines.points[:, :2], axis=1) < 1
    is_near = (ring * to_eye[:, :2]).sum(axis=1) > 0.5
    assert not (is_inside & is_near & (lines.points[:, 2] < 0)).any()


def folded(cells=60, gap=()):
    """Return a sheet with a fold of 60 degrees along y, less in the given cells, and sharp pyramids."""
    flat = plane(cells, cells)
    x, y, _ = flat.vertices.T
    u, v = np.divmod(np.arange(len(x)), cells + 1)
    height = -0.577 * np.abs(x)
    height[(2 * u == cells) & np.isin(v, gap)] -= 0.0059
    height[((u % 20) == 5) & ((v % 15) == 7)] += 0.06
    return rebuilt(flat, np.stack([x, y, height], axis=1), sharp_angle=np.radians(50))


def test_gaps_in_creases_are_closed_and_specks_left_out():
    """A hysteresis closes the gap of two cells; the pyramids are one cell high and wide."""
    camera = orthographic_camera(look_at((0, 0, 5), (0, 0, 0), (0, 1, 0)), 120, 120, scale=2.4)
    lines = outlines_of(folded(gap=(30, 31)), camera)
    creases = lines.select(lines.family == lines.names.index("creases"))
    assert len(creases) == 1 and pixel_lengths(creases, camera)[0] == pytest.approx(100, abs=2)
    assert pixel_lengths(lines, camera).min() >= MIN_MARK_PX
