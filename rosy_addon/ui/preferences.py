"""Preferences of the extension: the defaults of new scenes."""

from __future__ import annotations

import bpy

from ..compositor.look import Look
from ..scene.paths import EXTENSION_ID
from ..settings import settings_of
from . import preset_library


class ROSY_AP_preferences(bpy.types.AddonPreferences):
    """Defaults that a scene gets when its first field is made."""

    bl_idname = EXTENSION_ID

    preset: bpy.props.StringProperty(
        name="Preset",
        description="Initial look of a scene: the name of a preset, or the path of a preset file. "
        "Empty: the default look",
        search=lambda self, context, typed: preset_library.preset_keys(),
        search_options={"SUGGESTION"},
    )
    directory: bpy.props.StringProperty(
        name="Picture Folder",
        description="Folder for the pictures of a scene, if they are saved to files. Empty: the "
        "folder 'rosy' beside the .blend file",
        subtype="DIR_PATH",
    )

    def draw(self, context: bpy.types.Context) -> None:
        layout = self.layout
        layout.use_property_split = True
        layout.label(text="Defaults for a scene when its first field is made")
        layout.prop(self, "preset")
        layout.prop(self, "directory")


def apply_preferences(context: bpy.types.Context) -> None:
    """Apply the preferences to a scene whose settings have not been changed.

    Raises
    ------
    RosyError
        If the preset cannot be read.
    """
    settings, addon = context.scene.rosy, context.preferences.addons.get(EXTENSION_ID)
    if addon is None:
        return
    preferences = addon.preferences
    has_default_look = not any(settings.look.is_property_set(name) for name in settings_of(Look))
    if preferences.preset and has_default_look:
        preset_library.apply_preset(settings, preferences.preset)
    if preferences.directory and not settings.is_property_set("directory"):
        settings.directory = preferences.directory


CLASSES = (ROSY_AP_preferences,)
