"""The spacing of strokes on Suzanne, and her outlines."""

from __future__ import annotations

import bpy
import numpy as np
from rosy.rosy_addon.field.generate import generate
from rosy.rosy_addon.field.surface import build_surface
from rosy.rosy_addon.line_drawing.pipeline import draw_instances
from rosy.rosy_addon.line_drawing.style import StrokeStyle
from rosy.rosy_addon.line_drawing.visibility import project_to_pixels
from rosy.rosy_addon.projection.camera import orbit_camera
from rosy.rosy_addon.projection.gbuffer import MeshInstance
from rosy.tests.harness.outline_marks import visible_silhouettes
from scenes import depsgraph
from scipy.spatial import cKDTree


def suzanne(levels=2):
    """Return the surface of Suzanne, subdivided."""
    bpy.ops.mesh.primitive_monkey_add()
    monkey = bpy.context.object
    if levels:
        monkey.modifiers.new("smooth", "SUBSURF").levels = levels
    mesh = monkey.evaluated_get(depsgraph()).to_mesh()
    points = [tuple(vertex.co) for vertex in mesh.vertices]
    faces = [list(polygon.vertices) for polygon in mesh.polygons]
    starts = np.cumsum([0, *map(len, faces)])
    return build_surface(points, np.concatenate(faces), starts, name="Suzanne")


def test_outlines_of_a_coarse_mesh_have_no_gaps(scene):
    """Silhouettes of interpolated normals lie behind faces of their mesh, here by up to 0.3 units."""
    surface = suzanne(0)
    instance = MeshInstance(surface, np.eye(4), generate(surface, "smoothest", 4))
    camera = orbit_camera(surface.vertices, -32.0, 24.0, 300, 300)
    strokes = draw_instances([instance], camera, StrokeStyle(spacing=60, outline=True)).strokes
    outlines = strokes.select(strokes.family == strokes.names.index("silhouettes"))
    silhouettes, _ = visible_silhouettes(instance, camera, min_jump=50)
    distance, _ = cKDTree(project_to_pixels(outlines.points, camera)[0]).query(silhouettes)
    assert distance.max() < 6.5
