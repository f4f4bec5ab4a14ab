"""The installed extension: its modules and preferences, and how it is switched off and on."""

import importlib
from types import ModuleType

import bpy

EXTENSION = "bl_ext.user_default.rosy"


def rosy(name: str) -> ModuleType:
    """Return a module of the extension."""
    return importlib.import_module(f"{EXTENSION}.{name}")


def preferences() -> bpy.types.AddonPreferences:
    """Return the preferences of the extension."""
    return bpy.context.preferences.addons[EXTENSION].preferences


def switch_extension(on: bool) -> None:
    """Enable or disable the extension."""
    operators = bpy.ops.preferences
    (operators.addon_enable if on else operators.addon_disable)(module=EXTENSION)
