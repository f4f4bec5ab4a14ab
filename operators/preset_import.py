"""Operator: import a preset from a file."""

from __future__ import annotations

import bpy
from bpy_extras.io_utils import ImportHelper

from ..rosy_addon.errors import RosyError
from ..rosy_addon.preset_files.store import read_preset, save_preset
from ..rosy_addon.scene.paths import user_presets_folder
from ..rosy_addon.viewport.view3d import redraw
from .reports import report_error


class ROSY_OT_preset_import(bpy.types.Operator, ImportHelper):
    """Add a preset from a file to your presets"""

    bl_idname = "rosy.preset_import"
    bl_label = "Import Preset"
    bl_options = {"REGISTER"}

    filename_ext = ".json"
    filter_glob: bpy.props.StringProperty(default="*.json", options={"HIDDEN"})
    replace: bpy.props.BoolProperty(
        name="Replace Existing",
        description="Replace your preset of the same name",
        options={"SKIP_SAVE"},
    )

    def execute(self, context: bpy.types.Context) -> set[str]:
        try:
            preset = read_preset(bpy.path.abspath(self.filepath))
            save_preset(preset, user_presets_folder(), replace=self.replace)
        except RosyError as error:
            return report_error(self, error)
        self.report({"INFO"}, f"Added preset '{preset.name}' to your presets")
        redraw()
        return {"FINISHED"}


CLASSES = (ROSY_OT_preset_import,)
