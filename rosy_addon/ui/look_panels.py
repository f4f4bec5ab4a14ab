"""The panels of the look of pictures: presets, settings of the look, output, and the legend."""

from pathlib import Path
from typing import Any

from bpy.types import Context, Menu, Object, Panel, PropertyGroup, UILayout

from ..compositor.look import Look, colors_magnitude, colors_values, is_hatched
from ..compositor.picture_key import fixed_color_range
from ..core.errors import as_sentence
from ..core.settings import Numbers, Setting, Switch, panel_settings, settings_of, title
from . import preset_library, sidebar
from .operator_settings import draw_settings
from .translations import translated

#: Keys of the panels with settings of a look, from top to bottom. Settings refer to panels by these keys.
LOOK_PANELS = ("streaks", "color", "light", "tone", "ink", "singularities", "quality")

#: Properties of `Scene.rosy` that determine how the picture is made and shown, and how it is stored.
OUTPUT_SETTINGS = (
    *("percentage", "device", "placement", "relight", "over_material"),
    *("emission", "diffuse", "backdrop"),
)
STORAGE_SETTINGS = "store", "directory", "image_format"

#: Height of the picture of a preset, in the panel and in the pop-up to choose one, in units of Blender's
#: layout. At a resolution scale of 1, it is 128 screen pixels: half the size of the picture.
THUMBNAIL_SCALE = 6.4

#: Number of characters of a label that fit into the column of labels, in a sidebar of default width. If a
#: label is longer, the column gets this fraction of the width.
MAX_LABEL_LENGTH, LONG_LABEL_FACTOR = 15, 0.49

#: Properties of the scene and of objects that are used for only one source of the tone, with that source.
TONE_SOURCE_OF_SETTING = {
    "tone_attribute": "attribute",
    "tone_image": "image",
    "tone_uv_map": "image",
    "tone_picture": "picture",
}

#: Switches of the parts of a key (legend), and the names of the settings of each part.
KEY_PARTS = {"key_bar": ("key_title",), "key_legend": ("key_counts",), "key_scale": ()}

#: Properties that hold the name of an attribute or UV map of the active mesh, and the collection of the mesh
#: in which the name is looked up.
SEARCH_COLLECTIONS = {
    "color_attribute": "attributes",
    "tone_attribute": "attributes",
    "tone_uv_map": "uv_layers",
}


class VIEW3D_PT_rosy_look(sidebar.SidebarPanel, Panel):
    """How fields are drawn."""

    bl_label = "Look"
    bl_parent_id = "VIEW3D_PT_rosy"

    def draw(self, context: Context) -> None:
        settings = context.scene.rosy
        column = self.layout.column(align=True)
        column.template_icon_view(
            settings, "preset", show_labels=True, scale=THUMBNAIL_SCALE, scale_popup=THUMBNAIL_SCALE
        )
        entry = preset_library.active_entry(settings)
        row = column.row(align=True)
        if entry is None:
            row.label(
                text=translated("{name}: not found").format(name=Path(settings.preset_name).stem)
            )
        else:
            changed = preset_library.is_changed(settings)
            text = translated("{name}, changed") if changed else "{name}"
            row.label(text=text.format(name=translated(entry.preset.name)))
        row.operator("rosy.preset_save", text="", icon="ADD")
        row.menu("VIEW3D_MT_rosy_presets", text="", icon="DOWNARROW_HLT")
        if entry is not None:
            lines = column.column(align=True)
            lines.scale_y, lines.active = 0.8, False
            for line in sidebar.wrap_to_sidebar(translated(entry.preset.description), context):
                lines.label(text=line)


class VIEW3D_MT_rosy_presets(Menu):
    """Commands for presets."""

    bl_label = "Presets"

    def draw(self, context: Context) -> None:
        layout, settings = self.layout, context.scene.rosy
        entry = preset_library.active_entry(settings)
        is_changed = entry is not None and preset_library.is_changed(settings)
        row = sidebar.new_row(layout, enabled=is_changed)
        button = row.operator("rosy.preset_apply", text="Reset to Preset", icon="LOOP_BACK")
        button.preset = settings.preset_name
        layout.separator()
        layout.operator("rosy.preset_save", text="Save Look as Preset...", icon="ADD")
        column = layout.column()
        column.enabled = entry is not None and entry.is_user
        column.operator("rosy.preset_rename", text="Rename...", icon="GREASEPENCIL")
        column.operator("rosy.preset_remove", text="Delete...", icon="TRASH")
        layout.separator()
        layout.operator("rosy.preset_import", text="Import...", icon="IMPORT")
        row = sidebar.new_row(layout, enabled=entry is not None)
        row.operator("rosy.preset_export", text="Export...", icon="EXPORT")
        for error in preset_library.load_errors():
            layout.label(text=as_sentence(error), icon="ERROR")


def _make_settings_panel(
    label: str, parent: str, suffix: str, look_names: tuple[str, ...], names: tuple[str, ...] = ()
) -> type:
    """Return the class of a subpanel with settings. It is closed by default.

    Parameters
    ----------
    label : str
        Title of the panel.
    parent : str
        Class name of the panel that contains it.
    suffix : str
        End of the class name, after ``VIEW3D_PT_rosy_``.
    look_names : tuple of str
        Names of settings of the look, shown first.
    names : tuple of str
        Names of properties of `Scene.rosy`, shown below them.
    """

    def draw(self, context: Context) -> None:
        layout = self.layout
        sidebar.use_property_columns(layout)
        column = layout.column()
        settings = context.scene.rosy
        for name in look_names:
            setting = settings_of(Look)[name]
            part = column.column()
            part.active = setting.applies(settings.look)
            _draw_setting(part, settings.look, setting)
            if name == "hue" and settings.look.hue == "values":
                _draw_name(column.row(), settings, "color_attribute", _active_mesh_object(context))
            if name == "light":
                row = sidebar.new_row(column, active=settings.look.light == "scene")
                row.prop(settings, "exposure")
            if name == "tone":
                _draw_tone_source(column, context)
        unused = _unused_output(settings)
        for name in names:
            sidebar.new_row(column, active=name not in unused).prop(settings, name)
            if name == "relight" and name not in unused and settings.relight:
                sidebar.draw_cycles_hint(column, context)
        if "tone" in look_names:
            column.operator("rosy.occlusion", icon="SHADING_RENDERED")

    namespace = {
        "__doc__": f"{label}: settings of the picture.",
        "bl_label": label,
        "bl_parent_id": parent,
        "bl_options": {"DEFAULT_CLOSED"},
        "draw": draw,
    }
    return type(f"VIEW3D_PT_rosy_{suffix}", (sidebar.SidebarPanel, Panel), namespace)


def _unused_output(settings: PropertyGroup) -> tuple[str, ...]:
    """Return the names of properties of the output that have no effect with the present settings."""
    if not is_hatched(settings.look):
        return "backdrop", "relight", "over_material"
    return ("device", "emission", "diffuse") if settings.relight else ()


def _draw_setting(column: UILayout, look: PropertyGroup, setting: Setting) -> None:
    """Draw a property of the look. If its label is long, give the label more room."""
    if isinstance(setting, Numbers):
        for index, part in enumerate(setting.parts):
            column.prop(look, setting.name, index=index, text=part)
        return
    label = translated(setting.panel_label or setting.label)
    if len(label) <= MAX_LABEL_LENGTH or isinstance(setting, Switch):
        column.prop(look, setting.name, text=label)
        return
    split = column.split(factor=LONG_LABEL_FACTOR)
    sidebar.new_row(split, alignment="RIGHT").label(text=label)
    split.use_property_split = False
    split.prop(look, setting.name, text="")


def _active_mesh_object(context: Context) -> Object | None:
    """Return the active object if it is a mesh, and None otherwise."""
    obj = context.view_layer.objects.active
    return obj if obj is not None and obj.type == "MESH" else None


def _draw_name(row: UILayout, owner: Any, name: str, mesh_object: Object | None) -> None:
    """Draw a text property.

    If it names an attribute or UV map (see `SEARCH_COLLECTIONS`), and there is a mesh, its text box suggests
    the names of the attributes or UV maps of the mesh.
    """
    if name in SEARCH_COLLECTIONS and mesh_object is not None:
        row.prop_search(owner, name, mesh_object.data, SEARCH_COLLECTIONS[name])
    else:
        row.prop(owner, name)


def _draw_tone_source(column: UILayout, context: Context) -> None:
    """Draw the properties of the scene and of the active object that set the source of the tone."""
    settings, mesh_object = context.scene.rosy, _active_mesh_object(context)
    for name, source in TONE_SOURCE_OF_SETTING.items():
        owner = settings if hasattr(settings, name) else getattr(mesh_object, "rosy", None)
        if owner is None:
            continue
        row = sidebar.new_row(column, active=settings.look.tone == source)
        if name == "tone_image":
            row.template_ID(owner, name, open="image.open", text="Image")
        else:
            _draw_name(row, owner, name, mesh_object)


class VIEW3D_PT_rosy_look_key(sidebar.SidebarPanel, Panel):
    """The key (legend) that explains a picture in renders."""

    bl_label = "Legend"
    bl_parent_id = "VIEW3D_PT_rosy_look"
    bl_options = {"DEFAULT_CLOSED"}

    def draw_header(self, context: Context) -> None:
        self.layout.prop(context.scene.rosy, "key", text="")

    def draw(self, context: Context) -> None:
        layout, settings = self.layout, context.scene.rosy
        sidebar.use_property_columns(layout)
        layout.active = settings.key
        column = layout.column()
        for part, names in KEY_PARTS.items():
            column.prop(settings, part)
            for name in names:
                sidebar.new_row(column, active=getattr(settings, part)).prop(settings, name)
        draw_settings(column, settings, "key_caption", "key_size")
        if settings.key and settings.key_bar and _range_may_differ(settings):
            hint = translated("For numbers on the color bar of animations, set Color > Top Value")
            sidebar.draw_wrapped(layout, context, [hint])


def _range_may_differ(settings: PropertyGroup) -> bool:
    """Return whether the frames of a baked animation may have different ranges of the color map.

    `settings` is the `Scene.rosy` of the scene with the animation.
    """
    look = settings.look
    is_animated = any(record.frames for record in settings.bakes)
    has_colors = colors_magnitude(look) or colors_values(look)
    return is_animated and has_colors and fixed_color_range(look) is None


CLASSES = (
    VIEW3D_MT_rosy_presets,
    VIEW3D_PT_rosy_look,
    *(
        _make_settings_panel(
            title(key), "VIEW3D_PT_rosy_look", f"look_{key}", panel_settings(Look, key)
        )
        for key in LOOK_PANELS
    ),
    _make_settings_panel(
        "Output", "VIEW3D_PT_rosy", "output", (), OUTPUT_SETTINGS + STORAGE_SETTINGS
    ),
    _make_settings_panel(
        "Advanced", "VIEW3D_PT_rosy", "advanced", panel_settings(Look, ""), ("undefined",)
    ),
    VIEW3D_PT_rosy_look_key,
)
