"""The job of textures: read objects with their UV maps, draw their fields, and apply the textures."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import bpy
import numpy as np

from .cache import BAKE_CACHE
from .compositor.look import Look
from .compositor.shading import Light
from .errors import RosyError
from .image_io.png import png_bytes
from .progress import Progress, Task, as_task, run_to_completion, subtask
from .scene.blender_images import ImageData
from .scene.color_inputs import color_attribute_of
from .scene.lights import read_lights
from .scene.look_properties import read_look
from .scene.picture_state import bakes_light, read_texture_state
from .scene.pictures import OutputSettings, check_targets, read_output_settings
from .scene.read_view import scene_depsgraph
from .scene.textures import Hatching, apply_texture, read_texture_input, uv_map_name
from .surface_texture.draw import draw_texture, texture_colors_values


@dataclass(frozen=True, eq=False)
class TextureResult:
    """The texture of an object.

    Attributes
    ----------
    object : bpy.types.Object
    image : bpy.types.Image
    warnings : tuple of str
        Messages for the user.
    """

    object: bpy.types.Object
    image: bpy.types.Image
    warnings: tuple[str, ...]


def bake_texture_task(
    scene: bpy.types.Scene,
    objects: Sequence[bpy.types.Object],
    depsgraph: bpy.types.Depsgraph | None = None,
    *,
    look: Look | None = None,
    settings: OutputSettings | None = None,
) -> Task[list[TextureResult]]:
    """Draw the fields of objects as textures for their UV maps, and show them on the objects.

    What the textures show, their size and their margin are set in the scene, and the UV map on the object.
    The scene is changed in the last step. Closing the generator earlier leaves it unchanged.

    Parameters
    ----------
    scene : bpy.types.Scene
    objects : sequence of bpy.types.Object
        Meshes with a field.
    depsgraph : bpy.types.Depsgraph, optional
        By default `scene_depsgraph`.
    look : Look, optional
        By default the scene's.
    settings : OutputSettings, optional
        How the textures are stored; by default as the pictures of the scene.

    Yields
    ------
    Progress

    Returns
    -------
    list of TextureResult

    Raises
    ------
    RosyError
        If an object has no field or no UV map, or the texture cannot be drawn or stored.
    """
    look = read_look(scene.rosy) if look is None else look
    content = scene.rosy.texture_content.lower()
    settings = read_output_settings(scene) if settings is None else settings
    for obj in objects:
        uv_map_name(obj)
    check_targets(objects, settings)
    yield Progress(0.0, "reading the scene")
    depsgraph = scene_depsgraph(scene) if depsgraph is None else depsgraph
    lights = _lights_to_bake(scene, depsgraph) if bakes_light(scene.rosy, look) else None
    size, margin = scene.rosy.texture_size, scene.rosy.texture_margin
    is_udim = scene.rosy.texture_udim
    colors = texture_colors_values(look, content)
    color_attribute = color_attribute_of(scene, look) if colors else None
    drawn = []
    for index, obj in enumerate(objects):
        start, stop = (0.98 * done / len(objects) for done in (index, index + 1))
        reading = as_task(read_texture_input, scene, depsgraph, obj, BAKE_CACHE, color_attribute)
        texture_input = yield from subtask(reading, start, start)
        state = read_texture_state(scene, depsgraph, obj)
        task = as_task(
            draw_texture,
            texture_input.instance,
            texture_input.uv,
            look,
            size,
            margin=margin,
            is_udim=is_udim,
            content=content,
            lights=lights,
            cache=BAKE_CACHE,
        )
        texture = yield from subtask(task, start, stop)
        tiles = {}
        for number, rgba in texture.tiles().items():
            png = None
            if not settings.as_float:
                png = yield from subtask(
                    as_task(png_bytes, rgba, is_color=not texture.is_data), stop, stop
                )
            tiles[number] = ImageData(rgba, png)
        note = texture.overlap_note(f"object '{obj.name}'")
        warnings = (note,) if note else ()
        hatching = None
        if content == "look" and texture.is_data:
            hatching = Hatching(look, texture.line_count)
        drawn.append((texture_input.source, tiles, state, hatching, warnings))
    BAKE_CACHE.evict_over_limit()
    yield Progress(0.98, "applying the textures")
    return [
        TextureResult(
            source.obj,
            apply_texture(
                scene, source, tiles, settings, state, content, hatching, is_udim=is_udim
            ),
            warnings,
        )
        for source, tiles, state, hatching, warnings in drawn
    ]


def _lights_to_bake(scene: bpy.types.Scene, depsgraph: bpy.types.Depsgraph) -> list[Light]:
    """Return the lights of a scene, in world space.

    Raises
    ------
    RosyError
        If there are none.
    """
    lights = read_lights(depsgraph, np.eye(4))
    if not lights:
        raise RosyError(f"scene '{scene.name}' has no lights: add one, or turn Bake Light off")
    return lights


def bake_texture(
    scene: bpy.types.Scene,
    objects: Sequence[bpy.types.Object],
    depsgraph: bpy.types.Depsgraph | None = None,
    *,
    look: Look | None = None,
    settings: OutputSettings | None = None,
) -> list[TextureResult]:
    """Run `bake_texture_task` to its end."""
    return run_to_completion(
        bake_texture_task(scene, objects, depsgraph, look=look, settings=settings)
    )
