"""RoSy's properties: `Scene.rosy`, `Mesh.rosy` and `Object.rosy`."""

from __future__ import annotations

import atexit
from dataclasses import fields
from typing import Any

import bpy

from ..compositor.colour import from_hex
from ..compositor.look import Look
from ..compositor.presets import DEFAULT
from ..field.rosy_field import MAX_DEGREE
from ..gpu.painter import DEVICES
from ..scene.attributes import DEFAULT_DEGREE, DEFAULT_NAME
from ..scene.capabilities import folder_options, has_properties
from ..scene.looks import apply_look, look_of
from ..strokes.draw import Manner
from . import shelf

__all__ = ["apply_look", "ensure_registered", "look_of", "register", "unregister"]

CAMERAS = [
    ("SCENE", "Scene Camera", "From the camera that renders the scene"),
    ("ALL", "All Cameras", "From every camera in the scene, one picture each"),
    ("VIEW", "Current View", "From where this 3D view looks now"),
]
PLACEMENTS = [
    (
        "PROJECTION",
        "Baked",
        "The picture stays where it was drawn on the surface, from wherever it is looked at",
    ),
    ("WINDOW", "Window", "The picture fills the frame of whatever camera looks"),
]
DEVICE_ITEMS = [(name.upper(), *words) for name, words in DEVICES.items()]
STORES = [
    ("PACKED", "In the Blend File", "Packed into the .blend file"),
    ("SAVED", "In a Folder", "Saved to a folder as .png or .exr"),
]
STROKE_KINDS = [
    ("PENCIL", "Grease Pencil", "An object with a layer for each family of strokes"),
    ("CURVES", "Curves", "An object of curves, with attributes for Geometry Nodes"),
    ("SVG", "SVG File", "A file with a layer for each family, for other programs and plotters"),
]
INKS = [
    ("ONE", "One", "All strokes in one ink"),
    ("FAMILIES", "By Family", "An ink of its own for each family of strokes"),
]
#: Where strokes can be drawn from: one place at a time.
STROKE_CAMERAS = [item for item in CAMERAS if item[0] != "ALL"]
#: What numbers of settings are, in Blender's words.
SUBTYPES = {"angle": "ANGLE", "length": "DISTANCE", "pixels": "PIXEL"}
COLOUR = {"subtype": "COLOR_GAMMA", "size": 3, "min": 0, "max": 1, "default": (0.0, 0.0, 0.0)}
FORMATS = [
    ("BYTE", "8 Bit sRGB", "As on the screen, a .png file: small, and what most programs read"),
    ("FLOAT", "Float", "Linear values, an .exr file"),
]


def _setting_property(entry: Any) -> Any:
    """A property for a setting of a look or of strokes, by what its metadata says."""
    rules = entry.metadata
    what = {
        "name": entry.name.replace("_", " ").title(),
        "description": rules["text"],
        "default": entry.default,
    }
    if "options" in rules:
        items = [
            (option, option.replace("_", " ").title(), text)
            for option, text in rules["options"].items()
        ]
        return bpy.props.EnumProperty(items=items, **what)
    if "colour" in rules:
        what["default"] = from_hex(entry.default).tolist()
        return bpy.props.FloatVectorProperty(subtype="COLOR_GAMMA", size=3, min=0, max=1, **what)
    if isinstance(entry.default, bool):
        return bpy.props.BoolProperty(**what)
    what |= {"min": rules["low"], "max": rules["high"]}
    if isinstance(entry.default, int):
        return bpy.props.IntProperty(**what)
    return bpy.props.FloatProperty(subtype=SUBTYPES.get(rules.get("unit"), "NONE"), **what)


class RosyLook(bpy.types.PropertyGroup):
    """How fields are drawn; one property for each setting of a `Look`."""

    __annotations__ = {entry.name: _setting_property(entry) for entry in fields(Look)}


class RosyBakedObject(bpy.types.PropertyGroup):
    """One object under a picture, as it was when the picture was drawn. Its name is the object's."""

    matrix: bpy.props.FloatVectorProperty(size=16, description="Object to clip space, by rows")
    state: bpy.props.StringProperty(description="Digest of place, mesh and field")


class RosyBake(bpy.types.PropertyGroup):
    """One picture and what it was drawn from. Its name is the camera's."""

    image: bpy.props.PointerProperty(type=bpy.types.Image)
    material: bpy.props.PointerProperty(type=bpy.types.Material)
    width: bpy.props.IntProperty()
    height: bpy.props.IntProperty()
    frames: bpy.props.StringProperty(description="Of a sequence; empty for one picture")
    look: bpy.props.StringProperty(description="The scene's look at the time, as JSON")
    camera_state: bpy.props.StringProperty(description="Digest of the camera; empty for a view")
    objects: bpy.props.CollectionProperty(type=RosyBakedObject)


class RosyMadeStrokes(bpy.types.PropertyGroup):
    """An object of strokes that RoSy has made. Its name is the camera's."""

    kind: bpy.props.StringProperty()
    thing: bpy.props.PointerProperty(type=bpy.types.Object)


class RosyStrokes(bpy.types.PropertyGroup):
    """How strokes are drawn: a property for each setting of a `Manner`, and the ink."""

    __annotations__ = {entry.name: _setting_property(entry) for entry in fields(Manner)} | {
        "kind": bpy.props.EnumProperty(
            name="Make", description="What the strokes are made into", items=STROKE_KINDS
        ),
        "camera": bpy.props.EnumProperty(
            name="Camera", description="From where strokes are seen", items=STROKE_CAMERAS
        ),
        "selected": bpy.props.BoolProperty(
            name="Selected Only",
            description="Draw on the selected objects alone; the others hide what is behind them",
        ),
        "width": bpy.props.FloatProperty(
            name="Width",
            description="Of a stroke where it is widest, in pixels of the picture",
            subtype="PIXEL",
            min=0.01,
            max=1000,
            soft_max=20,
            default=1.2,
        ),
        "inks": bpy.props.EnumProperty(
            name="Inks", description="What families are drawn with", items=INKS
        ),
        "ink_colour": bpy.props.FloatVectorProperty(
            name="Ink", description="Colour of the ink", **COLOUR
        ),
        "outline_colour": bpy.props.FloatVectorProperty(
            name="Outline Ink", description="Colour of silhouettes, creases and borders", **COLOUR
        ),
        "filepath": bpy.props.StringProperty(
            name="File",
            description="The .svg file that is written",
            subtype="FILE_PATH",
            default="//strokes.svg",
            options=folder_options(),
        ),
        "paper": bpy.props.BoolProperty(
            name="White Paper", description="Lay the strokes on white paper", default=True
        ),
        "plotter": bpy.props.BoolProperty(
            name="For a Plotter",
            description="Lines of one width, in an order in which a pen travels little, no paper",
        ),
        "page": bpy.props.FloatProperty(
            name="Page Width",
            description="Of the whole picture, in millimetres; 0 counts in pixels",
            min=0,
            max=1e5,
        ),
        "made": bpy.props.CollectionProperty(type=RosyMadeStrokes),
    }


class RosyScene(bpy.types.PropertyGroup):
    """How the fields of a scene are drawn, and what was baked."""

    look: bpy.props.PointerProperty(type=RosyLook)
    preset: bpy.props.EnumProperty(
        name="Preset",
        description="Look to start from",
        items=shelf.items,
        get=shelf.get_chosen,
        set=shelf.set_chosen,
        options={"SKIP_SAVE"},
    )
    preset_name: bpy.props.StringProperty(
        description="What the preset is called by that the look was taken from",
        default=DEFAULT,
        options={"HIDDEN"},
    )
    camera: bpy.props.EnumProperty(
        name="Camera", description="From where the fields are drawn", items=CAMERAS
    )
    percentage: bpy.props.IntProperty(
        name="Size",
        description="Size of the picture, in percent of the size of renders",
        subtype="PERCENTAGE",
        min=1,
        max=400,
        default=100,
    )
    placement: bpy.props.EnumProperty(
        name="Placement", description="How the picture lies on the meshes", items=PLACEMENTS
    )
    emission: bpy.props.FloatProperty(
        name="Emission",
        description="How much the picture glows by itself: 1 shows it as it was drawn",
        min=0,
        soft_max=2,
        default=1,
    )
    diffuse: bpy.props.FloatProperty(
        name="Diffuse",
        description="How much of the scene's light the picture reflects",
        min=0,
        max=1,
        default=0,
    )
    store: bpy.props.EnumProperty(
        name="Store", description="Where the picture is kept", items=STORES
    )
    directory: bpy.props.StringProperty(
        name="Folder",
        description="Folder that pictures are saved to",
        subtype="DIR_PATH",
        default="//rosy/",
        options=folder_options(),
    )
    image_format: bpy.props.EnumProperty(
        name="Format", description="Depth of the picture's values", items=FORMATS
    )
    device: bpy.props.EnumProperty(
        name="Device", description="What draws the picture", items=DEVICE_ITEMS
    )
    undefined: bpy.props.BoolProperty(
        name="Leave Out Bad Vectors",
        description="Take vectors that are not finite for undefined, instead of refusing the field",
    )
    tone_attribute: bpy.props.StringProperty(
        name="Attribute",
        description="On points, faces or corners of the meshes; their active colour if empty. Objects "
        "without it have the light",
    )
    tone_picture: bpy.props.StringProperty(
        name="Picture",
        description="File of a picture through the scene's camera, such as a render; # stand for the "
        "number of the frame",
        subtype="FILE_PATH",
        options=folder_options(),
    )
    bakes: bpy.props.CollectionProperty(type=RosyBake)
    strokes: bpy.props.PointerProperty(type=RosyStrokes)


class RosyMesh(bpy.types.PropertyGroup):
    """The field of a mesh."""

    degree: bpy.props.IntProperty(
        name="Degree",
        description="In how many directions the field looks the same",
        min=1,
        max=MAX_DEGREE,
        default=DEFAULT_DEGREE,
    )
    attribute: bpy.props.StringProperty(
        name="Attribute",
        description="Name of the mesh attribute that holds the field",
        default=DEFAULT_NAME,
    )


class RosyObject(bpy.types.PropertyGroup):
    """An object with a field."""

    include: bpy.props.BoolProperty(
        name="Draw the Field",
        description="Whether the field of this object is drawn; if not, it only hides others",
        default=True,
    )
    tone_image: bpy.props.PointerProperty(
        name="Image",
        description="On this object, how light it is to be; objects without one have the light",
        type=bpy.types.Image,
    )
    tone_uv_map: bpy.props.StringProperty(
        name="UV Map", description="How the image lies on this object; its active one if empty"
    )


CLASSES = (
    RosyLook,
    RosyBakedObject,
    RosyBake,
    RosyMadeStrokes,
    RosyStrokes,
    RosyScene,
    RosyMesh,
    RosyObject,
)
PLACES = ((bpy.types.Scene, RosyScene), (bpy.types.Mesh, RosyMesh), (bpy.types.Object, RosyObject))


def register() -> None:
    """Add the properties to Blender."""
    for cls in CLASSES:
        bpy.utils.register_class(cls)
    for owner, group in PLACES:
        owner.rosy = bpy.props.PointerProperty(type=group, name="RoSy")


def unregister() -> None:
    """Take them away again."""
    for owner, _ in PLACES:
        del owner.rosy
    for cls in reversed(CLASSES):
        bpy.utils.unregister_class(cls)


def ensure_registered() -> None:
    """Add the properties unless they are there, as they are while the extension is on.

    For the command line and scripts that run without the extension. As Python ends they go again:
    Blender's Python module cannot let go of them after that.
    """
    if not has_properties():
        register()
        atexit.register(_unregister_if_there)


def _unregister_if_there() -> None:
    if has_properties():
        unregister()
