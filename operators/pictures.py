"""Operators: show another of the baked pictures, show them in a 3D view, and remove them."""

from __future__ import annotations

import bpy

from ..rosy_addon.core.errors import counted
from ..rosy_addon.scene.bake_records import has_pictures, remove_bakes
from ..rosy_addon.scene.pictures import show_bake
from ..rosy_addon.ui.main_panel import SHADING_WITHOUT_MATERIALS
from ..rosy_addon.ui.property_makers import text
from ..rosy_addon.viewport import session
from .base import IDLE, IN_3D_VIEW, Condition, RosyOperator


class ROSY_OT_show(RosyOperator, bpy.types.Operator):
    """Show the picture that was baked from this camera on the meshes"""

    bl_idname = "rosy.show"
    bl_label = "Show Picture"
    bl_options = {"REGISTER", "UNDO"}
    conditions = (IDLE,)

    camera: text("Camera", "Name of the camera")

    def act(self, context: bpy.types.Context) -> None:
        show_bake(context.scene, self.camera)


class ROSY_OT_show_here(RosyOperator, bpy.types.Operator):
    """Show the baked pictures in this 3D view: with materials, and without the live fields over them"""

    bl_idname = "rosy.show_here"
    bl_label = "Show the Picture Here"
    bl_options = {"REGISTER"}
    conditions = (IN_3D_VIEW,)

    def act(self, context: bpy.types.Context) -> None:
        space = context.space_data
        session.stop(space)
        if space.shading.type in SHADING_WITHOUT_MATERIALS:
            space.shading.type = "MATERIAL"


class ROSY_OT_remove(RosyOperator, bpy.types.Operator):
    """Remove the pictures of this scene, and the modifiers and materials that show them. Fields are kept"""

    bl_idname = "rosy.remove"
    bl_label = "Remove Pictures"
    bl_options = {"REGISTER", "UNDO"}
    conditions = (
        IDLE,
        Condition(lambda context: has_pictures(context.scene), "This scene has no baked pictures"),
    )

    def act(self, context: bpy.types.Context) -> None:
        removed = remove_bakes(context.scene)
        self.report_done(
            f"Removed {counted(removed.images, 'picture')} from "
            f"{counted(removed.objects, 'object')}"
        )
