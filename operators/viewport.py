"""Operator: switch the live view of fields on or off in a 3D view."""

from __future__ import annotations

import bpy

from ..rosy_addon.errors import RosyError
from ..rosy_addon.ui import live_views
from ..rosy_addon.viewport import session
from .poll import poll_view_3d
from .reports import report_error


class ROSY_OT_viewport(bpy.types.Operator):
    """Draw the fields of all meshes in this 3D view at every redraw, without baking"""

    bl_idname = "rosy.viewport"
    bl_label = "Live Fields"
    bl_options = {"REGISTER"}

    show: bpy.props.EnumProperty(
        name="Show",
        description="Whether this view draws the fields",
        items=[
            ("TOGGLE", "Toggle", "Switch on or off"),
            ("ON", "On", "Draw the fields in this view"),
            ("OFF", "Off", "Do not draw the fields in this view"),
        ],
    )

    device: bpy.props.EnumProperty(
        name="Device",
        description="Device that draws the fields",
        items=[
            (
                "AUTO",
                "Graphics Card",
                "The graphics card, or the processor if the card cannot be used",
            ),
            ("CPU", "Processor", "The processor, at reduced size"),
        ],
    )

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return poll_view_3d(cls, context)

    def execute(self, context: bpy.types.Context) -> set[str]:
        space = context.space_data
        enable = not session.is_live(space) if self.show == "TOGGLE" else self.show == "ON"
        if not enable:
            session.stop(space)
            live_views.decline(context.scene)
            return {"FINISHED"}
        try:
            session.start(space, self.device.lower())
        except RosyError as error:
            return report_error(self, error)
        return {"FINISHED"}


CLASSES = (ROSY_OT_viewport,)
