"""Operator: apply the look of a preset to the scene."""

from __future__ import annotations

import bpy

from ..rosy_addon.errors import RosyError
from ..rosy_addon.ui import preset_library
from .reports import report_error


class ROSY_OT_preset_apply(bpy.types.Operator):
    """Replace the look of the scene with the look of this preset"""

    bl_idname = "rosy.preset_apply"
    bl_label = "Apply Preset"
    bl_options = {"REGISTER", "UNDO"}

    preset: bpy.props.StringProperty(
        name="Preset",
        description="Name of a preset, or path of a .json file",
        search=preset_library.search_presets,
        search_options={"SUGGESTION"},
    )

    def execute(self, context: bpy.types.Context) -> set[str]:
        try:
            preset_library.apply_preset(context.scene.rosy, self.preset)
        except RosyError as error:
            return report_error(self, error)
        return {"FINISHED"}


CLASSES = (ROSY_OT_preset_apply,)
