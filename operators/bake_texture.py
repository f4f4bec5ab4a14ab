"""Operator: bake the field of the selected meshes into textures for their UV maps.

Meshes without a UV map are unwrapped with Blender's Smart UV Project, if the user agrees.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from contextlib import suppress
from functools import partial
from typing import Any

import bpy
import numpy as np
from bpy.types import Context, Event, Mesh, Object, Operator

from ..rosy_addon.core.errors import RosyError
from ..rosy_addon.jobs.bake_texture import TextureResult, bake_texture
from ..rosy_addon.scene.datablocks import is_editable
from ..rosy_addon.scene.field_attributes import has_field
from ..rosy_addon.ui.property_makers import toggle
from ..rosy_addon.ui.translations import translated
from ..rosy_addon.worker.job import Steps, reverting
from .base import ACTIVE_FIELD, IDLE, selected_mesh_objects
from .modal_job import ModalJobMixin

#: Largest angle between the faces of a chart in radians, and distance between charts in UV units.
ANGLE, MARGIN = math.radians(66), 0.003

#: Name of new UV maps, the same as Blender gives them.
UV_MAP_NAME = "UVMap"


class ROSY_OT_bake_texture(ModalJobMixin, Operator):
    """Draw the field of the selected meshes as textures for their UV maps. Unlike a baked picture, a texture covers all sides of a mesh"""

    bl_label = "Bake Texture"
    bl_options = {"UNDO"}
    conditions = (IDLE, ACTIVE_FIELD)

    unwrap: toggle(
        "Unwrap", "Unwrap meshes that have no UV map, with Smart UV Project", options={"SKIP_SAVE"}
    )

    def ask(self, context: Context, event: Event) -> set[str] | None:
        """If there are meshes without a UV map, ask the user whether to unwrap them.

        Return the result of the operator; None if nothing is asked.
        """
        self._missing = [obj.name for obj in self._without_uv_map()]
        if self.unwrap or not self._missing:
            return None
        return context.window_manager.invoke_props_dialog(self, width=340, confirm_text="Unwrap")

    def take_answer(self, context: Context) -> None:
        self.unwrap = True

    def draw(self, context: Context) -> None:
        names = ", ".join(f"'{name}'" for name in self._missing)
        column = self.layout.column(align=True)
        column.label(text=translated("No UV map: {names}").format(names=names), icon="ERROR")
        column.label(text="Unwrap with Smart UV Project, and bake the texture?")

    def begin(self, context: Context) -> Steps[list[TextureResult]]:
        missing = self._without_uv_map() if self.unwrap else []
        steps = bake_texture.begin(context.scene, self.objects)
        return _with_uv_maps(context, missing, steps) if missing else steps

    def find_objects(self, context: Context) -> list[Object]:
        return [obj for obj in selected_mesh_objects(context) if has_field(obj)]

    def finish(self, context: Context, result: list[TextureResult]) -> None:
        names = ", ".join(f"'{texture.object.name}'" for texture in result)
        self.report_done(f"Baked the texture of {names}")
        self.report_warnings(*(text for texture in result for text in texture.warnings))

    def _without_uv_map(self) -> list[Object]:
        return [obj for obj in self.objects if not (obj.data.uv_layers or obj.rosy.texture_uv_map)]


def _with_uv_maps(context: Context, objects: Sequence[Object], steps: Steps[Any]) -> Steps[Any]:
    """Add UV maps to the meshes of objects. Return the steps of a job that uses the maps.

    If the job does not finish, it removes the UV maps.

    Parameters
    ----------
    context : bpy.types.Context
    objects : sequence of bpy.types.Object
        Meshes without a UV map.
    steps : Steps
        Steps of the job that needs the UV maps.

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
        # Smart UV Project raises an error for meshes without faces.
        uv = _unwrapped(context, mesh) if mesh.polygons else np.zeros(0, dtype=np.float32)
        layer = mesh.uv_layers.new(name=UV_MAP_NAME)
        layer.data.foreach_set("uv", uv)
        # Blender adds a number if the mesh has another attribute of this name.
        map_names[mesh] = layer.name
    return reverting(steps, partial(_remove_uv_maps, map_names))


def _remove_uv_maps(map_names: Mapping[Mesh, str]) -> None:
    """Remove UV maps, given by name for each mesh that still exists."""
    for mesh, name in map_names.items():
        with suppress(ReferenceError):
            if (layer := mesh.uv_layers.get(name)) is not None:
                mesh.uv_layers.remove(layer)


def _unwrapped(context: Context, mesh: Mesh) -> np.ndarray:
    """Return new UV coordinates for the C corners of a mesh, (2 C,) float32, as u, v, u, v ...

    A copy of the mesh is unwrapped, because Blender's operator needs a visible object, and changes which
    faces are hidden and selected.
    """
    objects = context.view_layer.objects
    active, selected = objects.active, list(objects.selected)
    copy = bpy.data.objects.new("RoSy Unwrapping", mesh.copy())
    try:
        context.scene.collection.objects.link(copy)
        for obj in selected:
            obj.select_set(False)
        copy.select_set(True)
        objects.active = copy
        bpy.ops.object.mode_set(mode="EDIT")
        bpy.ops.mesh.reveal(select=False)
        bpy.ops.mesh.select_all(action="SELECT")
        bpy.ops.uv.smart_project(angle_limit=ANGLE, island_margin=MARGIN)
        bpy.ops.object.mode_set(mode="OBJECT")
        uv = np.zeros(2 * len(copy.data.loops), dtype=np.float32)
        if copy.data.uv_layers:
            copy.data.uv_layers[0].data.foreach_get("uv", uv)
        return uv
    finally:
        data = copy.data
        bpy.data.objects.remove(copy)
        bpy.data.meshes.remove(data)
        for obj in selected:
            obj.select_set(True)
        objects.active = active
