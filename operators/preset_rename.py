"""Operator: change the name or description of one of the user's presets."""

from __future__ import annotations

import bpy

from ..rosy_addon.errors import RosyError
from ..rosy_addon.preset_files.store import MAX_NAME_LENGTH, rename_preset
from ..rosy_addon.scene.paths import user_presets_folder
from ..rosy_addon.ui import preset_library
from ..rosy_addon.viewport.view3d import redraw
from .preset_shared import (
    DESCRIPTION_ARGUMENTS,
    PRESET_ARGUMENTS,
    draw_name_and_description,
    poll_user_presets,
    target_preset,
)
from .reports import report_error


class ROSY_OT_preset_rename(bpy.types.Operator):
    """Change the name or the description of one of your presets"""

    bl_idname = "rosy.preset_rename"
    bl_label = "Rename Preset"
    bl_options = {"REGISTER"}

    preset: bpy.props.StringProperty(search=preset_library.search_user_presets, **PRESET_ARGUMENTS)
    name: bpy.props.StringProperty(
        name="Name", description="New name of the preset", maxlen=MAX_NAME_LENGTH
    )
    sentence: bpy.props.StringProperty(**DESCRIPTION_ARGUMENTS)

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return poll_user_presets(cls)

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        entry = preset_library.entries().get(target_preset(self, context))
        if entry is not None:
            self.name, self.sentence = entry.preset.name, entry.preset.description
        return context.window_manager.invoke_props_dialog(self, width=400, confirm_text="Rename")

    def draw(self, context: bpy.types.Context) -> None:
        draw_name_and_description(self.layout, self)

    def execute(self, context: bpy.types.Context) -> set[str]:
        old, name = target_preset(self, context), self.name.strip()
        old_name = preset_library.preset_name(old)
        try:
            new = rename_preset(old, name, self.sentence.strip(), user_presets_folder())
        except RosyError as error:
            return report_error(self, error)
        preset_library.rename_references(old, new)
        self.report({"INFO"}, f"Renamed preset '{old_name}' to '{name}'")
        redraw()
        return {"FINISHED"}


CLASSES = (ROSY_OT_preset_rename,)
