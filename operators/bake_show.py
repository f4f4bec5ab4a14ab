"""Operator: show another of the baked pictures on the objects."""

from __future__ import annotations

import bpy

from ..rosy_addon.errors import RosyError
from ..rosy_addon.scene.pictures import show_bake
from .poll import poll_idle
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


CLASSES = (ROSY_OT_show,)
