"""What the user can do, one verb a file."""

from __future__ import annotations

import bpy

from ..rosy_addon import live
from ..rosy_addon.ui import overlay
from . import (
    bake,
    bake_animation,
    field_convert,
    field_export,
    field_generate,
    field_import,
    occlusion,
    preset_apply,
    preset_export,
    preset_import,
    preset_remove,
    preset_rename,
    preset_save,
    remove,
    show,
    singularities,
    strokes,
    ticking,
    turntable,
    viewport,
)

MODULES = (
    field_generate,
    field_convert,
    field_import,
    field_export,
    singularities,
    strokes,
    occlusion,
    bake,
    bake_animation,
    turntable,
    viewport,
    show,
    remove,
    preset_apply,
    preset_save,
    preset_rename,
    preset_remove,
    preset_import,
    preset_export,
)


def register() -> None:
    """Add the operators to Blender."""
    for module in MODULES:
        for cls in module.CLASSES:
            bpy.utils.register_class(cls)


def unregister() -> None:
    """Take them away again, ending work under way."""
    ticking.stop_running()
    overlay.hide()
    live.stop()
    for module in reversed(MODULES):
        for cls in reversed(module.CLASSES):
            bpy.utils.unregister_class(cls)
