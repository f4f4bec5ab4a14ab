"""Keep the scene's look as a preset of the user's own."""

from __future__ import annotations

from typing import Any

import bpy

from ..rosy_addon.compositor.presets import (
    LONGEST_NAME,
    Preset,
    key_of,
    save_preset,
)
from ..rosy_addon.errors import RosyError
from ..rosy_addon.scene.folders import presets_folder
from ..rosy_addon.ui import shelf
from ..rosy_addon.ui.properties import look_of
from .shelved import SENTENCE, draw_name


class ROSY_OT_preset_save(bpy.types.Operator):
    """Keep the look of this scene as a preset of your own, with a picture of it"""

    bl_idname = "rosy.preset_save"
    bl_label = "Save Preset"
    bl_options = {"REGISTER"}

    name: bpy.props.StringProperty(
        name="Name", description="What the preset is called", maxlen=LONGEST_NAME
    )
    sentence: bpy.props.StringProperty(**SENTENCE)
    replace: bpy.props.BoolProperty(
        name="Replace the One There",
        description="Let this preset take the place of one of yours that is called the same",
        options={"SKIP_SAVE"},
    )

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        entry = shelf.chosen(context.scene.rosy)
        if entry is not None and entry.own:
            self.name, self.sentence = entry.preset.name, entry.preset.description
        return context.window_manager.invoke_props_dialog(self, width=400)

    def draw(self, context: bpy.types.Context) -> None:
        layout = self.layout
        draw_name(layout, self)
        if _is_own(self.name):
            layout.label(text="You have a preset of this name", icon="INFO")
            layout.prop(self, "replace")

    def execute(self, context: bpy.types.Context) -> set[str]:
        settings = context.scene.rosy
        preset = Preset(self.name.strip(), self.sentence.strip(), look_of(settings))
        try:
            key = save_preset(preset, presets_folder(), replace=self.replace)
        except RosyError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        settings.preset_name = key
        self.report({"INFO"}, f"Saved preset '{preset.name}'")
        return {"FINISHED"}


def _is_own(name: Any) -> bool:
    try:
        return key_of(name) in shelf.own_names()
    except RosyError:
        return False


CLASSES = (ROSY_OT_preset_save,)
