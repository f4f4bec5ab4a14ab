"""Register the user interface with Blender."""

from __future__ import annotations

import bpy

from . import (
    job_status,
    live_views,
    look_panels,
    main_panel,
    overlay,
    preferences,
    preset_library,
    properties,
    strokes_panel,
)

#: Modules whose classes (their `CLASSES`) are registered. Panels are shown in this order.
MODULES = (preferences, main_panel, look_panels, strokes_panel)


def register() -> None:
    """Add properties, panels and preferences to Blender."""
    preset_library.register()
    properties.register()
    for module in MODULES:
        for cls in module.CLASSES:
            bpy.utils.register_class(cls)
    bpy.types.VIEW3D_PT_overlay.append(main_panel.draw_overlay_popover)
    live_views.register()


def unregister() -> None:
    """Remove properties, panels and preferences, and clear the state of the modules of this subpackage."""
    live_views.unregister()
    bpy.types.VIEW3D_PT_overlay.remove(main_panel.draw_overlay_popover)
    main_panel.unregister()
    for module in reversed(MODULES):
        for cls in reversed(module.CLASSES):
            bpy.utils.unregister_class(cls)
    properties.unregister()
    preset_library.unregister()
    overlay.hide()
    job_status.unregister()
