"""Operators: switch the live view of fields on or off in a 3D view, and let its streaks drift."""

from __future__ import annotations

from bpy.types import Context, Operator

from ..rosy_addon.compositor.look import has_flow
from ..rosy_addon.ui import live_views
from ..rosy_addon.ui.property_makers import choice
from ..rosy_addon.viewport import session
from .base import IN_3D_VIEW, Condition, RosyOperator


class ROSY_OT_viewport(RosyOperator, Operator):
    """Draw the fields of all meshes in this 3D view at every redraw, without baking"""

    bl_label = "Live Fields"
    bl_options = {"REGISTER"}
    conditions = (IN_3D_VIEW,)

    show: choice(
        "Show",
        "Whether this view draws the fields",
        [
            ("TOGGLE", "Toggle", "Switch on or off"),
            ("ON", "On", "Draw the fields in this view"),
            ("OFF", "Off", "Do not draw the fields in this view"),
        ],
    )

    device: choice(
        "Device",
        "Device that draws the fields",
        [
            (
                "AUTO",
                "Graphics Card",
                "The graphics card, or the processor if the card cannot be used",
            ),
            ("CPU", "Processor", "The processor, at reduced size"),
        ],
    )

    def act(self, context: Context) -> None:
        space = context.space_data
        if self.show == "ON" or (self.show == "TOGGLE" and not session.is_live(space)):
            session.start(space, self.device.lower())
        else:
            session.stop(space)
            live_views.decline(context.scene)


class ROSY_OT_flow_play(RosyOperator, Operator):
    """Let the streaks in live views drift, or stop them, without Blender's timeline"""

    bl_label = "Play Flow"
    bl_options = {"REGISTER"}
    conditions = (
        IN_3D_VIEW,
        Condition(lambda context: session.is_live(context.space_data), "Make this view live first"),
        Condition(
            lambda context: has_flow(context.scene.rosy.look),
            "These streaks do not drift: set Flow, under Streaks",
        ),
    )

    def act(self, context: Context) -> None:
        session.play_flow(not session.is_flow_playing())
