"""Operators: show another of the baked pictures on the objects, or the pictures in a 3D view."""

from __future__ import annotations

import bpy

from ..rosy_addon.errors import RosyError
from ..rosy_addon.scene.pictures import show_bake
from ..rosy_addon.ui.main_panel import SHADING_WITHOUT_MATERIALS
from ..rosy_addon.viewport import session
from .poll import poll_idle, poll_view_3d
from .reports import report_error


class ROSY_OT_show(bpy.types.Operator):
    """Show the picture that was baked from this camera on the meshes"""

    bl_idname = "rosy.show"
    bl_label = "Show Picture"
    bl_options = {"REGISTER", "UNDO"}

    camera: bpy.props.StringProperty(name="Camera", description="Name of the camera")

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return poll_idle(cls)

    def execute(self, context: bpy.types.Context) -> set[str]:
        try:
            show_bake(context.scene, self.camera)
        except RosyError as error:
            return report_error(self, error)
        return {"FINISHED"}


class ROSY_OT_show_here(bpy.types.Operator):
    """Show the baked pictures in this 3D view: with materials, and without the live fields over them"""

    bl_idname = "rosy.show_here"
    bl_label = "Show the Picture Here"
    bl_options = {"REGISTER"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return poll_view_3d(cls, context)

    def execute(self, context: bpy.types.Context) -> set[str]:
        space = context.space_data
        session.stop(space)
        if space.shading.type in SHADING_WITHOUT_MATERIALS:
            space.shading.type = "MATERIAL"
        return {"FINISHED"}


CLASSES = (ROSY_OT_show, ROSY_OT_show_here)
