"""Register the operators with Blender."""

from typing import Any

import bpy

from ..rosy_addon.ui.comb_brush import VIEW3D_TOOL_rosy_comb, VIEW3D_TOOL_rosy_comb_sculpt
from ..rosy_addon.ui.singularity_handles import VIEW3D_TOOL_rosy_singularities
from ..rosy_addon.viewport import brush_mouse, session
from . import (
    bake,
    bake_texture,
    field_comb,
    field_compare,
    field_convert,
    field_files,
    field_generate,
    modal_job,
    presets,
    singularities,
    strokes,
    turntable,
    viewport,
)

#: Blender's base classes. Classes that derive from one of them are registered.
REGISTRABLE = (bpy.types.Operator, bpy.types.PropertyGroup, bpy.types.FileHandler)

#: Modules with operators, in the order of registration.
MODULES = (
    field_generate,
    field_convert,
    field_files,
    singularities,
    field_comb,
    field_compare,
    strokes,
    bake,
    bake_texture,
    turntable,
    viewport,
    presets,
)


#: The classes of these modules to register, in the order of their definition. Mixins are not among them.
CLASSES = tuple(
    value
    for module in MODULES
    for value in vars(module).values()
    if isinstance(value, type)
    and issubclass(value, REGISTRABLE)
    and value.__module__ == module.__name__
)


_register_classes, _unregister_classes = bpy.utils.register_classes_factory(CLASSES)


#: The tools that call operators, with their places among Blender's.
TOOLS: dict[type, dict[str, Any]] = {
    VIEW3D_TOOL_rosy_comb: {"separator": True},
    VIEW3D_TOOL_rosy_singularities: {"after": {VIEW3D_TOOL_rosy_comb.bl_idname}},
    VIEW3D_TOOL_rosy_comb_sculpt: {"separator": True},
}


def register() -> None:
    """Register the operators and the tools that call them."""
    _register_classes()
    for tool, place in TOOLS.items():
        bpy.utils.register_tool(tool, **place)


def unregister() -> None:
    """Stop the current job and the live view, and unregister the tools and the operators."""
    modal_job.stop_current_job()
    session.stop()
    for tool in reversed(TOOLS):
        bpy.utils.unregister_tool(tool)
    brush_mouse.unregister()
    _unregister_classes()
