"""Strokes on Suzanne, who comes with Blender."""

from __future__ import annotations

import bpy
import numpy as np
import pytest
from rosy.rosy_addon.field.generate import generate
from rosy.rosy_addon.field.surface import build_surface
from rosy.rosy_addon.projection.gbuffer import Body
from rosy.rosy_addon.strokes.evenness import side_gaps
from rosy.rosy_addon.strokes.ground import lay_ground
from rosy.rosy_addon.strokes.trace import trace

pytestmark = pytest.mark.long


def suzanne(levels=2):
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
    body = Body(surface, np.eye(4), generate(surface, "smoothest", degree))
    gaps = side_gaps(lay_ground(body), trace(body, 0.012 * surface.size))
    assert gaps.even() >= 0.9
    assert gaps.nearest.min() >= 0.5
