"""What the user sees: properties, the sidebar, preferences."""

from __future__ import annotations

import bpy

from . import panels, preferences, properties, shelf

MODULES = (preferences, panels)


def register() -> None:
    """Add properties, panels and preferences to Blender."""
    shelf.register()
    properties.register()
    for module in MODULES:
        for cls in module.CLASSES:
            bpy.utils.register_class(cls)
    bpy.types.VIEW3D_PT_overlay.append(panels.draw_in_overlays)


def unregister() -> None:
    """Take them away again."""
    bpy.types.VIEW3D_PT_overlay.remove(panels.draw_in_overlays)
    for module in reversed(MODULES):
        for cls in reversed(module.CLASSES):
            bpy.utils.unregister_class(cls)
    properties.unregister()
    shelf.unregister()
