"""Helpers that operators on presets share: properties, poll function, the target preset."""

from __future__ import annotations

from typing import Any

import bpy

from ..rosy_addon.preset_files.store import MAX_DESCRIPTION_LENGTH
from ..rosy_addon.ui import preset_library

#: Arguments of the property that selects a preset.
PRESET_ARGUMENTS = {
    "name": "Preset",
    "description": "Name of the preset. Empty: the active preset of the scene",
}

#: Arguments of the property for the description of a preset.
DESCRIPTION_ARGUMENTS = {
    "name": "Description",
    "description": "What the look is like, or what it is for",
    "maxlen": MAX_DESCRIPTION_LENGTH,
}


def draw_name_and_description(layout: bpy.types.UILayout, operator: Any) -> None:
    """Draw the name and description of a preset in an operator's dialog."""
    layout.use_property_split = True
    layout.prop(operator, "name")
    layout.prop(operator, "sentence")


def target_preset(operator: Any, context: bpy.types.Context) -> str:
    """Return the key of the preset that an operator acts on; by default the scene's."""
    return operator.preset or context.scene.rosy.preset_name


def poll_user_presets(operator: type[bpy.types.Operator]) -> bool:
    """Return whether the user has presets. Set the poll message if not."""
    if not preset_library.user_preset_keys():
        operator.poll_message_set("You have no presets yet: save one first")
        return False
    return True
