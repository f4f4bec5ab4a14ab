"""Keys (legends) on a plane in front of a camera: color scale, kinds of singularities, scale bar, caption."""

from collections.abc import Callable
from dataclasses import replace
from functools import cache

import bpy
import numpy as np
from bpy.types import ID, Image, Material, Object, PropertyGroup, Scene, UnitSettings, World

from ..annotation.draw_key import DARK_PLATES, LIGHT_PLATES, KeyColors, draw_key
from ..annotation.key_contents import PictureKey
from ..annotation.key_layout import KeyParts, lay_out_key
from ..annotation.round_numbers import format_number, round_below
from ..compositor.picture import Picture
from ..core.color import LUMINANCE_WEIGHTS
from ..projection.camera import Camera
from ..rendering.picture_images import picture_image
from . import camera_planes
from .blender_images import new_image
from .datablocks import KEY_TAG, rollback_on_error
from .look_properties import backdrop_color, read_look
from .meshes import read_collection, vertex_positions
from .node_builder import first_node, new_empty_material

#: Distance of the plane of a key from the camera, as a multiple of the distance of the near clip plane.
DISTANCE = 1.02

#: Longest side of the image of a key, in pixels. For larger renders the image is scaled up.
MAX_SIDE = 4096

#: Largest length of a scale bar, as a fraction of the width of the frame.
MAX_SCALE = 0.2

#: Meters in a foot and in an inch.
FOOT, INCH = 0.3048, 0.0254

#: Linear luminance below which a background counts as dark.
DARK_BACKGROUND = 0.18


#: A function that returns the triangles of a text; see `text_triangles`.
TextShapes = Callable[[str], np.ndarray]


def update_camera_planes(scene: Scene) -> None:
    """Replace the backdrops and the keys of a scene by the ones that its settings ask for."""
    camera_planes.update_backdrops(scene)
    update_keys(scene)


def update_keys(scene: Scene) -> None:
    """Replace the keys of a scene by the ones that its settings ask for.

    If keys are switched on, a key is added for each of `pictured_views`. It explains the picture as it was
    baked, whatever the settings are now.
    """
    camera_planes.remove_camera_planes(scene, KEY_TAG)
    if not scene.rosy.key:
        return
    triangles = cache(text_triangles)
    for camera, view, record in camera_planes.pictured_views(scene):
        _add_key(scene, camera, view, record, triangles)


def _add_key(
    scene: Scene, camera: Object, view: Camera, record: PropertyGroup, triangles: TextShapes
) -> None:
    """Add a plane with a key, parented to a camera. Nothing is added if the key would be empty.

    `record` is the record of the picture, and `triangles` a function that returns the triangles of a text.
    """
    picture = _draw(scene, view, record, triangles)
    if picture is None:
        return
    name = f"RoSy Key {camera.name}"
    corners = camera_planes.frame_corners(view, DISTANCE * camera.data.clip_start)
    image_data = picture_image(picture, as_float=False)
    with rollback_on_error() as track:
        image = track(new_image(name, image_data))
        material = track(_new_material(name, image, scene.rosy.emission or 1.0))
        obj = camera_planes.add_camera_plane(scene, camera, KEY_TAG, corners, material, track)
    # With Solid shading, 3D views would draw the plane opaque, so only its bounds are drawn.
    obj.display_type = "BOUNDS"
    for probe in ("hide_probe_volume", "hide_probe_sphere", "hide_probe_plane"):
        setattr(obj, probe, True)


def _draw(
    scene: Scene, view: Camera, record: PropertyGroup, triangles: TextShapes
) -> Picture | None:
    """Draw a key as a picture that fills the frame of the camera. Return None if the key would be empty.

    `record` is the record of the picture, and `triangles` a function that returns the triangles of a text.
    """
    settings = scene.rosy
    shrink = min(1.0, MAX_SIDE / max(view.width, view.height))
    width, height = (max(round(side * shrink), 1) for side in (view.width, view.height))
    key = PictureKey.from_json(record.key)
    scale = key.color_scale if settings.key_bar else None
    if scale is not None:
        title = _lines(settings.key_title) if settings.key_title.strip() else scale.title
        scale = replace(scale, title=title or settings.color_attribute)
    parts = KeyParts(
        scale,
        key.indices if settings.key_legend else (),
        key.dot_size * width / max(record.width, 1),
        settings.key_counts,
        _scale_bar(scene, view, width) if settings.key_scale else None,
        _lines(settings.key_caption),
    )

    def width_of(text: str) -> float:
        return float(triangles(text)[..., 0].max(initial=0.0))

    layout = lay_out_key(parts, (width, height), width_of, settings.key_size * shrink)
    if not layout.plates:
        return None
    rgba = np.zeros((height, width, 4), dtype=np.float32)
    draw_key(rgba, layout, scale, triangles, _key_colors(scene))
    return Picture(rgba)


def _lines(text: str) -> str:
    """Return a text with line breaks where the user has typed ``\\n``."""
    return text.replace("\\n", "\n")


# --- scale bar -----------------------------------------------------------------------------------


def _scale_bar(scene: Scene, view: Camera, width: int) -> tuple[float, str] | None:
    """Return the length of the scale bar in pixels and its label; None for perspective cameras.

    `width` is the width of the picture of the key in pixels. The picture fills the frame of the camera.
    """
    if view.projection[3, 2] != 0:
        return None
    frame = 2 / abs(view.projection[0, 0])  # width in Blender units
    length, label = round_length(MAX_SCALE * frame, scene.unit_settings)
    return length / frame * width, label


def round_length(largest: float, units: UnitSettings) -> tuple[float, str]:
    """Return the largest round length that is at most a given one, and its label in the units of a scene.

    Round lengths are 1, 2 and 5 times a power of ten, in meters, feet, inches or Blender units.

    Parameters
    ----------
    largest : float
        Largest allowed length in Blender units.
    units : bpy.types.UnitSettings

    Returns
    -------
    length : float
        Blender units.
    label : str
    """
    if units.system == "NONE":
        length = round_below(largest)
        return length, format_number(length, 1)
    meters = largest * units.scale_length
    unit = 1.0 if units.system == "METRIC" else FOOT if meters >= FOOT else INCH
    length = unit * round_below(meters / unit)
    label = bpy.utils.units.to_string(units.system, "LENGTH", length, precision=6)
    return length / units.scale_length, label.strip()


# --- colors --------------------------------------------------------------------------------------


def _key_colors(scene: Scene) -> KeyColors:
    """Return the colors of a key: dark panels if the background is known to be dark, light ones otherwise."""
    background = backdrop_color(scene, read_look(scene.rosy))
    if background is None:
        background = None if scene.render.film_transparent else _world_color(scene.world)
    is_dark = background is not None and background @ LUMINANCE_WEIGHTS < DARK_BACKGROUND
    return DARK_PLATES if is_dark else LIGHT_PLATES


def _world_color(world: World | None) -> np.ndarray | None:
    """Return the (3,) linear color of a world; None if nodes vary it. Without a world it is black."""
    if world is None:
        return np.zeros(3, dtype=np.float32)
    node = first_node(world.node_tree if world.use_nodes else None, "ShaderNodeBackground")
    if node is None:
        return np.array(world.color, dtype=np.float32)
    color, strength = node.inputs["Color"], node.inputs["Strength"]
    if color.is_linked or strength.is_linked:
        return None
    return np.array(color.default_value[:3], dtype=np.float32) * strength.default_value


def _new_material(name: str, image: Image, strength: float) -> Material:
    """Create a material that emits an image with its alpha. Seen from behind it is fully transparent.

    `strength` is the strength of the emission.
    """
    material, build = new_empty_material(name)
    material[KEY_TAG] = True
    material.diffuse_color = (1.0, 1.0, 1.0, 0.0)
    material.use_backface_culling = True
    material.surface_render_method = "BLENDED"
    # The plane has no UV map, but its generated coordinates run from 0 to 1 between its corners.
    image_node = build.frame_image(image, build("ShaderNodeTexCoord").outputs["Generated"])
    color = image_node.outputs["Color"]
    emission = build("ShaderNodeEmission", {"Color": color, "Strength": strength})
    transparent = build("ShaderNodeBsdfTransparent")
    backfacing = build("ShaderNodeNewGeometry").outputs["Backfacing"]
    is_front = build.math("SUBTRACT", 1.0, backfacing)
    opacity = build.math("MULTIPLY", image_node.outputs["Alpha"], is_front)
    shader = build.mix_shaders(opacity, transparent.outputs["BSDF"], emission.outputs["Emission"])
    build("ShaderNodeOutputMaterial", {"Surface": shader})
    return material


#: Number of points on each curve segment of a letter, enough for large letters.
CURVE_RESOLUTION = 6


def text_triangles(text: str) -> np.ndarray:
    """Return (n, 3, 2) triangles of a text of font size 1, in Blender's built-in font.

    Its left end and baseline are at the origin.
    """
    fonts = set(bpy.data.fonts)
    curve = bpy.data.curves.new("RoSy text", type="FONT")
    created: list[ID] = [curve]
    try:
        curve.body = text
        curve.resolution_u = CURVE_RESOLUTION
        obj = bpy.data.objects.new(curve.name, curve)  # not linked to any scene
        created.insert(0, obj)
        mesh = obj.to_mesh()
        mesh.calc_loop_triangles()
        points = vertex_positions(mesh)[:, :2].astype(np.float64)
        triangles = points[read_collection(mesh.loop_triangles, "vertices", np.int32, 3)]
    finally:
        # Removing the object also frees its mesh. Creating the curve may have loaded the font.
        bpy.data.batch_remove([*created, *(set(bpy.data.fonts) - fonts)])
    if len(triangles):
        triangles[..., 0] -= triangles[..., 0].min()
    return triangles
