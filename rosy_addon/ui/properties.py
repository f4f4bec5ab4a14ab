"""The properties of RoSy: `Scene.rosy`, `Mesh.rosy`, `Object.rosy` and `NodeTree.rosy`."""

from __future__ import annotations

import atexit
from typing import Any

import bpy

from ..compositor.look import Look
from ..core.color import from_hex
from ..core.settings import Choice, Color, Number, Setting, Switch, Vector, settings_of, title
from ..field.rosy_field import MAX_DEGREE
from ..gpu.select import RENDER_DEVICES
from ..line_drawing.style import StrokeStyle
from ..preset_files.store import DEFAULT_KEY
from ..scene.backdrop import update_backdrops
from ..scene.compat import has_rosy_properties, path_property_options
from ..scene.field_attributes import DEFAULT_DEGREE, DEFAULT_FIELD_NAME
from ..scene.keys import update_keys
from ..surface_texture.draw import (
    CONTENTS,
    DEFAULT_MARGIN,
    DEFAULT_SIZE,
    MAX_MARGIN,
    MAX_SIZE,
    MIN_SIZE,
)
from . import preset_library

CAMERA_ITEMS = [
    ("SCENE", "Scene Camera", "Active camera of the scene"),
    ("ALL", "All Cameras", "Every camera in the scene, one picture each"),
    ("VIEW", "Current View", "Current viewpoint of this 3D view"),
]
PLACEMENT_ITEMS = [
    (
        "PROJECTION",
        "Baked",
        "The picture is fixed to the surface and can be seen from any viewpoint",
    ),
    ("WINDOW", "Window", "The picture fills the frame of the camera that is used"),
]
DEVICE_ITEMS = [(name.upper(), *labels) for name, labels in RENDER_DEVICES.items()]
STORE_ITEMS = [
    ("PACKED", "In the Blend File", "Pack pictures into the .blend file"),
    ("SAVED", "In a Folder", "Save pictures to a folder as .png or .exr files"),
]
STROKE_KIND_ITEMS = [
    ("PENCIL", "Grease Pencil", "Grease Pencil object with a layer for each family of strokes"),
    ("CURVES", "Curves", "Curves object with attributes for Geometry Nodes"),
    (
        "FILE",
        "File",
        "SVG picture with a layer for each family, or polylines in space as .ply, .obj or .csv",
    ),
]
INK_ITEMS = [
    ("ONE", "Single", "One ink for all strokes"),
    ("FAMILIES", "By Family", "One ink for each family of strokes"),
]
#: Viewpoints of strokes. Only one drawing is made at a time, so there is no item for all cameras.
STROKE_CAMERA_ITEMS = [item for item in CAMERA_ITEMS if item[0] != "ALL"]
#: Subtypes of number properties by the unit of the setting.
SUBTYPE_BY_UNIT = {"angle": "ANGLE", "length": "DISTANCE", "pixels": "PIXEL"}
COLOR_ARGUMENTS = {
    "subtype": "COLOR_GAMMA",
    "size": 3,
    "min": 0,
    "max": 1,
    "default": (0.0, 0.0, 0.0),
}
BRUSH_STRENGTH = {
    "name": "Strength",
    "description": "How much of its effect the brush has",
    "subtype": "FACTOR",
    "min": 0.0,
    "max": 1.0,
    "default": 1.0,
}
TEXTURE_CONTENT_ITEMS = [(name.upper(), name.capitalize(), text) for name, text in CONTENTS.items()]
IMAGE_FORMAT_ITEMS = [
    ("BYTE", "8-Bit sRGB", "Display values in a .png file: small, and readable by most programs"),
    ("FLOAT", "Float", "Linear values in an .exr file"),
]


def _setting_property(setting: Setting) -> Any:
    """Return Blender's property for a setting."""
    arguments: dict[str, Any] = {
        "name": setting.label,
        "description": setting.text,
        "default": setting.default,
    }
    match setting:
        case Choice(options=options, option_labels=labels):
            items = [(key, labels.get(key, title(key)), text) for key, text in options.items()]
            return bpy.props.EnumProperty(items=items, **arguments)
        case Color():
            arguments["default"] = from_hex(setting.default).tolist()
            return bpy.props.FloatVectorProperty(**COLOR_ARGUMENTS | arguments)
        case Switch():
            return bpy.props.BoolProperty(**arguments)
        case Number(low=low, high=high, is_integer=True):
            return bpy.props.IntProperty(min=low, max=high, **arguments)
        case Vector():
            return bpy.props.FloatVectorProperty(subtype="XYZ", **arguments)
        case Number(low=low, high=high, unit=unit, soft_high=soft_high):
            arguments |= {"min": low, "max": high, "subtype": SUBTYPE_BY_UNIT.get(unit, "NONE")}
            if soft_high is not None:
                arguments["soft_max"] = soft_high
            if unit == "size":
                arguments |= {"precision": 3, "step": 1}
            return bpy.props.FloatProperty(**arguments)
    raise TypeError(f"setting '{setting.name}' has no property")


def setting_properties(cls: type) -> dict[str, Any]:
    """Return Blender's properties for a settings class, by name."""
    return {name: _setting_property(setting) for name, setting in settings_of(cls).items()}


class RosyLook(bpy.types.PropertyGroup):
    """How fields are drawn; one property for each setting of a `Look`."""

    __annotations__ = setting_properties(Look)


class RosyFrameState(bpy.types.PropertyGroup):
    """What a frame of a sequence was drawn from. Its name is the number of the frame."""

    state: bpy.props.StringProperty(description="State of the scene, as JSON")


class RosyBake(bpy.types.PropertyGroup):
    """A baked picture and what it was drawn from. Its name is that of the camera at that time."""

    image: bpy.props.PointerProperty(type=bpy.types.Image)
    material: bpy.props.PointerProperty(type=bpy.types.Material)
    camera: bpy.props.PointerProperty(
        type=bpy.types.Object,
        description="Empty for a 3D view, for frames of several cameras and for textures",
    )
    view: bpy.props.StringProperty(description="Camera of a 3D view, as JSON; or 'texture'")
    width: bpy.props.IntProperty()
    height: bpy.props.IntProperty()
    frames: bpy.props.StringProperty(
        description="Frame range of a sequence, empty for a single picture"
    )
    device: bpy.props.StringProperty(description="Device that drew the picture: cpu or gpu")
    key: bpy.props.StringProperty(description="What the key of the picture says, as JSON")
    state: bpy.props.StringProperty(
        description="State of the scene when a single picture was drawn, as JSON"
    )
    frame_states: bpy.props.CollectionProperty(type=RosyFrameState)


class RosyProjection(bpy.types.PropertyGroup):
    """How an object shows one of its pictures, by the material of the picture."""

    material: bpy.props.PointerProperty(type=bpy.types.Material)
    matrix: bpy.props.FloatVectorProperty(
        size=16,
        description="Object to clip space, by rows. Zero if the object has several instances",
    )


class RosyNodeTree(bpy.types.PropertyGroup):
    """The pictures of an object. They belong to the node group of the modifier that shows one."""

    projections: bpy.props.CollectionProperty(type=RosyProjection)


class RosyStrokeObject(bpy.types.PropertyGroup):
    """An object of strokes made by RoSy. Its name is that of the camera."""

    kind: bpy.props.StringProperty()
    thing: bpy.props.PointerProperty(type=bpy.types.Object)
    digest: bpy.props.StringProperty(description="Digest of the strokes when they were drawn")


class RosyStrokes(bpy.types.PropertyGroup):
    """How strokes are drawn: the settings of a `StrokeStyle`, the pen and the output."""

    __annotations__ = setting_properties(StrokeStyle) | {
        "kind": bpy.props.EnumProperty(
            name="Make",
            description="Type of object or file made from the strokes",
            items=STROKE_KIND_ITEMS,
        ),
        "camera": bpy.props.EnumProperty(
            name="Camera", description="Viewpoint of the strokes", items=STROKE_CAMERA_ITEMS
        ),
        "selected": bpy.props.BoolProperty(
            name="Selected Only",
            description="Draw only on selected objects. Others still hide what is behind them",
        ),
        "follow": bpy.props.BoolProperty(
            name="Follow Surface",
            description="Let the strokes follow the object when it deforms, by a modifier. Only curves on one "
            "object",
        ),
        "width": bpy.props.FloatProperty(
            name="Width",
            description="Maximum width of a stroke in pixels of the picture",
            subtype="PIXEL",
            min=0.01,
            max=1000,
            soft_max=20,
            default=1.2,
        ),
        "inks": bpy.props.EnumProperty(
            name="Inks", description="Inks of the families", items=INK_ITEMS
        ),
        "ink_color": bpy.props.FloatVectorProperty(
            name="Ink", description="Color of the ink", **COLOR_ARGUMENTS
        ),
        "outline_color": bpy.props.FloatVectorProperty(
            name="Outline Ink",
            description="Color of silhouettes, creases and borders",
            **COLOR_ARGUMENTS,
        ),
        "filepath": bpy.props.StringProperty(
            name="File",
            description="Path of the .svg, .ply, .obj or .csv file",
            subtype="FILE_PATH",
            default="//strokes.svg",
            options=path_property_options(),
        ),
        "paper": bpy.props.BoolProperty(
            name="White Paper", description="Draw the strokes on white paper", default=True
        ),
        "plotter": bpy.props.BoolProperty(
            name="For a Plotter",
            description="Lines of one width without paper, in an order with short pen travel",
        ),
        "page": bpy.props.FloatProperty(
            name="Page Width",
            description="Width of the page in millimeters. 0: the size is in pixels",
            min=0,
            max=1e5,
        ),
        "made": bpy.props.CollectionProperty(type=RosyStrokeObject),
    }


def _show_backdrops(settings: RosyScene, _context: bpy.types.Context) -> None:
    update_backdrops(settings.id_data)


def _show_keys(settings: RosyScene, _context: bpy.types.Context) -> None:
    update_keys(settings.id_data)


class RosyComb(bpy.types.PropertyGroup):
    """The brush of the tool *Comb Field*."""

    size: bpy.props.IntProperty(
        name="Size",
        description="Radius of the brush on screen",
        subtype="PIXEL",
        min=1,
        max=2000,
        soft_max=500,
        default=50,
    )
    strength: bpy.props.FloatProperty(**BRUSH_STRENGTH)


class RosyScene(bpy.types.PropertyGroup):
    """How the fields of a scene are drawn, and the baked pictures."""

    look: bpy.props.PointerProperty(type=RosyLook)
    comb: bpy.props.PointerProperty(type=RosyComb)
    preset: bpy.props.EnumProperty(
        name="Preset",
        description="Preset of the look",
        items=preset_library.enum_items,
        get=preset_library.get_enum_index,
        set=preset_library.set_enum_index,
        options={"SKIP_SAVE"},
    )
    preset_name: bpy.props.StringProperty(
        description="Key of the preset that the look was taken from",
        default=DEFAULT_KEY,
        options={"HIDDEN"},
    )
    camera: bpy.props.EnumProperty(
        name="Camera", description="Viewpoint of the picture", items=CAMERA_ITEMS
    )
    percentage: bpy.props.IntProperty(
        name="Size",
        description="Size of the picture as a percentage of the render resolution",
        subtype="PERCENTAGE",
        min=1,
        max=400,
        default=100,
    )
    placement: bpy.props.EnumProperty(
        name="Placement",
        description="How the picture is placed on the meshes",
        items=PLACEMENT_ITEMS,
    )
    relight: bpy.props.BoolProperty(
        name="Relight",
        description="Store from which darkness on each pixel is covered by ink, instead of the ink. The material "
        "then draws the hatching by the light of the scene, in EEVEE, without a new bake",
    )
    emission: bpy.props.FloatProperty(
        name="Emission",
        description="Emission strength of the picture. 1: as it was drawn",
        min=0,
        soft_max=2,
        default=1,
    )
    diffuse: bpy.props.FloatProperty(
        name="Diffuse",
        description="Amount of light of the scene that the picture reflects",
        min=0,
        max=1,
        default=0,
    )
    store: bpy.props.EnumProperty(
        name="Store", description="Where the picture is stored", items=STORE_ITEMS
    )
    directory: bpy.props.StringProperty(
        name="Folder",
        description="Folder for saved pictures, and for the frames of animations",
        subtype="DIR_PATH",
        default="//rosy/",
        options=path_property_options(),
    )
    image_format: bpy.props.EnumProperty(
        name="Format",
        description="Bit depth and file format of the picture",
        items=IMAGE_FORMAT_ITEMS,
    )
    texture_content: bpy.props.EnumProperty(
        name="Content", description="What a texture shows", items=TEXTURE_CONTENT_ITEMS
    )
    texture_bake_light: bpy.props.BoolProperty(
        name="Bake Light",
        description="Draw the hatching in the present light of the scene as ink, for exports and other "
        "programs, instead of hatching that follows the light",
    )
    texture_udim: bpy.props.BoolProperty(
        name="UDIM",
        description="Draw a picture for each tile of the UV map. Otherwise all tiles show the same picture",
    )
    texture_size: bpy.props.IntProperty(
        name="Size",
        description="Width and height of textures in texels",
        subtype="PIXEL",
        min=MIN_SIZE,
        max=MAX_SIZE,
        default=DEFAULT_SIZE,
    )
    texture_margin: bpy.props.IntProperty(
        name="Margin",
        description="Width of the margin around the charts of textures, in texels",
        subtype="PIXEL",
        min=0,
        max=MAX_MARGIN,
        default=DEFAULT_MARGIN,
    )
    backdrop: bpy.props.BoolProperty(
        name="Backdrop",
        description="Fill the background of cameras that have pictures with the paper of the hatching",
        update=_show_backdrops,
    )
    key: bpy.props.BoolProperty(
        name="Key",
        description="Explain the pictures in renders: a color bar, a legend of the singularities, a scale bar "
        "and a caption, on a plane in front of each camera that has a picture",
        update=_show_keys,
    )
    key_bar: bpy.props.BoolProperty(
        name="Color Bar",
        description="Show what the color map of the picture means",
        default=True,
        update=_show_keys,
    )
    key_title: bpy.props.StringProperty(
        name="Title",
        description="Title of the color bar with its unit, such as Curvature (1/m). \\n starts a new line. "
        "Empty: the name of the quantity",
        update=_show_keys,
    )
    key_legend: bpy.props.BoolProperty(
        name="Singularities",
        description="Show the dots of all indices that are visible in the picture",
        default=True,
        update=_show_keys,
    )
    key_counts: bpy.props.BoolProperty(
        name="Counts",
        description="Say how many singularities of each index are visible",
        update=_show_keys,
    )
    key_scale: bpy.props.BoolProperty(
        name="Scale Bar",
        description="Show a length in the units of the scene. Only for orthographic cameras: in perspective, "
        "lengths depend on the depth",
        default=True,
        update=_show_keys,
    )
    key_caption: bpy.props.StringProperty(
        name="Caption",
        description="Text below the picture. \\n starts a new line",
        update=_show_keys,
    )
    key_size: bpy.props.FloatProperty(
        name="Text Size",
        description="Size of the text in pixels of the render. 0: 2.2 percent of the smaller side. It is "
        "smaller where there is not enough room",
        subtype="PIXEL",
        min=0,
        max=1000,
        soft_max=100,
        update=_show_keys,
    )
    device: bpy.props.EnumProperty(
        name="Device", description="Device that draws the picture", items=DEVICE_ITEMS
    )
    undefined: bpy.props.BoolProperty(
        name="Skip Bad Vectors",
        description="Treat vectors that are not finite as undefined, instead of reporting an error",
    )
    color_attribute: bpy.props.StringProperty(
        name="Attribute",
        description="Attribute on points, faces or corners of the meshes whose numbers are colors. "
        "Objects without it are gray or have the color of the ink",
    )
    tone_attribute: bpy.props.StringProperty(
        name="Attribute",
        description="Attribute on points, faces or corners of the meshes. Empty: the active color "
        "attribute. Objects without it use the light",
    )
    tone_picture: bpy.props.StringProperty(
        name="Picture",
        description="Picture of the scene through its camera, such as a render. # characters are "
        "replaced by the frame number",
        subtype="FILE_PATH",
        options=path_property_options(),
    )
    remember_live: bpy.props.BoolProperty(
        name="Remember in File",
        description="Save which views are live with the file, and show them again when it is opened",
    )
    live_views: bpy.props.StringProperty(
        description="Views that were live when the file was saved: index of the area and name of the "
        "screen, one view in each line",
        options={"HIDDEN"},
    )
    bakes: bpy.props.CollectionProperty(type=RosyBake)
    strokes: bpy.props.PointerProperty(type=RosyStrokes)


class RosyMesh(bpy.types.PropertyGroup):
    """The field of a mesh."""

    degree: bpy.props.IntProperty(
        name="Degree",
        description="Number of directions of the field at each point",
        min=1,
        max=MAX_DEGREE,
        default=DEFAULT_DEGREE,
    )
    attribute: bpy.props.StringProperty(
        name="Attribute",
        description="Name of the mesh attribute that holds the field",
        default=DEFAULT_FIELD_NAME,
    )


class RosyObject(bpy.types.PropertyGroup):
    """An object with a field."""

    include: bpy.props.BoolProperty(
        name="Draw the Field",
        description="Draw the field of this object. Otherwise the object only hides others",
        default=True,
    )
    tone_image: bpy.props.PointerProperty(
        name="Image",
        description="Image of the tone of this object. Objects without one use the light",
        type=bpy.types.Image,
    )
    tone_uv_map: bpy.props.StringProperty(
        name="UV Map", description="UV map of the image. Empty: the active UV map"
    )
    texture_uv_map: bpy.props.StringProperty(
        name="UV Map", description="UV map of the texture. Empty: the active UV map"
    )


CLASSES = (
    RosyLook,
    RosyComb,
    RosyFrameState,
    RosyBake,
    RosyProjection,
    RosyNodeTree,
    RosyStrokeObject,
    RosyStrokes,
    RosyScene,
    RosyMesh,
    RosyObject,
)
POINTER_PROPERTIES = (
    (bpy.types.Scene, RosyScene),
    (bpy.types.Mesh, RosyMesh),
    (bpy.types.Object, RosyObject),
    (bpy.types.NodeTree, RosyNodeTree),
)


def register() -> None:
    """Add the properties to Blender."""
    for cls in CLASSES:
        bpy.utils.register_class(cls)
    for id_type, group in POINTER_PROPERTIES:
        id_type.rosy = bpy.props.PointerProperty(type=group, name="RoSy")


def unregister() -> None:
    """Remove the properties."""
    for id_type, _ in POINTER_PROPERTIES:
        del id_type.rosy
    for cls in reversed(CLASSES):
        bpy.utils.unregister_class(cls)


def ensure_registered() -> None:
    """Add the properties if the extension is not enabled, for scripts and the command line.

    They are removed when Python exits, because Blender's Python module cannot free them later.
    """
    if not has_rosy_properties():
        register()
        atexit.register(_unregister_if_registered)


def _unregister_if_registered() -> None:
    if has_rosy_properties():
        unregister()
