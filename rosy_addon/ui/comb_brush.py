"""The tool *Comb Field* of the 3D view: its cursor and its settings."""

from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
from bpy.types import Context, UILayout, WorkSpaceTool
from gpu_extras.presets import draw_circle_2d

from ..core.errors import RosyError
from ..scene.field_attributes import has_field
from ..viewport import session
from ..viewport.brush_mouse import current_mouse
from .view_lines import draw_lines, to_pixels

#: Color of the cursor, and colors of dashes on faces without and with a guide that the field follows firmly.
CURSOR_COLOR = (1.0, 1.0, 1.0, 0.8)
FREE_COLOR, GUIDED_COLOR = (0.85, 0.85, 0.85, 0.9), (1.0, 0.55, 0.15, 1.0)

#: Width of the dashes in pixels.
DASH_WIDTH = 1.5


def draw_settings(layout: UILayout, settings: Any) -> None:
    """Draw the settings that the operator and the tool have in common, in a panel."""
    for name in ("exact", "reach", "front_faces"):
        layout.prop(settings, name)
    layout.row(heading="Mirror").prop(settings, "mirror", toggle=True, text="")


def key_press(
    operator: str, *modifiers: str, key: str = "LEFTMOUSE", **properties: Any
) -> tuple[str, dict[str, Any], dict[str, Any]]:
    """Return an entry for the keymap of a tool: a key that calls an operator.

    Parameters
    ----------
    operator : str
        Name of the operator.
    *modifiers : {"ctrl", "shift"}
        Keys that are held.
    key : str
        Blender's name of the key or mouse button.
    **properties
        Properties of the operator.
    """
    event = {"type": key, "value": "PRESS"} | dict.fromkeys(modifiers, True)
    return operator, event, {"properties": list(properties.items())}


class CombTool:
    """Base class of the tools for Object Mode and Sculpt Mode: Blender needs one class for each mode."""

    bl_space_type = "VIEW_3D"
    bl_label = "Comb Field"
    bl_description = (
        "Drag along the surface to turn the field.\nCtrl: erase guides. Shift: smooth them. F, Shift F: radius and "
        "strength"
    )
    bl_icon = str(Path(__file__).parent / "icons" / "comb")  # Blender adds .dat
    bl_keymap = (
        key_press("rosy.field_comb"),
        key_press("rosy.field_comb", "ctrl", effect="ERASE"),
        key_press("rosy.field_comb", "shift", effect="SMOOTH"),
        key_press("wm.radial_control", key="F", data_path_primary="scene.rosy.comb.size"),
        key_press(
            "wm.radial_control", "shift", key="F", data_path_primary="scene.rosy.comb.strength"
        ),
    )

    # Blender calls both functions without an instance, so they are static.
    @staticmethod
    def draw_settings(context: Context, layout: UILayout, tool: WorkSpaceTool) -> None:
        comb = context.scene.rosy.comb
        layout.prop(comb, "size")
        layout.prop(comb, "strength", slider=True)
        draw_settings(layout, tool.operator_properties("rosy.field_comb"))

    @staticmethod
    def draw_cursor(context: Context, tool: WorkSpaceTool, mouse: tuple[int, int]) -> None:
        """Draw the circle of the brush. If the view is not live, also draw the field around it as dashes."""
        comb = context.scene.rosy.comb
        draw_circle_2d(mouse, CURSOR_COLOR, comb.size, segments=64)
        obj, region = context.view_layer.objects.active, context.region
        if obj is None or not has_field(obj) or session.is_live(context.space_data):
            return
        with suppress(RosyError):  # the operator reports the error when the user combs
            brush = current_mouse(context, obj)
            place = brush.place((mouse[0] - region.x, mouse[1] - region.y))
            if place is not None:
                ends, is_guided = brush.dashes(place, 1.5 * brush.radius(place, comb.size))
                ends = to_pixels(region, context.region_data, ends) + (region.x, region.y)
                in_view = np.isfinite(ends).all(axis=(1, 2))
                width = DASH_WIDTH * context.preferences.system.ui_scale
                for chosen, color in ((~is_guided, FREE_COLOR), (is_guided, GUIDED_COLOR)):
                    draw_lines("LINES", ends[chosen & in_view].reshape(-1, 2), color, width)


class VIEW3D_TOOL_rosy_comb(CombTool, WorkSpaceTool):
    """Comb a field in Object Mode"""

    bl_context_mode = "OBJECT"
    bl_idname = "rosy.comb_tool"


class VIEW3D_TOOL_rosy_comb_sculpt(CombTool, WorkSpaceTool):
    """Comb a field in Sculpt Mode"""

    bl_context_mode = "SCULPT"
    bl_idname = "rosy.comb_sculpt_tool"
