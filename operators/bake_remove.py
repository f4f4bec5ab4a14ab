"""Operator: remove the baked pictures."""

from __future__ import annotations

import bpy

from ..rosy_addon.errors import counted
from ..rosy_addon.scene.bake_records import has_pictures, remove_bakes
from .poll import poll_idle


class ROSY_OT_remove(bpy.types.Operator):
    """Remove the pictures of this scene, and the modifiers and materials that show them. Fields are kept"""

    bl_idname = "rosy.remove"
    bl_label = "Remove Pictures"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        if not poll_idle(cls):
            return False
        if not has_pictures(context.scene):
            cls.poll_message_set("This scene has no baked pictures")
            return False
        return True

    def execute(self, context: bpy.types.Context) -> set[str]:
        removed = remove_bakes(context.scene)
        self.report(
            {"INFO"},
            f"Removed {counted(removed.images, 'picture')} from "
            f"{counted(removed.objects, 'object')}",
        )
        return {"FINISHED"}


CLASSES = (ROSY_OT_remove,)
