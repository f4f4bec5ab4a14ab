"""Unwrapping of meshes with Blender's Smart UV Project, for jobs that need a UV map."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any

import bpy
import numpy as np

from ..rosy_addon.errors import RosyError
from ..rosy_addon.scene.compat import is_editable
from ..rosy_addon.worker.job import Step, Steps

#: Angle between the faces of a chart, and distance between charts as a fraction of the map.
ANGLE, MARGIN = math.radians(66), 0.003

#: Name of the new UV maps, as Blender's own.
UV_MAP_NAME = "UVMap"


def unwrapped(
    context: bpy.types.Context, objects: Sequence[bpy.types.Object], steps: Steps[Any]
) -> Steps[Any]:
    """Add a UV map to the meshes of objects for a job, which removes them if it is not finished.

    Parameters
    ----------
    context : bpy.types.Context
    objects : sequence of bpy.types.Object
        Meshes without a UV map.
    steps : Steps
        Of the job that needs the UV maps.

    Raises
    ------
    RosyError
        If a mesh is linked from a library.
    """
    meshes = {obj.data: obj for obj in objects}
    for mesh, obj in meshes.items():
        if not is_editable(mesh):
            raise RosyError(
                f"object '{obj.name}': its mesh is linked and has no UV map: make it local"
            )
    if context.mode != "OBJECT":
        bpy.ops.object.mode_set(mode="OBJECT")
    map_names = {}
    for mesh in meshes:
        # The operator refuses meshes without faces.
        uv = _unwrapped(context, mesh) if mesh.polygons else np.zeros(0, dtype=np.float32)
        layer = mesh.uv_layers.new(name=UV_MAP_NAME)
        layer.data.foreach_set("uv", uv)
        # Blender adds a number if the mesh has another attribute of this name.
        map_names[mesh] = layer.name
    with_cleanup = _with_removal(map_names, steps)
    next(with_cleanup)  # from here on, it removes the maps also if it is closed
    return with_cleanup


def _with_removal(map_names: Mapping[bpy.types.Mesh, str], steps: Steps[Any]) -> Steps[Any]:
    """Run the steps of a job. If it is not finished, the UV maps are removed from the meshes."""
    try:
        yield Step(0.0, "unwrapping")
        return (yield from steps)
    except BaseException:
        for mesh, name in map_names.items():
            if (layer := mesh.uv_layers.get(name)) is not None:
                mesh.uv_layers.remove(layer)
        raise


def _unwrapped(context: bpy.types.Context, mesh: bpy.types.Mesh) -> np.ndarray:
    """Return the (2 C,) float32 coordinates of an unwrapped copy of a mesh.

    Blender's operator changes what is hidden and selected, and needs an object that is visible. The copy
    keeps both away from the user's mesh.
    """
    with _only_selected_copy(context, mesh) as copy:
        bpy.ops.object.mode_set(mode="EDIT")
        bpy.ops.mesh.reveal(select=False)
        bpy.ops.mesh.select_all(action="SELECT")
        bpy.ops.uv.smart_project(angle_limit=ANGLE, island_margin=MARGIN)
        bpy.ops.object.mode_set(mode="OBJECT")
        uv = np.zeros(2 * len(copy.data.loops), dtype=np.float32)
        if copy.data.uv_layers:
            copy.data.uv_layers[0].data.foreach_get("uv", uv)
        return uv


@contextmanager
def _only_selected_copy(
    context: bpy.types.Context, mesh: bpy.types.Mesh
) -> Iterator[bpy.types.Object]:
    """Yield an object with a copy of a mesh, which alone is selected and active."""
    active = context.view_layer.objects.active
    selected = list(context.selected_objects)
    copy = bpy.data.objects.new("RoSy Unwrapping", mesh.copy())
    try:
        context.scene.collection.objects.link(copy)
        for obj in selected:
            obj.select_set(False)
        copy.select_set(True)
        context.view_layer.objects.active = copy
        yield copy
    finally:
        data = copy.data
        bpy.data.objects.remove(copy)
        bpy.data.meshes.remove(data)
        for obj in selected:
            obj.select_set(True)
        context.view_layer.objects.active = active
