"""Textures on objects: read a mesh with its UV map, and show the texture on the object.

A texture is shown like a picture, by RoSy's modifier at the end of the object's stack. The user's mesh,
material slots and modifiers are not changed. Its record is among those of the pictures of the scene.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import bpy
import numpy as np

from ..cache import Cache
from ..errors import RosyError
from ..image_io.image_data import ImageData
from ..projection.gbuffer import MeshInstance
from .bake_records import DrawnFrom, TextureSource, recorded_materials, store_record
from .blender_images import new_image, new_tiled_image
from .file_names import picture_stem
from .hatching_nodes import hatching_group
from .meshes import evaluated_mesh, read_uvs
from .owned_data import delete_unused, rollback_on_error
from .picture_nodes import new_group, set_picture_modifier
from .picture_state import PictureState
from .pictures import OutputSettings
from .read_request import ReadRequest, nonfinite_policy
from .scene_reader import read_scene
from .texture_nodes import (
    Hatching,
    new_anisotropy_material,
    new_hatching_material,
    new_texture_material,
)


@dataclass(frozen=True, eq=False)
class TextureInput:
    """What a texture is drawn from.

    Attributes
    ----------
    instance : MeshInstance
        With a field, in world space. If the object has several instances, one of them.
    uv : (C, 2) float32 ndarray
        u and v at its corners.
    source : TextureSource
    """

    instance: MeshInstance
    uv: np.ndarray
    source: TextureSource


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
    cache: Cache | None = None,
    color_attribute: str | None = None,
) -> TextureInput:
    """Read an object with a field, and the UV map of its texture, as it is evaluated.

    If `color_attribute` is given, the numbers of this attribute are read for the color map.

    Raises
    ------
    RosyError
        If there is no field, no UV map or no such attribute, or a modifier loses one of them.
    """
    name = uv_map_name(obj)
    request = ReadRequest(nonfinite_policy(scene), color_attribute=color_attribute)
    instance = read_scene(depsgraph, [obj], request, cache).instances[0]
    with evaluated_mesh(obj.evaluated_get(depsgraph)) as mesh:
        uv = read_uvs(mesh, name, f"object '{obj.name}'", "the texture")
    return TextureInput(instance, uv, TextureSource(obj, name))


def apply_texture(
    scene: bpy.types.Scene,
    source: TextureSource,
    tiles: Mapping[int, ImageData],
    settings: OutputSettings,
    state: PictureState,
    content: str = "look",
    hatching: Hatching | None = None,
    *,
    is_udim: bool = False,
) -> bpy.types.Image:
    """Show a texture on its object, and return its image. An older one is replaced.

    If an error is raised, the scene is not changed.

    Parameters
    ----------
    scene : bpy.types.Scene
    source : TextureSource
    tiles : mapping of int to ImageData
        One picture, or UDIM tiles by their numbers.
    settings : OutputSettings
    state : PictureState
    content : str
        What the image shows; see `surface_texture.draw.CONTENTS`.
    hatching : Hatching, optional
        How hatching is drawn, if the image has thresholds of ink and not colors.
    is_udim : bool
        Whether the image has UDIM tiles.

    Raises
    ------
    RosyError
        If the file cannot be written.
    """
    obj = source.obj
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
        if content == "anisotropy":
            material = new_anisotropy_material(name, image, source.uv_map)
        elif hatching is None:
            material = new_texture_material(name, image, source.uv_map)
        else:
            group, is_new = hatching_group()
            if is_new:
                created.append(group)
            material = new_hatching_material(name, image, source.uv_map, group, hatching)
        created.append(material)
        node_group = new_group(name, material, None)
        created.append(node_group)
    size = first.width, first.height
    store_record(
        scene, obj.name, image, material, DrawnFrom(source, {None: state}, "cpu"), size=size
    )
    # The object keeps its pictures, but no other texture.
    set_picture_modifier(obj, node_group, recorded_materials(textures=False))
    delete_unused()
    return image
