"""What operators on presets share: which one they are about, and whether there is one."""

from __future__ import annotations

from typing import Any

import bpy

from ..rosy_addon.compositor.presets import LONGEST_DESCRIPTION
from ..rosy_addon.ui import shelf

#: Properties of operators that are about one preset.
ANY_PRESET = {
    "name": "Preset",
    "description": "What the preset is called by; empty: the one whose look the scene has",
}


#: Property of operators that ask for a preset's sentence.
SENTENCE = {
    "name": "Sentence",
    "description": "What the look is like, or what it is for",
    "maxlen": LONGEST_DESCRIPTION,
}


def draw_name(layout: bpy.types.UILayout, operator: Any) -> None:
    """What a preset is to be called, and its sentence."""
    layout.use_property_split = True
    layout.prop(operator, "name")
    layout.prop(operator, "sentence")


def preset_of(operator: Any, context: bpy.types.Context) -> str:
    """What the preset is called by that an operator is about."""
    return operator.preset or context.scene.rosy.preset_name


def has_own(operator: type[bpy.types.Operator]) -> bool:
    """Whether the user has presets; says so if not."""
    if not shelf.own_names():
        operator.poll_message_set("You have no presets of your own yet: save one first")
        return False
    return True
