"""Operator: save the look of the scene as a preset."""

from __future__ import annotations

from typing import Any

import bpy

from ..rosy_addon.errors import RosyError
from ..rosy_addon.preset_files.store import MAX_NAME_LENGTH, Preset, preset_key, save_preset
from ..rosy_addon.scene.look_properties import read_look
from ..rosy_addon.scene.paths import user_presets_folder
from ..rosy_addon.ui import preset_library
from ..rosy_addon.viewport.view3d import redraw
from .preset_shared import DESCRIPTION_ARGUMENTS, draw_name_and_description
from .reports import report_error


class ROSY_OT_preset_save(bpy.types.Operator):
    """Save the look of this scene as one of your presets"""

    bl_idname = "rosy.preset_save"
    bl_label = "Save Preset"
    bl_options = {"REGISTER"}

    name: bpy.props.StringProperty(
        name="Name", description="Name of the preset", maxlen=MAX_NAME_LENGTH
    )
    sentence: bpy.props.StringProperty(**DESCRIPTION_ARGUMENTS)
    replace: bpy.props.BoolProperty(
        name="Replace Existing",
        description="Replace your preset of the same name",
        options={"SKIP_SAVE"},
    )

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        entry = preset_library.active_entry(context.scene.rosy)
        if entry is not None and entry.is_user:
            self.name, self.sentence = entry.preset.name, entry.preset.description
        return context.window_manager.invoke_props_dialog(self, width=400, confirm_text="Save")

    def draw(self, context: bpy.types.Context) -> None:
        layout = self.layout
        draw_name_and_description(layout, self)
        if _is_user_preset(self.name):
            layout.label(text="You already have a preset of this name", icon="INFO")
            layout.prop(self, "replace")

    def execute(self, context: bpy.types.Context) -> set[str]:
        settings = context.scene.rosy
        preset = Preset(self.name.strip(), self.sentence.strip(), read_look(settings))
        try:
            key = save_preset(preset, user_presets_folder(), replace=self.replace)
        except RosyError as error:
            return report_error(self, error)
        settings.preset_name = key
        self.report({"INFO"}, f"Saved preset '{preset.name}'")
        redraw()
        return {"FINISHED"}


def _is_user_preset(name: Any) -> bool:
    """Return whether the user has a preset of this name."""
    try:
        return preset_key(name) in preset_library.user_preset_keys()
    except RosyError:
        return False


CLASSES = (ROSY_OT_preset_save,)
