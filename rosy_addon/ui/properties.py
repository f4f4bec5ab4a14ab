"""RoSy's properties of Blender datablocks: `Scene.rosy`, `Mesh.rosy`, `Object.rosy` and `NodeTree.rosy`."""

from __future__ import annotations

import atexit
from typing import Any

import bpy

from ..compositor.look import Look
from ..core.file_io import INPUT_LISTERS
from ..field.rosy_field import MAX_DEGREE
from ..gpu.select import RENDER_DEVICES
from ..line_drawing.style import StrokeStyle
from ..preset_files.store import DEFAULT_KEY
from ..scene.camera_planes import update_backdrops
from ..scene.datablocks import has_rosy_properties
from ..scene.field_attributes import DEFAULT_DEGREE, DEFAULT_FIELD_NAME
from ..scene.keys import update_keys
from ..scene.look_inputs import input_files
from ..surface_texture import draw as texture_drawing
from . import preset_library
from .property_makers import (
    PATH_OPTIONS,
    brush_strength,
    choice,
    color,
    integer,
    real,
    setting_properties,
    text,
    toggle,
)

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
#: Items of the property that chooses the camera of strokes. Strokes are drawn from only one camera at a time,
#: so there is no item for all cameras.
STROKE_CAMERA_ITEMS = [item for item in CAMERA_ITEMS if item[0] != "ALL"]
TEXTURE_CONTENT_ITEMS = [
    (name.upper(), name.capitalize(), text) for name, text in texture_drawing.CONTENTS.items()
]
IMAGE_FORMAT_ITEMS = [
    ("BYTE", "8-Bit sRGB", "Display values in a .png file: small, and readable by most programs"),
    ("FLOAT", "Float", "Linear values in an .exr file"),
]


class RosyLook(bpy.types.PropertyGroup):
    """How fields are drawn; one property for each setting of a `Look`."""

    __annotations__ = setting_properties(Look)


class RosyFrameState(bpy.types.PropertyGroup):
    """The state of the scene from which a frame of a sequence was drawn, named after the frame number."""

    state: bpy.props.StringProperty(description="State of the scene, as JSON")


class RosyBake(bpy.types.PropertyGroup):
    """A baked picture and the state of the scene from which it was drawn, named after the camera."""

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
    key: bpy.props.StringProperty(description="What the key of the picture says, as JSON")
    state: bpy.props.StringProperty(
        description="State of the scene when a single picture was drawn, as JSON"
    )
    frame_states: bpy.props.CollectionProperty(type=RosyFrameState)


class RosyProjection(bpy.types.PropertyGroup):
    """The projection with which an object shows one of its pictures, and the material of the picture."""

    material: bpy.props.PointerProperty(type=bpy.types.Material)
    matrix: bpy.props.FloatVectorProperty(
        size=16,
        description="Object to clip space, by rows. Zero if the object has several instances",
    )


class RosyNodeTree(bpy.types.PropertyGroup):
    """The pictures that an object can show, stored in the node group of its modifier."""

    projections: bpy.props.CollectionProperty(type=RosyProjection)


class RosyStrokeObject(bpy.types.PropertyGroup):
    """An object with strokes that RoSy has made, named after the camera."""

    kind: bpy.props.StringProperty()
    thing: bpy.props.PointerProperty(type=bpy.types.Object)
    digest: bpy.props.StringProperty(description="Digest of the strokes when they were drawn")


class RosyStrokes(bpy.types.PropertyGroup):
    """How strokes are drawn: the settings of a `StrokeStyle`, the pen and the output."""

    __annotations__ = setting_properties(StrokeStyle) | {
        "kind": choice("Make", "Type of object or file made from the strokes", STROKE_KIND_ITEMS),
        "camera": choice("Camera", "Viewpoint of the strokes", STROKE_CAMERA_ITEMS),
        "from_look": toggle(
            "From Look",
            "Take spacing, widths, light, outline, ends, ink and marks from the look",
            default=True,
        ),
        "selected": toggle(
            "Selected Only", "Draw only on selected objects. Others still hide what is behind them"
        ),
        "follow": toggle(
            "Follow Surface",
            "Let the strokes follow the object when it deforms, by a modifier. Only curves on one "
            "object",
        ),
        "width": real(
            "Width",
            "Maximum width of a stroke in pixels of the picture",
            subtype="PIXEL",
            min=0.01,
            max=1000,
            soft_max=20,
            default=1.2,
        ),
        "inks": choice("Inks", "Inks of the families", INK_ITEMS),
        "ink_color": color("Ink", "Color of the ink"),
        "outline_color": color("Outline Ink", "Color of silhouettes, creases and borders"),
        "filepath": text(
            "File",
            "Path of the .svg, .ply, .obj or .csv file",
            subtype="FILE_PATH",
            default="//strokes.svg",
            options=PATH_OPTIONS,
        ),
        "paper": toggle("White Paper", "Draw the strokes on white paper", default=True),
        "plotter": toggle(
            "For a Plotter", "Lines of one width without paper, in an order with short pen travel"
        ),
        "page": real(
            "Page Width",
            "Width of the page in millimeters. 0: the size is in pixels",
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

    size: integer(
        "Size",
        "Radius of the brush on screen",
        subtype="PIXEL",
        min=1,
        max=2000,
        soft_max=500,
        default=50,
    )
    strength: brush_strength()


class RosyScene(bpy.types.PropertyGroup):
    """How the fields of a scene are drawn, and the baked pictures."""

    look: bpy.props.PointerProperty(type=RosyLook)
    comb: bpy.props.PointerProperty(type=RosyComb)
    preset: choice(
        "Preset",
        "Preset of the look",
        preset_library.enum_items,
        get=preset_library.get_enum_index,
        set=preset_library.set_enum_index,
        options={"SKIP_SAVE"},
    )
    preset_name: bpy.props.StringProperty(
        description="Key of the preset that the look was taken from",
        default=DEFAULT_KEY,
        options={"HIDDEN"},
    )
    camera: choice("Camera", "Viewpoint of the picture", CAMERA_ITEMS)
    percentage: integer(
        "Size",
        "Size of the picture as a percentage of the render resolution",
        subtype="PERCENTAGE",
        min=1,
        max=400,
        default=100,
    )
    placement: choice("Placement", "How the picture is placed on the meshes", PLACEMENT_ITEMS)
    relight: toggle(
        "Relight",
        "Store from which darkness on each pixel is covered by ink, instead of the ink. The material "
        "then draws the hatching by the light of the scene, in EEVEE, without a new bake",
    )
    over_material: toggle(
        "Over Material",
        "Draw the ink over the materials that the meshes have, without paper",
    )
    emission: real(
        "Emission",
        "Emission strength of the picture. 1: as it was drawn",
        min=0,
        soft_max=2,
        default=1,
    )
    diffuse: real(
        "Diffuse", "Amount of light of the scene that the picture reflects", min=0, max=1, default=0
    )
    store: choice("Store", "Where the picture is stored", STORE_ITEMS)
    directory: text(
        "Folder",
        "Folder for saved pictures, and for the frames of animations",
        subtype="DIR_PATH",
        default="//rosy/",
        options=PATH_OPTIONS,
    )
    image_format: choice("Format", "Bit depth and file format of the picture", IMAGE_FORMAT_ITEMS)
    texture_content: choice("Content", "What a texture shows", TEXTURE_CONTENT_ITEMS)
    texture_bake_light: toggle(
        "Bake Light",
        "Draw the hatching in the present light of the scene as ink, for exports and other "
        "programs, instead of hatching that follows the light",
    )
    texture_udim: toggle(
        "UDIM",
        "Draw a picture for each tile of the UV map. Otherwise all tiles show the same picture",
    )
    texture_size: integer(
        "Size",
        "Width and height of textures in texels",
        subtype="PIXEL",
        min=texture_drawing.MIN_SIZE,
        max=texture_drawing.MAX_SIZE,
        default=texture_drawing.DEFAULT_SIZE,
    )
    texture_margin: integer(
        "Margin",
        "Width of the margin around the charts of textures, in texels",
        subtype="PIXEL",
        min=0,
        max=texture_drawing.MAX_MARGIN,
        default=texture_drawing.DEFAULT_MARGIN,
    )
    backdrop: toggle(
        "Backdrop",
        "Fill the background of cameras that have pictures with the paper of the hatching, unless the paper or "
        "the background of renders is transparent",
        default=True,
        update=_show_backdrops,
    )
    key: toggle(
        "Legend",
        "Explain the pictures in renders: a color bar, a legend of the singularities, a scale bar "
        "and a caption, on a plane in front of each camera that has a picture",
        update=_show_keys,
    )
    key_bar: toggle(
        "Color Bar", "Show what the color map of the picture means", default=True, update=_show_keys
    )
    key_title: text(
        "Title",
        "Title of the color bar with its unit, such as Curvature (1/m). \\n starts a new line. "
        "Empty: the name of the quantity",
        update=_show_keys,
    )
    key_legend: toggle(
        "Singularities",
        "Show the dots of all indices that are visible in the picture",
        default=True,
        update=_show_keys,
    )
    key_counts: toggle(
        "Counts", "Say how many singularities of each index are visible", update=_show_keys
    )
    key_scale: toggle(
        "Scale Bar",
        "Show a length in the units of the scene. Only for orthographic cameras: in perspective, "
        "lengths depend on the depth",
        default=True,
        update=_show_keys,
    )
    key_caption: text("Caption", "Text below the picture. \\n starts a new line", update=_show_keys)
    key_size: real(
        "Text Size",
        "Size of the text in pixels of the render. 0: 2.2 percent of the smaller side. It is "
        "smaller where there is not enough room",
        subtype="PIXEL",
        min=0,
        max=1000,
        soft_max=100,
        update=_show_keys,
    )
    device: choice("Device", "Device that draws the picture", DEVICE_ITEMS)
    undefined: toggle(
        "Skip Bad Vectors",
        "Treat vectors that are not finite as undefined, instead of reporting an error",
    )
    exposure: real(
        "Exposure",
        "Brightness of the lights of the scene in stops: 1 doubles it. At 0, the brightest tenth of the lit "
        "surface is white",
        min=-10,
        max=10,
        soft_min=-3,
        soft_max=3,
    )
    color_attribute: text(
        "Attribute",
        "Attribute on points, faces or corners of the meshes whose numbers are colors. "
        "Objects without it are gray or have the color of the ink",
    )
    tone_attribute: text(
        "Attribute",
        "Attribute on points, faces or corners of the meshes. Empty: the active color "
        "attribute. Objects without it use the light",
    )
    tone_picture: text(
        "Picture",
        "Picture of the scene through its camera, such as a render. # characters are "
        "replaced by the frame number",
        subtype="FILE_PATH",
        options=PATH_OPTIONS,
    )
    remember_live: toggle(
        "Remember in File",
        "Save which views are live with the file, and show them again when it is opened",
        default=True,
    )
    live_views: bpy.props.StringProperty(
        description="Views that were live when the file was saved: index of the area and name of the "
        "screen, one view in each line",
        options={"HIDDEN"},
    )
    bakes: bpy.props.CollectionProperty(type=RosyBake)
    strokes: bpy.props.PointerProperty(type=RosyStrokes)


class RosyMesh(bpy.types.PropertyGroup):
    """How the field of a mesh is stored: its degree, and the attribute that holds it."""

    degree: integer(
        "Degree",
        "Number of directions of the field at each point",
        min=1,
        max=MAX_DEGREE,
        default=DEFAULT_DEGREE,
    )
    attribute: text(
        "Attribute", "Name of the mesh attribute that holds the field", default=DEFAULT_FIELD_NAME
    )


def _own_preset(description: str) -> Any:
    """Return the property for the preset of an object or a collection."""
    search = preset_library.search_presets
    return text("Own Look", description, search=search, search_options={"SUGGESTION"})


class RosyCollection(bpy.types.PropertyGroup):
    """Settings of a collection: the preset of its objects."""

    preset: _own_preset("Preset of the objects in this collection. Empty: the look of the scene")


class RosyObject(bpy.types.PropertyGroup):
    """Settings of an object with a field: whether and how it is drawn, its tone image, and its UV maps."""

    preset: _own_preset("Preset of this object. Empty: the look of its collection or of the scene")

    include: toggle(
        "Draw the Field",
        "Draw the field of this object. Otherwise the object only hides others",
        default=True,
    )
    tone_image: bpy.props.PointerProperty(
        name="Image",
        description="Image of the tone of this object. Objects without one use the light",
        type=bpy.types.Image,
    )
    tone_uv_map: text("UV Map", "UV map of the image. Empty: the active UV map")
    texture_uv_map: text("UV Map", "UV map of the texture. Empty: the active UV map")
    field_mesh: bpy.props.PointerProperty(
        name="Field Mesh",
        description="The faces with modifiers, with the field. Empty: the mesh of the object has the field",
        type=bpy.types.Mesh,
    )


#: The classes of this module, in the order of their definition.
CLASSES = tuple(
    value
    for value in list(globals().values())
    if isinstance(value, type) and issubclass(value, bpy.types.PropertyGroup)
)
POINTER_PROPERTIES = (
    (bpy.types.Scene, RosyScene),
    (bpy.types.Mesh, RosyMesh),
    (bpy.types.Object, RosyObject),
    (bpy.types.Collection, RosyCollection),
    (bpy.types.NodeTree, RosyNodeTree),
)


_register_classes, _unregister_classes = bpy.utils.register_classes_factory(CLASSES)


def register() -> None:
    """Add the properties to Blender."""
    _register_classes()
    for id_type, group in POINTER_PROPERTIES:
        id_type.rosy = bpy.props.PointerProperty(type=group, name="RoSy")
    INPUT_LISTERS.append(input_files)


def unregister() -> None:
    """Remove the properties."""
    INPUT_LISTERS.remove(input_files)
    for id_type, _ in POINTER_PROPERTIES:
        del id_type.rosy
    _unregister_classes()


def ensure_registered() -> None:
    """Add the properties, unless the enabled extension has added them. Scripts and commands call this.

    They are removed when Python exits, because Blender's Python module cannot free them later.
    """
    if not has_rosy_properties():
        register()
        atexit.register(_unregister_if_registered)


def _unregister_if_registered() -> None:
    if has_rosy_properties():
        unregister()
