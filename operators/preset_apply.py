"""Give the scene the look of a preset."""

from __future__ import annotations

from typing import Any

import bpy

from ..rosy_addon.compositor.presets import load_preset, preset_names
from ..rosy_addon.errors import RosyError
from ..rosy_addon.ui.properties import apply_look


class ROSY_OT_preset_apply(bpy.types.Operator):
    """Give the scene the look of this preset"""

    bl_idname = "rosy.preset_apply"
    bl_label = "Apply Preset"
    bl_options = {"REGISTER", "UNDO"}

    preset: bpy.props.StringProperty(
        name="Preset",
        description="Name of a preset that comes with RoSy, or path of one's own",
        search=lambda self, context, typed: preset_names(),
        search_options={"SUGGESTION"},
    )

    @classmethod
    def description(cls, context: bpy.types.Context, properties: Any) -> str:
        """What the preset says of itself."""
        try:
            return load_preset(properties.preset).description
        except RosyError as error:
            return str(error)

    def execute(self, context: bpy.types.Context) -> set[str]:
        try:
            apply_look(context.scene.rosy, load_preset(self.preset).look)
        except RosyError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        return {"FINISHED"}


CLASSES = (ROSY_OT_preset_apply,)
