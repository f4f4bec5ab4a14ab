"""Operator: bake the field of the selected meshes into textures for their UV maps."""

from __future__ import annotations

import bpy

from ..rosy_addon.bake_texture import TextureResult, bake_texture
from ..rosy_addon.scene.field_attributes import has_field
from ..rosy_addon.worker.job import Steps
from .base import ACTIVE_FIELD, IDLE, selected_mesh_objects
from .modal_job import DialogJobMixin
from .unwrap import unwrapped


class ROSY_OT_bake_texture(DialogJobMixin, bpy.types.Operator):
    """Draw the field of the selected meshes as a texture for their UV map, which stays on the surface from all sides"""

    bl_idname = "rosy.bake_texture"
    bl_label = "Bake Texture"
    bl_options = {"UNDO"}
    conditions = (IDLE, ACTIVE_FIELD)

    unwrap: bpy.props.BoolProperty(
        name="Unwrap",
        description="Unwrap meshes that have no UV map, with Smart UV Project",
        options={"SKIP_SAVE"},
    )

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

    def begin(self, context: bpy.types.Context) -> Steps[list[TextureResult]]:
        missing = self._without_uv_map(context) if self.unwrap else []
        steps = bake_texture.begin(context.scene, self.required_data(context))
        return unwrapped(context, missing, steps) if missing else steps

    def required_data(self, context: bpy.types.Context) -> list[bpy.types.Object]:
        return [obj for obj in selected_mesh_objects(context) if has_field(obj)]

    def finish(self, context: bpy.types.Context, result: list[TextureResult]) -> None:
        names = ", ".join(f"'{texture.object.name}'" for texture in result)
        self.report({"INFO"}, f"Baked the texture of {names}")
        self.report_warnings(*(text for texture in result for text in texture.warnings))

    def _without_uv_map(self, context: bpy.types.Context) -> list[bpy.types.Object]:
        return [
            obj
            for obj in self.required_data(context)
            if not obj.data.uv_layers and not obj.rosy.texture_uv_map
        ]


CLASSES = (ROSY_OT_bake_texture,)
