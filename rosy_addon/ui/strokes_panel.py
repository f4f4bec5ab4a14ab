"""The panel with the settings of strokes."""

from bpy.types import Context, Panel, PropertyGroup, UILayout

from ..compositor.look import is_hatched
from ..core.settings import panel_settings, settings_of
from ..line_drawing.from_look import SETTINGS_OF_LOOK
from ..line_drawing.style import StrokeStyle
from ..scene.stroke_objects import stroke_objects
from . import job_status
from .operator_settings import draw_settings
from .sidebar import SidebarPanel, closed_panel, draw_progress, new_row, use_property_columns

#: Labels of the subpanels of strokes, with the names of their settings.
STROKE_PANELS = {
    "Density": panel_settings(StrokeStyle, "density"),
    "Ends": panel_settings(StrokeStyle, "ends"),
    "Singularities": panel_settings(StrokeStyle, "singularities"),
    "Inks": ("inks", "ink_color", "outline_color"),
}


#: Settings that strokes take from the look if *From Look* is on.
OF_LOOK = {*SETTINGS_OF_LOOK, "ink_color", "outline_color"}


class VIEW3D_PT_rosy_strokes(SidebarPanel, Panel):
    """Draw lines along the field, as scene objects or as a file."""

    bl_label = "Strokes"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context: Context) -> None:
        layout = self.layout
        use_property_columns(layout)
        settings = context.scene.rosy.strokes
        column = layout.column()
        draw_settings(column, settings, "kind", "camera", "selected")
        if settings.kind == "CURVES":
            column.prop(settings, "follow")
        column.separator()
        draw_settings(column, settings, "from_look", "hidden")
        if not (settings.from_look and is_hatched(context.scene.rosy.look)):
            spacing = "spacing" if settings.unit == "pixels" else "distance"
            draw_settings(column, settings, "unit", spacing, "width")
        if not settings.from_look:
            draw_settings(column, settings, "outline")
        for title, names in STROKE_PANELS.items():
            if settings.from_look:
                names = tuple(name for name in names if name not in OF_LOOK)
            if not names or (title == "Singularities" and settings.kind != "FILE"):
                continue
            body = closed_panel(layout, f"strokes_{title.lower()}", title)
            if body is not None:
                _draw_properties(body, settings, names)
        if settings.kind == "FILE":
            _draw_properties(layout, settings, ("page", "paper", "plotter"))
        if job_status.current is not None:
            draw_progress(layout)
            return
        objects = stroke_objects(context.scene)
        new_row(layout, scale_y=1.5).operator(
            "rosy.strokes",
            text="Draw Strokes..." if settings.kind == "FILE" else "Draw Strokes",
            icon="GREASEPENCIL",
        )
        if objects:
            layout.operator("rosy.strokes_remove", icon="TRASH")
            for obj in objects:
                name = "CURVES" if obj.type == "CURVES" else "GREASEPENCIL"
                layout.label(text=obj.name, icon=f"OUTLINER_OB_{name}")


def _draw_properties(layout: UILayout, settings: PropertyGroup, names: tuple[str, ...]) -> None:
    column = layout.column()
    descriptions = settings_of(StrokeStyle)
    active = {
        "outline_color": settings.inks != "ONE" and settings.outline,
        "ink_color": settings.inks == "ONE",
        "paper": not settings.plotter,
    }
    for name in names:
        is_style = name in descriptions
        applies = descriptions[name].applies(settings) if is_style else active.get(name, True)
        new_row(column, active=applies).prop(settings, name)


CLASSES = (VIEW3D_PT_rosy_strokes,)
