"""RoSy's properties: `Scene.rosy`, `Mesh.rosy` and `Object.rosy`."""

from __future__ import annotations

from dataclasses import fields
from typing import Any

import bpy

from ..compositor.colour import from_hex
from ..compositor.look import Look
from ..field.rosy_field import MAX_DEGREE
from ..gpu.painter import DEVICES
from ..scene.attributes import DEFAULT_DEGREE, DEFAULT_NAME
from ..scene.capabilities import folder_options, has_properties
from ..scene.looks import apply_look, look_of

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
FORMATS = [
    ("BYTE", "8 Bit sRGB", "As on the screen, a .png file: small, and what most programs read"),
    ("FLOAT", "Float", "Linear values, an .exr file"),
]


def _look_property(entry: Any) -> Any:
    """A property for a setting of a look, by what its metadata says."""
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
    return bpy.props.FloatProperty(subtype="ANGLE" if "unit" in rules else "NONE", **what)


class RosyLook(bpy.types.PropertyGroup):
    """How fields are drawn; one property for each setting of a `Look`."""

    __annotations__ = {entry.name: _look_property(entry) for entry in fields(Look)}


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


class RosyScene(bpy.types.PropertyGroup):
    """How the fields of a scene are drawn, and what was baked."""

    look: bpy.props.PointerProperty(type=RosyLook)
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


CLASSES = (RosyLook, RosyBakedObject, RosyBake, RosyScene, RosyMesh, RosyObject)
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

    For the command line and scripts that run without the extension.
    """
    if not has_properties():
        register()
