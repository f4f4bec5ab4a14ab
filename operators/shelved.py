"""What operators on presets share: which one they are about, and whether there is one."""

from __future__ import annotations

from typing import Any

import bpy

from ..rosy_addon.ui import shelf

#: Properties of operators that are about one preset.
ANY_PRESET = {
    "name": "Preset",
    "description": "What the preset is called by; empty: the one whose look the scene has",
}


def preset_of(operator: Any, context: bpy.types.Context) -> str:
    """What the preset is called by that an operator is about."""
    return operator.preset or context.scene.rosy.preset_name


def has_own(operator: type[bpy.types.Operator]) -> bool:
    """Whether the user has presets; says so if not."""
    if not shelf.own_names():
        operator.poll_message_set("You have no presets of your own yet: save one first")
        return False
    return True
