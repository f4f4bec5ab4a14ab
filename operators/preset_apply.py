"""Give the scene the look of a preset."""

from __future__ import annotations

from typing import Any

import bpy

from ..rosy_addon.compositor.presets import load_preset
from ..rosy_addon.errors import RosyError
from ..rosy_addon.scene.folders import presets_folder
from ..rosy_addon.ui import shelf


class ROSY_OT_preset_apply(bpy.types.Operator):
    """Give the scene the look of this preset"""

    bl_idname = "rosy.preset_apply"
    bl_label = "Apply Preset"
    bl_options = {"REGISTER", "UNDO"}

    preset: bpy.props.StringProperty(
        name="Preset",
        description="Name of a preset, RoSy's or your own, or the path of a .json file",
        search=lambda self, context, typed: shelf.names(),
        search_options={"SUGGESTION"},
    )

    @classmethod
    def description(cls, context: bpy.types.Context, properties: Any) -> str:
        """What the preset says of itself."""
        try:
            return load_preset(properties.preset, presets_folder()).description
        except RosyError as error:
            return str(error)

    def execute(self, context: bpy.types.Context) -> set[str]:
        try:
            shelf.apply_preset(context.scene.rosy, self.preset)
        except RosyError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        return {"FINISHED"}


CLASSES = (ROSY_OT_preset_apply,)
