"""Give a preset of the user's own another name or sentence."""

from __future__ import annotations

import bpy

from ..rosy_addon.compositor.presets import LONGEST_NAME, rename_preset
from ..rosy_addon.errors import RosyError
from ..rosy_addon.scene.folders import presets_folder
from ..rosy_addon.ui import shelf
from .shelved import ANY_PRESET, SENTENCE, draw_name, has_own, preset_of


class ROSY_OT_preset_rename(bpy.types.Operator):
    """Give a preset of your own another name or sentence"""

    bl_idname = "rosy.preset_rename"
    bl_label = "Rename Preset"
    bl_options = {"REGISTER"}

    preset: bpy.props.StringProperty(
        search=lambda self, context, typed: shelf.own_names(), **ANY_PRESET
    )
    name: bpy.props.StringProperty(
        name="Name", description="What the preset is to be called", maxlen=LONGEST_NAME
    )
    sentence: bpy.props.StringProperty(**SENTENCE)

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return has_own(cls)

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        entry = shelf.entries().get(preset_of(self, context))
        if entry is not None:
            self.name, self.sentence = entry.preset.name, entry.preset.description
        return context.window_manager.invoke_props_dialog(self, width=400)

    def draw(self, context: bpy.types.Context) -> None:
        draw_name(self.layout, self)

    def execute(self, context: bpy.types.Context) -> set[str]:
        old, name = preset_of(self, context), self.name.strip()
        try:
            new = rename_preset(old, name, self.sentence.strip(), presets_folder())
        except RosyError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        shelf.follow(old, new)
        self.report({"INFO"}, f"Renamed preset '{old}' to '{name}'")
        return {"FINISHED"}


CLASSES = (ROSY_OT_preset_rename,)
