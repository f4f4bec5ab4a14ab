"""Textures on objects: read a mesh with its UV map, and show the texture on the object.

A texture is shown like a picture, by RoSy's modifier at the end of the object's stack. The user's mesh,
material slots and modifiers are not changed. Its record is among those of the pictures of the scene.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial

import bpy
import numpy as np

from ..core.cache import Cache
from ..core.errors import RosyError
from ..image_io.image_data import ImageData, image_size
from ..projection.gbuffer import MeshInstance
from .bake_records import DrawnFrom, recorded_materials, store_record
from .blender_images import new_image, new_tiled_image
from .file_names import picture_stem
from .meshes import evaluated_mesh, read_uvs
from .owned_data import delete_unused, rollback_on_error
from .picture_nodes import new_group, set_picture_modifier
from .picture_state import PictureState
from .pictures import OutputSettings
from .read_request import ReadRequest, nonfinite_policy
from .scene_reader import read_scene
from .texture_nodes import (
    Hatching,
    brushed_metal_shader,
    color_shader,
    hatching_shader,
    new_texture_material,
)


def uv_map_name(obj: bpy.types.Object) -> str:
    """Return the name of the UV map that the texture of an object is for.

    Raises
    ------
    RosyError
        If there is none.
    """
    name, layers = obj.rosy.texture_uv_map, obj.data.uv_layers
    layer = layers.get(name) if name else layers.active
    if layer is None:
        missing = f"no UV map '{name}'" if name else "no UV map"
        raise RosyError(f"object '{obj.name}': has {missing}: unwrap its mesh first")
    return layer.name


def read_texture_input(
    scene: bpy.types.Scene,
    depsgraph: bpy.types.Depsgraph,
    obj: bpy.types.Object,
    uv_map: str,
    cache: Cache,
    color_attribute: str | None,
) -> tuple[MeshInstance, np.ndarray]:
    """Read an object with a field, and the UV map of its texture, as it is evaluated.

    If `color_attribute` is given, the numbers of this attribute are read for the color map.

    Returns
    -------
    instance : MeshInstance
        With a field, in world space. If the object has several instances, one of them.
    uv : (C, 2) float32 ndarray
        u and v at its corners.

    Raises
    ------
    RosyError
        If there is no field or no such attribute, or a modifier loses one of them or the UV map.
    """
    request = ReadRequest(nonfinite_policy(scene), color_attribute=color_attribute)
    instance = read_scene(depsgraph, [obj], request, cache).instances[0]
    with evaluated_mesh(obj.evaluated_get(depsgraph)) as mesh:
        uv = read_uvs(mesh, uv_map, f"object '{obj.name}'", "the texture")
    return instance, uv


def apply_texture(
    scene: bpy.types.Scene,
    obj: bpy.types.Object,
    uv_map: str,
    tiles: Mapping[int, ImageData],
    settings: OutputSettings,
    state: PictureState,
    content: str,
    hatching: Hatching | None,
    *,
    is_udim: bool,
) -> bpy.types.Image:
    """Show a texture on its object, and return its image. An older one is replaced.

    If an error is raised, the scene is not changed.

    Parameters
    ----------
    scene : bpy.types.Scene
    obj : bpy.types.Object
    uv_map : str
        Name of the UV map.
    tiles : mapping of int to ImageData
        One picture, or UDIM tiles by their numbers.
    settings : OutputSettings
    state : PictureState
    content : str
        What the image shows; see `surface_texture.draw.CONTENTS`.
    hatching : Hatching or None
        How hatching is drawn, if the image has thresholds of ink and not colors.
    is_udim : bool
        Whether the image has UDIM tiles.

    Raises
    ------
    RosyError
        If the file cannot be written.
    """
    name = f"RoSy {obj.name}"
    stem = None
    if settings.folder is not None:
        kind = "texture" if content == "look" else content
        stem = settings.folder / picture_stem(obj.name, kind)
    with rollback_on_error() as created:
        is_color = content == "look" and hatching is None
        first = next(iter(tiles.values()))
        arguments = {"as_float": settings.as_float, "is_color": is_color, "stem": stem}
        if is_udim:
            image = new_tiled_image(name, tiles, **arguments)
        else:
            image = new_image(name, first, **arguments)
        created.append(image)
        add_shader = color_shader
        if content == "anisotropy":
            add_shader = partial(brushed_metal_shader, uv_map=uv_map)
        elif hatching is not None:
            add_shader = partial(hatching_shader, hatching=hatching, created=created)
        material = new_texture_material(name, image, uv_map, add_shader)
        created.append(material)
        node_group = new_group(name, material, None)
        created.append(node_group)
    drawn_from = DrawnFrom(obj, {None: state}, "cpu", is_texture=True)
    store_record(scene, obj.name, image, material, drawn_from, size=image_size(first))
    # The object keeps its pictures, but no other texture.
    set_picture_modifier(obj, node_group, recorded_materials(textures=False))
    delete_unused()
    return image
