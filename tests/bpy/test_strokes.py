"""The spacing of strokes on Suzanne."""

from __future__ import annotations

import bpy
import numpy as np
import pytest
from rosy.rosy_addon.field.generate import generate
from rosy.rosy_addon.field.surface import build_surface
from rosy.rosy_addon.projection.gbuffer import MeshInstance
from rosy.rosy_addon.strokes.tangent_mesh import build_tangent_mesh
from rosy.rosy_addon.strokes.trace import trace_strokes
from rosy.tests.harness.stroke_spacing import lateral_gaps

pytestmark = pytest.mark.long


def suzanne(levels=2):
    """Return the surface of Suzanne, subdivided."""
    bpy.ops.mesh.primitive_monkey_add()
    monkey = bpy.context.object
    monkey.modifiers.new("smooth", "SUBSURF").levels = levels
    mesh = monkey.evaluated_get(bpy.context.evaluated_depsgraph_get()).to_mesh()
    points = [tuple(vertex.co) for vertex in mesh.vertices]
    faces = [list(polygon.vertices) for polygon in mesh.polygons]
    starts = np.cumsum([0, *map(len, faces)])
    return build_surface(points, np.concatenate(faces), starts, name="Suzanne")


@pytest.mark.parametrize("degree", [2, 4, 6])
def test_spacing_on_suzanne(scene, degree):
    surface = suzanne()
    instance = MeshInstance(surface, np.eye(4), generate(surface, "smoothest", degree))
    gaps = lateral_gaps(
        build_tangent_mesh(instance), trace_strokes(instance, 0.012 * surface.extent)
    )
    assert gaps.evenness() >= 0.9
    assert gaps.nearest_distance.min() >= 0.5
