"""Operator: let streaks drift in live views, or stop them."""

from __future__ import annotations

import bpy

from ..rosy_addon.compositor.look import has_flow
from ..rosy_addon.viewport import session
from .poll import poll_view_3d


class ROSY_OT_flow_play(bpy.types.Operator):
    """Let the streaks in live views drift, or stop them, without Blender's timeline"""

    bl_idname = "rosy.flow_play"
    bl_label = "Play Flow"
    bl_options = {"REGISTER"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        if not poll_view_3d(cls, context):
            return False
        if not session.is_live(context.space_data):
            cls.poll_message_set("Make this view live first")
            return False
        if not has_flow(context.scene.rosy.look):
            cls.poll_message_set("These streaks do not drift: set Flow, under Streaks")
            return False
        return True

    def execute(self, context: bpy.types.Context) -> set[str]:
        session.play_flow(not session.is_flow_playing())
        return {"FINISHED"}


CLASSES = (ROSY_OT_flow_play,)
