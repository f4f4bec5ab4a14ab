"""The tab in the sidebar of the 3D view: from no field, to a field, to its picture."""

from __future__ import annotations

import textwrap
from dataclasses import fields
from pathlib import Path
from typing import Any

import bpy

from .. import live
from ..compositor.look import Look
from ..scene.apply import FAITHFUL, Bake, bakes
from ..scene.attributes import has_field
from ..scene.bodies import rosy_objects
from ..scene.strokes import stroke_objects
from . import overlay, shelf, status
from .generators import settings_of_generator

#: Settings of a look, in the groups in which a user looks for them.
GROUPS = {
    "Streaks": (
        "unit",
        "unit_size",
        "length",
        "step",
        "grain",
        "density",
        "gain",
        "high_pass",
        "foreshorten",
        "cross_creases",
        "crease_angle",
    ),
    "Colour": ("noise", "hue", "magnitude", "magnitude_range", "colour_map"),
    "Light": ("shading", "light", "shadows"),
    "Tone": (
        "tone",
        "tone_lit",
        "tone_black",
        "tone_white",
        "tone_gamma",
    ),
    "Ink": (
        "ink",
        "ink_colour",
        "ink_ramp",
        "ink_colour_light",
        "ink_middle",
        "ink_colour_middle",
        "paper_colour",
        "clear_paper",
        "crispness",
        "layers",
        "layering",
        "breaks",
        "overshoot",
        "wobble",
        "paper_grain",
        "outline",
    ),
    "Quality": ("supersampling", "display", "method", "anchor", "seed"),
}

#: The rest, which few will need: also whatever a look is given later and no group has taken up.
OTHERS = tuple(
    entry.name
    for entry in fields(Look)
    if not any(entry.name in names for names in GROUPS.values())
)

#: Settings of where the picture goes and how it shines there.
OUTPUT = (
    "percentage",
    "device",
    "placement",
    "emission",
    "diffuse",
    "store",
    "directory",
    "image_format",
)


#: Where a property's own name does not fit beside its value in a sidebar of usual width.
SHORT_NAMES = {
    "magnitude_range": "Top Value",
    "undefined": "Skip Bad Vectors",
    "tone_lit": "Light Falls on It",
    "tone_black": "Black",
    "tone_white": "White",
    "tone_gamma": "Gamma",
    "ink_ramp": "Second Colour",
    "ink_colour_light": "In the Lights",
    "ink_middle": "Third at Tone",
    "ink_colour_middle": "Third Colour",
    "unit_size": "Pixel Size",
}


#: What the ink goes over into.
INK_RAMP = {"ink_colour_light", "ink_middle", "ink_colour_middle"}


#: What magnitude may drive so that its colours take the place of others.
COLOURING = {"colour", "both"}


#: Height of the picture of a preset, in the panel and where one is chosen: 128 pixels, half of what
#: it has, if the screen's pixels are of usual size.
PICTURE = 6.4

#: Settings of where the tone comes from, and when they count.
TONE_SOURCES = {
    "tone_attribute": "attribute",
    "tone_image": "image",
    "tone_uv_map": "image",
    "tone_picture": "picture",
}

#: Settings of the scene and of objects that are shown below one of a look.
BELOW = {"tone": tuple(TONE_SOURCES)}

#: Names of something that the active mesh has.
CHOSEN_FROM = {"tone_attribute": "attributes", "tone_uv_map": "uv_layers"}

#: What an empty setting of the generator stands for.
IF_EMPTY = {"guide": "the selected", "uv_map": "the active", "vectors": "name"}


class _Sidebar:
    bl_space_type = "VIEW_3D"
    bl_region_type = "UI"
    bl_category = "RoSy"


class VIEW3D_PT_rosy(_Sidebar, bpy.types.Panel):
    """The way in: make a field, bake it, look at it."""

    bl_label = "RoSy"

    def draw(self, context: bpy.types.Context) -> None:
        layout = self.layout
        layout.use_property_split = True
        layout.use_property_decorate = False
        drawn = rosy_objects(context.view_layer)
        _draw_field(layout, context)
        layout.separator()
        _draw_picture(layout, context, drawn)


def _draw_field(layout: bpy.types.UILayout, context: bpy.types.Context) -> None:
    thing = context.view_layer.objects.active
    layout.label(text="1.  Field", icon="FORCE_VORTEX")
    if thing is None or thing.type != "MESH":
        layout.label(text="Select a mesh to draw on")
    elif has_field(thing):
        _draw_field_there(layout, context, thing)
    else:
        layout.label(text=f"{thing.name} has no field yet")
        _draw_generator(layout, context)
        layout.operator("rosy.field_import", text="Import a Field File...", icon="IMPORT")


def _draw_field_there(
    layout: bpy.types.UILayout, context: bpy.types.Context, thing: bpy.types.Object
) -> None:
    mesh = thing.data
    box = layout.box().column(align=True)
    box.label(text=thing.name, icon="OUTLINER_OB_MESH")
    box.label(text=f"Degree {mesh.rosy.degree} on {len(mesh.polygons):,} faces")
    own = mesh.rosy.attribute in mesh.attributes
    box.label(text=f"Attribute '{mesh.rosy.attribute}'" if own else "Attributes dir0, dir1 ...")
    box.prop(thing.rosy, "include")
    row = layout.row(align=True)
    row.operator("rosy.field_import", text="Import", icon="IMPORT")
    row.operator("rosy.field_export", text="Export", icon="EXPORT")
    shown = overlay.is_shown(thing.name)
    button = layout.operator(
        "rosy.singularities",
        text="Hide Singularities" if shown else "Show Singularities",
        icon="OVERLAY",
        depress=shown,
    )
    button.show = "NONE" if shown else "OVERLAY"
    header, body = layout.panel("rosy_convert_field", default_closed=True)
    header.label(text="Convert")
    if body is not None:
        _draw_converter(body, context)
    header, body = layout.panel("rosy_another_field", default_closed=True)
    header.label(text="Another Field")
    if body is not None:
        _draw_generator(body, context)


def _draw_converter(layout: bpy.types.UILayout, context: bpy.types.Context) -> None:
    """The settings that the next conversion will have, and its button; other forms to store it in."""
    settings = context.window_manager.operator_properties_last("rosy.field_convert")
    column = layout.column()
    for name in ("degree", "angle", "smooth", "magnitude"):
        column.prop(settings, name)
    if settings.magnitude == "values":
        column.prop(settings, "values")
    layout.operator("rosy.field_convert")
    layout.operator_menu_enum("rosy.field_store", "form", text="Store As")


def _draw_generator(layout: bpy.types.UILayout, context: bpy.types.Context) -> None:
    """The settings that the next run of the generator will have, and its button."""
    settings = context.window_manager.operator_properties_last("rosy.field_generate")
    column = layout.column()
    column.prop(settings, "kind")
    column.prop(settings, "degree")
    for name in settings_of_generator(settings):
        column.prop(settings, name, placeholder=IF_EMPTY.get(name, ""))
    row = layout.row()
    row.scale_y = 1.5
    row.operator("rosy.field_generate", icon="FORCE_VORTEX")
    if settings.kind == "curvature" and settings.degree % 2:
        row.enabled = False
        layout.label(text="Curvature: even degrees only", icon="ERROR")


def _draw_picture(
    layout: bpy.types.UILayout, context: bpy.types.Context, drawn: list[bpy.types.Object]
) -> None:
    """What is baked, and the button that bakes."""
    layout.label(text="2.  Picture", icon="RENDER_STILL")
    _draw_live(layout, context)
    if status.now is not None:
        _draw_progress(layout)
        return
    made = bakes(context.scene)
    for bake in made:
        _draw_bake(layout, bake, several=len(made) > 1)
    if drawn:
        layout.prop(context.scene.rosy, "camera")
        if len(drawn) > 1:
            layout.label(text=f"Draws {len(drawn)} objects")
    row = layout.row()
    row.scale_y = 1.5
    row.operator("rosy.bake", text="Bake Again" if made else "Bake", icon="RENDER_STILL")
    row = layout.row(align=True)
    row.operator("rosy.bake_animation", text="Animation", icon="RENDER_ANIMATION")
    row.operator("rosy.turntable", text="Turntable", icon="FILE_MOVIE")
    if not drawn:
        layout.label(text="Needs a field to draw", icon="INFO")
    if made:
        layout.operator("rosy.remove", icon="TRASH")
        _draw_how_to_see(layout, context, made)
    if drawn:
        _draw_view_transform(layout, context.scene)


def _draw_live(layout: bpy.types.UILayout, context: bpy.types.Context) -> None:
    on = live.is_live(context.space_data)
    button = layout.operator(
        "rosy.viewport", text="Live in This View", icon="HIDE_OFF" if on else "HIDE_ON", depress=on
    )
    button.show = "OFF" if on else "ON"


def draw_in_overlays(popover: bpy.types.Menu, context: bpy.types.Context) -> None:
    """The same switch among Blender's own, in the popover of overlays."""
    _draw_live(popover.layout, context)


def _draw_bake(layout: bpy.types.UILayout, bake: Bake, several: bool) -> None:
    box = layout.box().column(align=True)
    box.label(text=f"From {bake.camera}", icon="CAMERA_DATA")
    row = box.row()
    row.label(text=f"{bake.width} x {bake.height} pixels")
    if bake.frames:
        box.label(text=f"Frames {bake.frames}", icon="RENDER_ANIMATION")
    if several and bake.shown:
        row.label(text="Shown", icon="HIDE_OFF")
    elif several:
        row.operator("rosy.show", text="Show").camera = bake.camera
    if bake.stale:
        box.label(text="Out of date:", icon="ERROR")
        box.label(text=bake.stale)
    elif not bake.frames:
        box.label(text="Up to date", icon="CHECKMARK")


def _draw_progress(layout: bpy.types.UILayout) -> None:
    layout.progress(factor=status.now.fraction, text=status.now.label.capitalize())
    layout.label(text="Press ESC to cancel")


def _draw_how_to_see(
    layout: bpy.types.UILayout, context: bpy.types.Context, made: list[Bake]
) -> None:
    """A way to the picture from a view that does not show materials, or looks from elsewhere."""
    view, camera = context.space_data, context.scene.camera
    column = layout.column(align=True)
    if view.shading.type in {"WIREFRAME", "SOLID"}:
        column.label(text="This view shows no materials", icon="INFO")
        button = column.operator("wm.context_set_enum", text="Show the Picture Here")
        button.data_path, button.value = "space_data.shading.type", "MATERIAL"
    through_camera = view.region_3d is not None and view.region_3d.view_perspective == "CAMERA"
    if not through_camera and camera is not None and any(b.camera == camera.name for b in made):
        column.operator("view3d.view_camera", text="Look Through the Camera")


def _draw_view_transform(layout: bpy.types.UILayout, scene: bpy.types.Scene) -> None:
    """Say so where colour management would change the picture's tones."""
    transform = scene.view_settings.view_transform
    if transform not in FAITHFUL:
        column = layout.column(align=True)
        column.label(text=f"{transform} greys the lines", icon="ERROR")
        button = column.operator("wm.context_set_enum", text="View Transform: Standard")
        button.data_path, button.value = "scene.view_settings.view_transform", "Standard"


class VIEW3D_PT_rosy_look(_Sidebar, bpy.types.Panel):
    """How fields are drawn."""

    bl_label = "Look"
    bl_parent_id = "VIEW3D_PT_rosy"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context: bpy.types.Context) -> None:
        settings = context.scene.rosy
        column = self.layout.column(align=True)
        column.template_icon_view(
            settings, "preset", show_labels=True, scale=PICTURE, scale_popup=PICTURE
        )
        entry = shelf.chosen(settings)
        row = column.row(align=True)
        if entry is None:
            row.label(text=f"{Path(settings.preset_name).stem}: not here")
        else:
            changed = shelf.is_changed(settings)
            row.label(text=f"{entry.preset.name}, changed" if changed else entry.preset.name)
        row.operator("rosy.preset_save", text="", icon="ADD")
        row.menu("VIEW3D_MT_rosy_presets", text="", icon="DOWNARROW_HLT")
        if entry is not None:
            lines = column.column(align=True)
            lines.scale_y, lines.active = 0.8, False
            for line in _lines(entry.preset.description, context):
                lines.label(text=line)


class VIEW3D_MT_rosy_presets(bpy.types.Menu):
    """What can be done with presets."""

    bl_label = "Presets"

    def draw(self, context: bpy.types.Context) -> None:
        layout, settings = self.layout, context.scene.rosy
        entry = shelf.chosen(settings)
        row = layout.row()
        row.enabled = entry is not None and shelf.is_changed(settings)
        again = row.operator("rosy.preset_apply", text="Take the Look Again", icon="LOOP_BACK")
        again.preset = settings.preset_name
        layout.separator()
        layout.operator("rosy.preset_save", text="Save Look as Preset...", icon="ADD")
        column = layout.column()
        column.enabled = entry is not None and entry.own
        for verb, text, icon in (
            ("rename", "Rename...", "GREASEPENCIL"),
            ("remove", "Delete...", "TRASH"),
        ):
            operator = column.operator(f"rosy.preset_{verb}", text=text, icon=icon)
            operator.preset = settings.preset_name
        layout.separator()
        layout.operator("rosy.preset_import", text="Import...", icon="IMPORT")
        row = layout.row()
        row.enabled = entry is not None
        export = row.operator("rosy.preset_export", text="Export...", icon="EXPORT")
        export.preset = settings.preset_name
        for fault in shelf.faults():
            layout.label(text=fault, icon="ERROR")


def _lines(words: str, context: bpy.types.Context) -> list[str]:
    """A sentence in lines that fit into the sidebar."""
    letter = 6.5 * context.preferences.system.ui_scale  # pixels, of most letters
    return textwrap.wrap(words, max(int(context.region.width / letter) - 6, 12))


def _settings_panel(label: str, parent: str, group: str, names: tuple[str, ...]) -> type:
    """A closed panel inside another that lists settings of `Scene.rosy`, or of its look."""
    listed = [shown for name in names for shown in (name, *BELOW.get(name, ()))]

    def draw(self, context: bpy.types.Context) -> None:
        layout = self.layout
        layout.use_property_split = True
        layout.use_property_decorate = False
        column = layout.column()
        settings = context.scene.rosy
        for name in listed:
            inside = _holder(context, name)
            if inside is None:
                continue
            row = column.row()
            row.active = _matters(settings, name)
            _draw_setting(row, inside, name)
        if "tone" in names:
            column.operator("rosy.occlusion", icon="SHADING_RENDERED")

    members = {
        "__doc__": f"{label}: settings of the picture.",
        "bl_label": label,
        "bl_parent_id": parent,
        "bl_options": {"DEFAULT_CLOSED"},
        "draw": draw,
    }
    return type(f"VIEW3D_PT_rosy_{group}", (_Sidebar, bpy.types.Panel), members)


def _draw_setting(row: bpy.types.UILayout, holder: Any, name: str) -> None:
    mesh = getattr(bpy.context.view_layer.objects.active, "data", None)
    if name in CHOSEN_FROM and isinstance(mesh, bpy.types.Mesh):
        row.prop_search(holder, name, mesh, CHOSEN_FROM[name], text=SHORT_NAMES.get(name))
    elif name == "tone_image":
        row.template_ID(holder, name, open="image.open", text="Image")
    else:
        row.prop(holder, name, text=SHORT_NAMES.get(name))


def _holder(context: bpy.types.Context, name: str) -> Any:
    """What has a setting: the look, the scene, or the active mesh; None if there is no such mesh."""
    settings, thing = context.scene.rosy, context.view_layer.objects.active
    for holder in (settings.look, settings):
        if hasattr(holder, name):
            return holder
    return thing.rosy if thing is not None and thing.type == "MESH" else None


def _matters(settings: Any, name: str) -> bool:
    """Whether a setting makes a difference beside the others as they are."""
    look = settings.look
    if name in {"magnitude_range", "colour_map"}:
        return look.magnitude != "none" and (name, look.magnitude) != ("colour_map", "length")
    if name in {"weights", "view_plane"}:
        return look.method == "members"
    if name in {"light", "shadows"}:
        lit = look.shading > 0 and (look.tone == "light" or look.tone_lit)
        return lit and (name == "light" or look.light != "headlight")
    if name in TONE_SOURCES:
        return look.tone == TONE_SOURCES[name]
    if name == "tone_lit":
        return look.tone != "light"
    if name == "directory":
        return settings.store == "SAVED"
    if name in INK_RAMP and not look.ink_ramp:
        return False
    if name == "ink_colour_middle" and not look.ink_middle:
        return False
    if name in {"ink_colour", "ink_ramp", *INK_RAMP} and look.magnitude in COLOURING:
        return False
    if name in GROUPS["Ink"] and name != "ink":
        return look.ink == "hatch"
    if name == "crease_angle":
        return not look.cross_creases
    if name == "unit_size":
        return look.unit != "pixels"
    return True


class VIEW3D_PT_rosy_strokes(_Sidebar, bpy.types.Panel):
    """Lines along the field, as objects of the scene or as a file."""

    bl_label = "Strokes"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context: bpy.types.Context) -> None:
        layout = self.layout
        layout.use_property_split = True
        layout.use_property_decorate = False
        settings = context.scene.rosy.strokes
        column = layout.column()
        column.prop(settings, "kind")
        column.prop(settings, "camera")
        column.prop(settings, "selected")
        column.separator()
        column.prop(settings, "unit")
        column.prop(settings, "spacing" if settings.unit == "pixels" else "distance")
        column.prop(settings, "width")
        column.prop(settings, "outline")
        column.prop(settings, "hidden")
        for title, names in STROKE_GROUPS.items():
            header, body = layout.panel(f"rosy_strokes_{title.lower()}", default_closed=True)
            header.label(text=title)
            if body is not None:
                _draw_stroke_settings(body, settings, names)
        if settings.kind == "SVG":
            _draw_stroke_settings(layout, settings, ("filepath", "page", "paper", "plotter"))
        if status.now is not None:
            _draw_progress(layout)
            return
        made = stroke_objects(context.scene)
        row = layout.row()
        row.scale_y = 1.5
        row.operator("rosy.strokes", icon="GREASEPENCIL")
        if made:
            layout.operator("rosy.strokes_remove", icon="TRASH")
            for thing in made:
                layout.label(text=thing.name, icon=STROKE_ICONS[thing.type])


#: Of objects of strokes, by type; Grease Pencil had another name before Blender 4.3.
STROKE_ICONS = {
    "GREASEPENCIL": "OUTLINER_OB_GREASEPENCIL",
    "GPENCIL": "OUTLINER_OB_GREASEPENCIL",
    "CURVES": "OUTLINER_OB_CURVES",
}

#: Settings of strokes that are folded away.
STROKE_GROUPS = {
    "Density": ("tone", "light", "layering", "curvature"),
    "Ends": ("taper", "overshoot", "gaps", "cross_creases"),
    "Inks": ("inks", "ink_colour", "outline_colour"),
}


def _draw_stroke_settings(
    layout: bpy.types.UILayout, settings: bpy.types.PropertyGroup, names: tuple[str, ...]
) -> None:
    column = layout.column()
    unused = {
        "light": not settings.tone,
        "layering": not settings.tone,
        "outline_colour": settings.inks == "ONE" or not settings.outline,
        "ink_colour": settings.inks != "ONE",
        "paper": settings.plotter,
    }
    for name in names:
        row = column.row()
        row.active = not unused.get(name, False)
        row.prop(settings, name)


CLASSES = (
    VIEW3D_MT_rosy_presets,
    VIEW3D_PT_rosy,
    VIEW3D_PT_rosy_look,
    *(
        _settings_panel(label, "VIEW3D_PT_rosy_look", f"look_{label.lower()}", names)
        for label, names in GROUPS.items()
    ),
    _settings_panel("Output", "VIEW3D_PT_rosy", "output", OUTPUT),
    _settings_panel("Advanced", "VIEW3D_PT_rosy", "advanced", (*OTHERS, "undefined")),
    VIEW3D_PT_rosy_strokes,
)
