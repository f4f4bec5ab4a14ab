"""Preferences of the extension: what new scenes start from."""

from __future__ import annotations

from dataclasses import fields

import bpy

from ..compositor.look import Look
from ..scene.folders import EXTENSION
from . import shelf


class ROSY_AP_preferences(bpy.types.AddonPreferences):
    """What a scene starts from when its first field is made."""

    bl_idname = EXTENSION

    preset: bpy.props.StringProperty(
        name="Preset",
        description="Look that a scene starts from, by name or as the path of one's own preset; "
        "empty: RoSy's own",
        search=lambda self, context, typed: shelf.names(),
        search_options={"SUGGESTION"},
    )
    directory: bpy.props.StringProperty(
        name="Picture Folder",
        description="Folder that a scene's pictures are saved to, if they are saved; empty: a "
        "folder 'rosy' beside the .blend file",
        subtype="DIR_PATH",
    )

    def draw(self, context: bpy.types.Context) -> None:
        layout = self.layout
        layout.use_property_split = True
        layout.label(text="A scene starts from these when its first field is made")
        layout.prop(self, "preset")
        layout.prop(self, "directory")


def start_scene(context: bpy.types.Context) -> None:
    """Give a scene whose settings nobody has touched what the preferences say.

    Raises
    ------
    RosyError
        If the preset cannot be read.
    """
    settings, extension = context.scene.rosy, context.preferences.addons.get(EXTENSION)
    if extension is None:
        return
    wished = extension.preferences
    untouched = not any(settings.look.is_property_set(entry.name) for entry in fields(Look))
    if wished.preset and untouched:
        shelf.apply_preset(settings, wished.preset)
    if wished.directory and not settings.is_property_set("directory"):
        settings.directory = wished.directory


CLASSES = (ROSY_AP_preferences,)
