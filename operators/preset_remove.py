"""Delete a preset of the user's own."""

from __future__ import annotations

import bpy

from ..rosy_addon.compositor.presets import remove_preset
from ..rosy_addon.errors import RosyError
from ..rosy_addon.scene.folders import presets_folder
from ..rosy_addon.ui import shelf
from .shelved import ANY_PRESET, has_own, preset_of


class ROSY_OT_preset_remove(bpy.types.Operator):
    """Delete a preset of your own and its picture; the look of the scene stays"""

    bl_idname = "rosy.preset_remove"
    bl_label = "Delete Preset"
    bl_options = {"REGISTER"}

    preset: bpy.props.StringProperty(
        search=lambda self, context, typed: shelf.own_names(), **ANY_PRESET
    )

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return has_own(cls)

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        key = preset_of(self, context)
        entry = shelf.entries().get(key)
        name = key if entry is None else entry.preset.name
        return context.window_manager.invoke_confirm(
            self,
            event,
            title=f"Delete the preset '{name}'?",
            message="This cannot be undone",
            confirm_text="Delete",
            icon="WARNING",
        )

    def execute(self, context: bpy.types.Context) -> set[str]:
        key = preset_of(self, context)
        try:
            remove_preset(key, presets_folder())
        except RosyError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        self.report({"INFO"}, f"Deleted preset '{key}'")
        return {"FINISHED"}


CLASSES = (ROSY_OT_preset_remove,)
