"""Register the user interface with Blender."""

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
    translations,
)

#: Functions that register all classes but those of properties. Panels are shown in this order.
_register_classes, _unregister_classes = bpy.utils.register_classes_factory(
    (*preferences.CLASSES, *main_panel.CLASSES, *look_panels.CLASSES, *strokes_panel.CLASSES)
)


def register() -> None:
    """Add properties, panels and preferences to Blender."""
    translations.register()
    preset_library.register()
    properties.register()
    _register_classes()
    bpy.types.VIEW3D_PT_overlay.append(main_panel.draw_overlay_popover)
    live_views.register()


def unregister() -> None:
    """Remove properties, panels and preferences, and clear the state of the modules of this subpackage."""
    live_views.unregister()
    bpy.types.VIEW3D_PT_overlay.remove(main_panel.draw_overlay_popover)
    main_panel.unregister()
    _unregister_classes()
    properties.unregister()
    preset_library.unregister()
    translations.unregister()
    overlay.hide()
    job_status.unregister()
