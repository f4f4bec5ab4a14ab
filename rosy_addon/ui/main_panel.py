"""The main panel: make a field, bake its picture and look at it."""

import bpy
from bpy.types import Context, Menu, Object, Panel, Scene, SpaceView3D, UILayout

from ..compositor.look import has_flow, is_hatched
from ..gpu.select import automatic_device
from ..scene.bake_records import BakeInfo, has_pictures, list_bakes
from ..scene.computed_attributes import other_field_names
from ..scene.datablocks import field_mesh
from ..scene.field_attributes import has_field
from ..scene.meshes import is_shaded_flat
from ..scene.pictures import NEUTRAL_VIEW_TRANSFORMS
from ..scene.staleness import SCENE_STATES
from ..scene.visible_objects import field_objects
from ..viewport import session
from ..viewport.view3d import redraw
from . import job_status, overlay, sidebar
from .operator_settings import draw_convert_settings, draw_generator_settings, draw_settings
from .translations import translated

#: Types of objects that Blender can convert to meshes.
CONVERTIBLE_TYPES = ("CURVE", "SURFACE", "FONT", "META")

#: Types of viewport shading in which a 3D view does not show baked pictures.
SHADING_WITHOUT_MATERIALS = ("WIREFRAME", "SOLID")


class VIEW3D_PT_rosy(sidebar.SidebarPanel, Panel):
    """Make a field, bake its picture and look at it."""

    bl_label = "RoSy"

    def draw(self, context: Context) -> None:
        job_status.start_helper_once(context)
        layout = self.layout
        sidebar.use_property_columns(layout)
        _draw_field_section(layout, context)
        layout.separator()
        _draw_picture_section(layout, context)


def _draw_field_section(layout: UILayout, context: Context) -> None:
    obj = context.view_layer.objects.active
    layout.label(text="1.  Field", icon="FORCE_VORTEX")
    if obj is not None and obj.type in CONVERTIBLE_TYPES:
        layout.label(text=translated("{name} is not a mesh").format(name=obj.name), icon="INFO")
        layout.operator("object.convert", text="Convert to Mesh", icon="MESH_DATA").target = "MESH"
    elif obj is None or obj.type != "MESH":
        layout.label(text="Select a mesh to draw on")
    elif has_field(obj):
        _draw_existing_field(layout, context, obj)
    else:
        layout.label(text=translated("{name} has no field yet").format(name=obj.name))
        _draw_new_field(layout, context)


def _draw_existing_field(layout: UILayout, context: Context, obj: Object) -> None:
    mesh = field_mesh(obj)
    box = layout.box().column(align=True)
    row = box.row()
    row.use_property_split = False
    row.label(text=obj.name, icon="OUTLINER_OB_MESH")
    row.prop(obj.rosy, "include", text="Draw")
    has_attribute = mesh.rosy.attribute in mesh.attributes
    name = f"'{mesh.rosy.attribute}'" if has_attribute else "dir0 ..."
    count = len(mesh.polygons)
    faces = translated("1 face" if count == 1 else "{count:,} faces").format(count=count)
    text = translated("Degree {degree} on {faces}, {name}")
    box.label(text=text.format(degree=mesh.rosy.degree, faces=faces, name=name))
    if is_shaded_flat(obj.data):
        layout.label(text="Flat shading shows each face", icon="INFO")
        layout.operator("object.shade_smooth_by_angle", icon="SMOOTHCURVE")
    row = layout.row(align=True)
    row.operator("rosy.field_export", text="Export", icon="EXPORT")
    is_shown = overlay.shown(obj) is not None
    button = row.operator("rosy.singularities", icon="OVERLAY", depress=is_shown)
    button.show = "NONE" if is_shown else "OVERLAY"
    if (body := sidebar.closed_panel(layout, "convert_field", title="Convert")) is not None:
        _draw_convert_settings(body, context)
    other_fields = other_field_names(mesh)
    if other_fields:
        body = sidebar.closed_panel(layout, "compare_field", title="Compare")
        if body is not None:
            _draw_compare_settings(body, context, other_fields)
    body = sidebar.closed_panel(layout, "another_field", title="Make Another Field")
    if body is not None:
        _draw_new_field(body, context)


def _draw_convert_settings(layout: UILayout, context: Context) -> None:
    """Draw the settings and the button that convert fields, and the menu to store them in another form."""
    settings = context.window_manager.operator_properties_last("rosy.field_convert")
    draw_convert_settings(layout.column(), settings)
    layout.operator("rosy.field_convert")
    layout.operator_menu_enum("rosy.field_store", "form", text="Store As")


def _draw_compare_settings(layout: UILayout, context: Context, other_fields: list[str]) -> None:
    """Draw the settings and the button that compare the field with another field.

    `other_fields` are the names of the attributes of the mesh that may hold another field.
    """
    settings = context.window_manager.operator_properties_last("rosy.field_compare")
    only_other = other_fields[0] if len(other_fields) == 1 else ""
    draw_settings(layout.column(), settings, "other", "use_as_color", other=only_other)
    layout.operator("rosy.field_compare")


def _draw_new_field(layout: UILayout, context: Context) -> None:
    """Draw the settings of the generator and the buttons that make or import a field."""
    settings = context.window_manager.operator_properties_last("rosy.field_generate")
    draw_generator_settings(layout.column(), settings)
    row = sidebar.new_row(layout, scale_y=1.5)
    row.operator("rosy.field_generate", icon="FORCE_VORTEX")
    if settings.kind == "curvature" and settings.degree % 2:
        row.enabled = False
        layout.label(text="Curvature: even degrees only", icon="ERROR")
    layout.operator("rosy.field_import", text="Import a Field File...", icon="IMPORT")


def _draw_picture_section(layout: UILayout, context: Context) -> None:
    """Draw the switch of the live view, the list of baked pictures, and the buttons that bake."""
    layout.label(text="2.  Picture", icon="RENDER_STILL")
    _draw_live_toggle(layout, context)
    if session.is_live(context.space_data):
        layout.prop(context.scene.rosy, "remember_live")
        if has_flow(context.scene.rosy.look):
            playing = session.is_flow_playing()
            icon = "PAUSE" if playing else "PLAY"
            layout.operator("rosy.flow_play", text="Pause" if playing else "Play", icon=icon)
    if job_status.current is not None:
        sidebar.draw_progress(layout)
    else:
        _draw_bakes(layout, context)
    # Messages are below the buttons, so that buttons do not move when messages come and go.
    sidebar.draw_wrapped(layout, context, session.messages(context.area))


def _draw_bakes(layout: UILayout, context: Context) -> None:
    objects = field_objects(context.view_layer)
    bake_infos = list_bakes(context.scene, for_panel=True, automatic_device=automatic_device)
    if (wait := SCENE_STATES.seconds_to_wait()) and not bpy.app.timers.is_registered(redraw):
        bpy.app.timers.register(redraw, first_interval=wait)  # the panel may be outdated
    for bake in bake_infos:
        _draw_bake_info(layout, context, bake, several=len(bake_infos) > 1)
    settings = context.scene.rosy
    if objects and settings.camera == "SCENE" and context.scene.camera is None:
        layout.label(text="The scene has no camera", icon="INFO")
        button = layout.operator(
            "wm.context_set_enum", text="Draw from Current View", icon="VIEW3D"
        )
        button.data_path, button.value = "scene.rosy.camera", "VIEW"
    elif objects:
        layout.prop(settings, "camera")
    if len(objects) > 1:
        layout.label(text=translated("Draws {count} objects").format(count=len(objects)))
    row = sidebar.new_row(layout, scale_y=1.5)
    row.operator("rosy.bake", text=bake_label(bake_infos), icon="RENDER_STILL")
    row = layout.row(align=True)
    row.operator("rosy.bake_animation", text="Animation", icon="RENDER_ANIMATION")
    row.operator("rosy.turntable", text="Turntable", icon="FILE_MOVIE")
    if not objects:
        layout.label(text="Needs a field to draw", icon="INFO")
    if has_pictures(context.scene):
        layout.operator("rosy.remove", icon="TRASH")
    if bake_infos:
        _draw_view_hints(layout, context, bake_infos)
        _draw_view_transform_warning(layout, context.scene)
    _draw_texture_settings(layout, context)


def bake_label(bake_infos: list[BakeInfo]) -> str:
    """Return the label of the button that bakes a single picture, given the existing bakes of the scene."""
    pictures = [bake for bake in bake_infos if not bake.is_texture]
    if any(bake.frame_range and bake.is_shown for bake in pictures):
        return translated("Bake Still")
    return translated("Bake Again" if pictures else "Bake")


def _draw_texture_settings(layout: UILayout, context: Context) -> None:
    """Draw the settings and the button that bake textures."""
    if (body := sidebar.closed_panel(layout, "texture", title="Texture")) is None:
        return
    obj = context.view_layer.objects.active
    column = body.column()
    if obj is not None and obj.type == "MESH" and obj.data.uv_layers:
        column.prop_search(obj.rosy, "texture_uv_map", obj.data, "uv_layers")
    settings = context.scene.rosy
    column.prop(settings, "texture_content")
    if settings.texture_content != "LOOK":
        column.prop(settings.look, "guiding_angle")
    elif is_hatched(settings.look):
        column.prop(settings, "texture_bake_light")
        if not settings.texture_bake_light:
            sidebar.draw_cycles_hint(column, context)
    draw_settings(column, settings, "texture_udim", "texture_size", "texture_margin")
    column.operator("rosy.bake_texture", icon="TEXTURE")
    if settings.texture_content == "ANISOTROPY" and context.scene.render.engine != "CYCLES":
        column.label(text="Only Cycles draws anisotropy", icon="INFO")


def _draw_live_toggle(layout: UILayout, context: Context) -> None:
    is_live = session.is_live(context.space_data)
    icon = "HIDE_OFF" if is_live else "HIDE_ON"
    button = layout.operator("rosy.viewport", text="Live in This View", icon=icon, depress=is_live)
    button.show = "OFF" if is_live else "ON"


def draw_overlay_popover(popover: Menu, context: Context) -> None:
    """Draw the switch of the live view in Blender's popover of overlays."""
    _draw_live_toggle(popover.layout, context)


def _draw_bake_info(layout: UILayout, context: Context, bake: BakeInfo, several: bool) -> None:
    box = layout.box().column(align=True)
    if bake.is_texture:
        box.label(text=translated("Texture of {name}").format(name=bake.camera), icon="TEXTURE")
    else:
        box.label(text=translated("From {name}").format(name=bake.camera), icon="CAMERA_DATA")
    row = box.row()
    size = translated(
        "{width} x {height} texels" if bake.is_texture else "{width} x {height} pixels"
    )
    row.label(text=size.format(width=bake.width, height=bake.height))
    if bake.frame_range:
        box.label(
            text=translated("Frames {range}").format(range=bake.frame_range),
            icon="RENDER_ANIMATION",
        )
    if several and bake.is_shown:
        row.label(text="Shown", icon="HIDE_OFF")
    elif several:
        row.operator("rosy.show", text="Show").camera = bake.camera
    if bake.stale_reason:
        reason = translated("Out of date: {reason}").format(reason=bake.stale_reason)
        sidebar.draw_wrapped(box, context, [reason], "ERROR")
    elif bake.unknown_reason:
        reason = translated("Not known to be up to date: {reason}")
        reason = reason.format(reason=bake.unknown_reason)
        sidebar.draw_wrapped(box, context, [reason], "QUESTION")
    else:
        box.label(
            text="Up to date at this frame" if bake.frame_range else "Up to date", icon="CHECKMARK"
        )


def unregister() -> None:
    """Stop the timer that redraws the 3D views."""
    if bpy.app.timers.is_registered(redraw):
        bpy.app.timers.unregister(redraw)


def _draw_view_hints(layout: UILayout, context: Context, bake_infos: list[BakeInfo]) -> None:
    """If this view does not show baked pictures, draw buttons that make them visible."""
    view, camera = context.space_data, context.scene.camera
    column = layout.column(align=True)
    reason = _hidden_picture(view, context.scene)
    if reason:
        column.label(text=reason, icon="INFO")
        column.operator("rosy.show_here")
    in_camera_view = view.region_3d is not None and view.region_3d.view_perspective == "CAMERA"
    camera_names = [bake.camera for bake in bake_infos]
    if not in_camera_view and camera is not None and camera.name in camera_names:
        column.operator("view3d.view_camera", text="Look Through the Camera")


def _hidden_picture(view: SpaceView3D, scene: Scene) -> str:
    """Return why a view does not show pictures as renders do; empty if it does."""
    if session.is_live(view):
        return translated("Live fields cover the picture")
    if view.shading.type in SHADING_WITHOUT_MATERIALS:
        return translated("This view does not show materials")
    has_no_lights = view.shading.type == "MATERIAL" and not view.shading.use_scene_lights
    if has_no_lights and scene.rosy.relight:
        return translated("This view has no lights of the scene")
    return ""


def _draw_view_transform_warning(layout: UILayout, scene: Scene) -> None:
    """Draw a warning if the view transform of the scene changes the tones of the picture."""
    transform = scene.view_settings.view_transform
    if transform not in NEUTRAL_VIEW_TRANSFORMS:
        column = layout.column(align=True)
        column.label(
            text=translated("{name} changes the colors").format(name=transform), icon="ERROR"
        )
        button = column.operator("wm.context_set_enum", text="View Transform: Standard")
        button.data_path, button.value = "scene.view_settings.view_transform", "Standard"


class _PropertiesPanel:
    """Base class of the panels in the properties editor: the preset of an object or a collection."""

    bl_label = "RoSy"
    bl_space_type = "PROPERTIES"
    bl_region_type = "WINDOW"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context: Context) -> None:
        sidebar.use_property_columns(self.layout)
        owner = context.object if self.bl_context == "object" else context.collection
        self.layout.prop(owner.rosy, "preset", icon="PRESET")


class OBJECT_PT_rosy(_PropertiesPanel, Panel):
    """The preset of an object with a field."""

    bl_context = "object"

    @classmethod
    def poll(cls, context: Context) -> bool:
        return context.object is not None and has_field(context.object)


class COLLECTION_PT_rosy(_PropertiesPanel, Panel):
    """The preset of the objects in a collection."""

    bl_context = "collection"


CLASSES = (VIEW3D_PT_rosy, OBJECT_PT_rosy, COLLECTION_PT_rosy)
