"""The panel of the key: what explains a picture in renders."""

from __future__ import annotations

import bpy

from ..compositor.look import colors_magnitude, colors_values
from ..compositor.picture_key import fixed_color_range
from .sidebar import SidebarPanel, draw_wrapped, use_property_columns

#: The parts of a key, and the settings of each.
PARTS = {"key_bar": ("key_title",), "key_legend": ("key_counts",), "key_scale": ()}


class VIEW3D_PT_rosy_look_key(SidebarPanel, bpy.types.Panel):
    """What explains a picture in renders."""

    bl_label = "Key"
    bl_parent_id = "VIEW3D_PT_rosy_look"
    bl_options = {"DEFAULT_CLOSED"}

    def draw_header(self, context: bpy.types.Context) -> None:
        self.layout.prop(context.scene.rosy, "key", text="")

    def draw(self, context: bpy.types.Context) -> None:
        layout, settings = self.layout, context.scene.rosy
        use_property_columns(layout)
        layout.active = settings.key
        column = layout.column()
        for part, names in PARTS.items():
            column.prop(settings, part)
            for name in names:
                row = column.row()
                row.active = getattr(settings, part)
                row.prop(settings, name)
        column.prop(settings, "key_caption")
        column.prop(settings, "key_size")
        if settings.key and settings.key_bar and _range_may_differ(settings):
            draw_wrapped(
                layout,
                context,
                ["For numbers on the color bar of animations, set Color > Top Value"],
            )


def _range_may_differ(settings: bpy.types.PropertyGroup) -> bool:
    """Whether a scene has an animation whose frames may have ranges of their own."""
    look = settings.look
    is_animated = any(record.frames for record in settings.bakes)
    has_colors = colors_magnitude(look) or colors_values(look)
    return is_animated and has_colors and fixed_color_range(look) is None


CLASSES = (VIEW3D_PT_rosy_look_key,)
