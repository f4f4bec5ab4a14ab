"""Operator: delete one of the user's presets."""

from __future__ import annotations

import bpy

from ..rosy_addon.errors import RosyError
from ..rosy_addon.preset_files.store import remove_preset
from ..rosy_addon.scene.paths import user_presets_folder
from ..rosy_addon.ui import preset_library
from ..rosy_addon.viewport.view3d import redraw
from .preset_shared import PRESET_ARGUMENTS, poll_user_presets, target_preset
from .reports import report_error


class ROSY_OT_preset_remove(bpy.types.Operator):
    """Delete one of your presets. The look of the scene does not change"""

    bl_idname = "rosy.preset_remove"
    bl_label = "Delete Preset"
    bl_options = {"REGISTER"}

    preset: bpy.props.StringProperty(search=preset_library.search_user_presets, **PRESET_ARGUMENTS)

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return poll_user_presets(cls)

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        name = preset_library.preset_name(target_preset(self, context))
        return context.window_manager.invoke_confirm(
            self,
            event,
            title=f"Delete the preset '{name}'?",
            message="This cannot be undone",
            confirm_text="Delete",
            icon="WARNING",
        )

    def execute(self, context: bpy.types.Context) -> set[str]:
        key = target_preset(self, context)
        name = preset_library.preset_name(key)
        try:
            remove_preset(key, user_presets_folder())
        except RosyError as error:
            return report_error(self, error)
        self.report({"INFO"}, f"Deleted preset '{name}'")
        redraw()
        return {"FINISHED"}


CLASSES = (ROSY_OT_preset_remove,)
