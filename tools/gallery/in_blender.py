"""Functions that make objects in Blender, which several pages use."""

from collections.abc import Callable

import bpy
import numpy as np
from mathutils import Matrix

from rosy_addon.field.surface import Surface, build_surface
from rosy_addon.projection.camera import orbit_basis


def evaluated_surface(
    add: Callable[[], object], modifier: str = "", name: str = "mesh", **settings: float
) -> Surface:
    """Return the mesh that an operator adds to an empty file, after a modifier, as a surface."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    add()
    obj = bpy.context.object
    if modifier:
        added = obj.modifiers.new(modifier, modifier)
        for key, value in settings.items():
            setattr(added, key, value)
    mesh = obj.evaluated_get(bpy.context.evaluated_depsgraph_get()).to_mesh()
    is_flat = [not modifier and not polygon.use_smooth for polygon in mesh.polygons]
    return surface_of(mesh, name, np.array(is_flat))


def surface_of(mesh: bpy.types.Mesh, name: str, flat_faces: np.ndarray | None = None) -> Surface:
    """Convert a mesh of Blender to a surface."""
    vertices = np.empty((len(mesh.vertices), 3), dtype=np.float32)
    mesh.vertices.foreach_get("co", vertices.ravel())
    corners = np.empty(len(mesh.loops), dtype=np.int32)
    mesh.loops.foreach_get("vertex_index", corners)
    start = np.empty(len(mesh.polygons), dtype=np.int32)
    mesh.polygons.foreach_get("loop_start", start)
    start = np.append(start, len(corners))
    return build_surface(vertices, corners, start, name=name, flat_faces=flat_faces)


def add_suzanne() -> bpy.types.Object:
    """Open an empty file, add the monkey, subdivided twice, and return its object."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.ops.mesh.primitive_monkey_add()
    obj = bpy.context.object
    obj.modifiers.new("Subdivision", "SUBSURF").levels = 2
    bpy.ops.object.modifier_apply(modifier="Subdivision")
    return obj


def add(kind: str, data: bpy.types.ID, angles: tuple[float, float], distance: float):
    """Add an object with some data that faces the origin from an azimuth and an elevation, in degrees."""
    obj = bpy.data.objects.new(kind, data)
    bpy.context.scene.collection.objects.link(obj)
    axes = orbit_basis(*angles)
    obj.matrix_world = Matrix([*np.c_[axes.T, distance * axes[2]].tolist(), [0, 0, 0, 1]])
    return obj
