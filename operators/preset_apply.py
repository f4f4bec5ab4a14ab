"""Operator: apply the look of a preset to the scene."""

from __future__ import annotations

from typing import Any

import bpy

from ..rosy_addon.errors import RosyError, as_sentence
from ..rosy_addon.presets.store import load_preset
from ..rosy_addon.scene.paths import user_presets_folder
from ..rosy_addon.ui import preset_library
from .reports import report_error


class ROSY_OT_preset_apply(bpy.types.Operator):
    """Replace the look of the scene by the look of this preset"""

    bl_idname = "rosy.preset_apply"
    bl_label = "Apply Preset"
    bl_options = {"REGISTER", "UNDO"}

    preset: bpy.props.StringProperty(
        name="Preset",
        description="Name of a preset, or path of a .json file",
        search=lambda self, context, typed: preset_library.preset_keys(),
        search_options={"SUGGESTION"},
    )

    @classmethod
    def description(cls, context: bpy.types.Context, properties: Any) -> str:
        """Return the description of the preset, as the tooltip."""
        try:
            return load_preset(properties.preset, user_presets_folder()).description
        except RosyError as error:
            return as_sentence(str(error))

    def execute(self, context: bpy.types.Context) -> set[str]:
        try:
            preset_library.apply_preset(context.scene.rosy, self.preset)
        except RosyError as error:
            return report_error(self, error)
        return {"FINISHED"}


CLASSES = (ROSY_OT_preset_apply,)
