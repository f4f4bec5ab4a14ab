"""Operator: bake the field of the selected meshes into textures for their UV maps."""

from __future__ import annotations

import math
from collections.abc import Iterable

import bpy

from ..rosy_addon.bake_texture import TextureResult, bake_texture_task
from ..rosy_addon.errors import RosyError
from ..rosy_addon.progress import Task
from ..rosy_addon.scene.compat import is_editable
from ..rosy_addon.scene.field_attributes import has_field
from .modal_task import DialogTaskMixin
from .poll import poll_active_field, poll_idle, selected_mesh_objects
from .reports import report_warnings

#: Angle between the faces of a chart, and distance between charts as a fraction of the map, with which
#: meshes are unwrapped.
UNWRAP_ANGLE, UNWRAP_MARGIN = math.radians(66), 0.003


class ROSY_OT_bake_texture(DialogTaskMixin, bpy.types.Operator):
    """Draw the field of the selected meshes as a texture for their UV map, which stays on the surface from all sides"""

    bl_idname = "rosy.bake_texture"
    bl_label = "Bake Texture"
    bl_options = {"UNDO"}

    unwrap: bpy.props.BoolProperty(
        name="Unwrap",
        description="Unwrap meshes that have no UV map, with Smart UV Project",
        options={"SKIP_SAVE"},
    )

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return poll_idle(cls) and poll_active_field(cls, context)

    def ask(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str] | None:
        """Ask whether to unwrap meshes, if there are any without a UV map."""
        if self.unwrap or not self._without_uv_map(context):
            return None
        return context.window_manager.invoke_props_dialog(self, width=340, confirm_text="Unwrap")

    def take_answer(self, context: bpy.types.Context) -> None:
        self.unwrap = True

    def draw(self, context: bpy.types.Context) -> None:
        names = ", ".join(f"'{obj.name}'" for obj in self._without_uv_map(context))
        column = self.layout.column(align=True)
        column.label(text=f"No UV map: {names}", icon="ERROR")
        column.label(text="Unwrap with Smart UV Project, and bake the texture?")

    def make_task(self, context: bpy.types.Context) -> Task[list[TextureResult]]:
        missing = self._without_uv_map(context)
        if self.unwrap and missing:
            _unwrap(context, missing)
            self.cancel_note = "the new UV maps were kept"
        return bake_texture_task(context.scene, self._objects(context))

    def required_data(self, context: bpy.types.Context) -> Iterable[bpy.types.ID]:
        return self._objects(context)

    def finish(self, context: bpy.types.Context, result: list[TextureResult]) -> None:
        names = ", ".join(f"'{texture.object.name}'" for texture in result)
        self.report({"INFO"}, f"Baked the texture of {names}")
        report_warnings(self, (text for texture in result for text in texture.warnings))

    @staticmethod
    def _objects(context: bpy.types.Context) -> list[bpy.types.Object]:
        return [obj for obj in selected_mesh_objects(context) if has_field(obj)]

    def _without_uv_map(self, context: bpy.types.Context) -> list[bpy.types.Object]:
        return [
            obj
            for obj in self._objects(context)
            if not obj.data.uv_layers and not obj.rosy.texture_uv_map
        ]


def _unwrap(context: bpy.types.Context, objects: list[bpy.types.Object]) -> None:
    """Unwrap the meshes of objects with Smart UV Project.

    Raises
    ------
    RosyError
        If a mesh is linked from a library.
    """
    for obj in objects:
        if not is_editable(obj.data):
            raise RosyError(
                f"object '{obj.name}': its mesh is linked and has no UV map: make it local"
            )
    active = context.view_layer.objects.active
    selected, mode = list(context.selected_objects), context.mode
    if mode != "OBJECT":
        bpy.ops.object.mode_set(mode="OBJECT")
    try:
        for obj in selected:
            obj.select_set(False)
        for obj in objects:
            context.view_layer.objects.active = obj
            obj.select_set(True)
            states = _element_states(obj.data)
            bpy.ops.object.mode_set(mode="EDIT")
            bpy.ops.mesh.reveal(select=False)
            bpy.ops.mesh.select_all(action="SELECT")
            bpy.ops.uv.smart_project(angle_limit=UNWRAP_ANGLE, island_margin=UNWRAP_MARGIN)
            bpy.ops.object.mode_set(mode="OBJECT")
            for elements, name, values in states:
                elements.foreach_set(name, values)
            obj.data.update()
            obj.select_set(False)
    finally:
        for obj in selected:
            obj.select_set(True)
        context.view_layer.objects.active = active


def _element_states(mesh: bpy.types.Mesh) -> list[tuple[bpy.types.bpy_prop_collection, str, list]]:
    """Return which vertices, edges and faces of a mesh are hidden, and which are selected."""
    states = []
    for elements in (mesh.vertices, mesh.edges, mesh.polygons):
        for name in ("hide", "select"):
            values = [False] * len(elements)
            elements.foreach_get(name, values)
            states.append((elements, name, values))
    return states


CLASSES = (ROSY_OT_bake_texture,)
