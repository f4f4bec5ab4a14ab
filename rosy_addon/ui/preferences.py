"""Preferences of the extension: what new scenes start from."""

from __future__ import annotations

import bpy

from ..compositor.presets import preset_names

#: The extension's own name in Blender: this file is two packages below it.
EXTENSION = __package__.rsplit(".", 2)[0]


class ROSY_AP_preferences(bpy.types.AddonPreferences):
    """What RoSy does in every file."""

    bl_idname = EXTENSION

    preset: bpy.props.StringProperty(
        name="Default Preset",
        description="Look that a scene starts from when its first field is made; empty: RoSy's own",
        search=lambda self, context, typed: preset_names(),
        search_options={"SUGGESTION"},
    )

    def draw(self, context: bpy.types.Context) -> None:
        layout = self.layout
        layout.use_property_split = True
        layout.prop(self, "preset")


CLASSES = (ROSY_AP_preferences,)
