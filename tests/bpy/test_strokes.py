"""The spacing of strokes on Suzanne, and her outlines."""

from __future__ import annotations

import bpy
import numpy as np
import pytest
from rosy.rosy_addon.field.generate import generate
from rosy.rosy_addon.field.surface import build_surface
from rosy.rosy_addon.line_drawing.pipeline import draw_instances
from rosy.rosy_addon.line_drawing.style import StrokeStyle
from rosy.rosy_addon.line_drawing.tangent_mesh import build_tangent_mesh
from rosy.rosy_addon.line_drawing.visibility import project_to_pixels
from rosy.rosy_addon.projection.camera import orbit_camera
from rosy.rosy_addon.projection.gbuffer import MeshInstance
from rosy.tests.harness.outline_marks import visible_silhouettes
from rosy.tests.harness.stroke_spacing import lateral_gaps
from rosy.tests.harness.stroke_tracing import trace_strokes
from scipy.spatial import cKDTree


def suzanne(levels=2):
    """Return the surface of Suzanne, subdivided."""
    bpy.ops.mesh.primitive_monkey_add()
    monkey = bpy.context.object
    if levels:
        monkey.modifiers.new("smooth", "SUBSURF").levels = levels
    mesh = monkey.evaluated_get(bpy.context.evaluated_depsgraph_get()).to_mesh()
    points = [tuple(vertex.co) for vertex in mesh.vertices]
    faces = [list(polygon.vertices) for polygon in mesh.polygons]
    starts = np.cumsum([0, *map(len, faces)])
    return build_surface(points, np.concatenate(faces), starts, name="Suzanne")


@pytest.mark.long
@pytest.mark.parametrize("degree", [2, 4, 6])
def test_spacing_on_suzanne(scene, degree):
    surface = suzanne()
    instance = MeshInstance(surface, np.eye(4), generate(surface, "smoothest", degree))
    gaps = lateral_gaps(
        build_tangent_mesh(instance), trace_strokes(instance, 0.012 * surface.extent)
    )
    assert gaps.evenness() >= 0.9
    assert gaps.nearest_distance.min() >= 0.5


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
