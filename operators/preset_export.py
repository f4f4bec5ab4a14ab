"""Operator: export a preset to a file."""

from __future__ import annotations

from pathlib import Path

import bpy
from bpy_extras.io_utils import ExportHelper

from ..rosy_addon.errors import RosyError
from ..rosy_addon.preset_files.store import load_preset, write_preset
from ..rosy_addon.scene.paths import user_presets_folder
from ..rosy_addon.ui import preset_library
from .preset_shared import PRESET_ARGUMENTS, target_preset
from .reports import report_error


class ROSY_OT_preset_export(bpy.types.Operator, ExportHelper):
    """Write a preset to a file that others can import"""

    bl_idname = "rosy.preset_export"
    bl_label = "Export Preset"
    bl_options = {"REGISTER"}

    filename_ext = ".json"
    filter_glob: bpy.props.StringProperty(default="*.json", options={"HIDDEN"})
    preset: bpy.props.StringProperty(search=preset_library.search_presets, **PRESET_ARGUMENTS)

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        self.filepath = f"{Path(target_preset(self, context)).stem}.json"
        return ExportHelper.invoke(self, context, event)

    def execute(self, context: bpy.types.Context) -> set[str]:
        path = Path(bpy.path.abspath(self.filepath))
        try:
            write_preset(path, load_preset(target_preset(self, context), user_presets_folder()))
        except RosyError as error:
            return report_error(self, error)
        self.report({"INFO"}, f"Wrote {path}")
        return {"FINISHED"}


CLASSES = (ROSY_OT_preset_export,)
