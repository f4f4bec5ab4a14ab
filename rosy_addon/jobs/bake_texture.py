"""The job of textures: read objects with their UV maps, draw their fields, and apply the textures."""

from collections.abc import Sequence
from dataclasses import dataclass

from bpy.types import Image, Object, Scene

from ..core.errors import RosyError
from ..scene.look_inputs import color_attribute_of
from ..scene.look_properties import drift_in_scene, own_presets, read_look
from ..scene.meshes import uv_map_name
from ..scene.picture_state import bakes_light, read_texture_state
from ..scene.pictures import (
    apply_texture,
    check_files,
    check_targets,
    read_output_settings,
    texture_kind,
)
from ..scene.read_view import read_lights, read_texture_input, scene_depsgraph
from ..surface_texture.draw import TextureSettings, draw_texture_images, texture_colors_values
from ..worker.job import Call, Step, Steps, job, shares


@dataclass(frozen=True, eq=False)
class TextureResult:
    """The texture that was drawn for an object.

    Attributes
    ----------
    object : bpy.types.Object
    image : bpy.types.Image
    warnings : tuple of str
        Messages for the user.
    """

    object: Object
    image: Image
    warnings: tuple[str, ...]


@job
def bake_texture(scene: Scene, objects: Sequence[Object]) -> Steps[list[TextureResult]]:
    """Draw the fields of objects as textures for their UV maps, and show them on the objects.

    The settings in ``scene.rosy`` say what the textures show, their size and margin, the look, and how images
    are stored. The UV map of an object is named in ``object.rosy``. The scene is changed only after all
    textures are drawn. If the job is cancelled before, the scene is unchanged.

    Parameters
    ----------
    scene : bpy.types.Scene
    objects : sequence of bpy.types.Object
        Mesh objects with a field and a UV map.

    Returns
    -------
    list of TextureResult
        One result per object.

    Raises
    ------
    RosyError
        If an object has no field or no UV map, or a texture cannot be drawn or stored.
    """
    look, settings = read_look(scene.rosy), read_output_settings(scene)
    content = scene.rosy.texture_content.lower()
    uv_maps = {
        obj: uv_map_name(obj.data, obj.rosy.texture_uv_map, f"object '{obj.name}'")
        for obj in objects
    }
    check_targets(objects, settings)
    is_udim = scene.rosy.texture_udim
    check_files(settings, [obj.name for obj in objects], texture_kind(content), is_udim=is_udim)
    depsgraph = scene_depsgraph(scene)
    lights = None
    if bakes_light(scene.rosy, look):
        lights = read_lights(depsgraph)  # in world space
        if not lights:
            raise RosyError(f"scene '{scene.name}' has no lights: add one, or turn Bake Light off")
    drift = drift_in_scene(scene, look, scene.frame_current_final)
    texture_settings = TextureSettings(
        scene.rosy.texture_size, scene.rosy.texture_margin, is_udim, content, drift
    )
    has_colors = texture_colors_values(look, content)
    color_attribute = color_attribute_of(scene, look) if has_colors else None
    drawn = []
    for (obj, uv_map), start, stop in shares(uv_maps.items(), 0.98):
        instance, uv = read_texture_input(scene, depsgraph, obj, uv_map, color_attribute)
        state = read_texture_state(scene, depsgraph, obj)
        inputs = instance, uv, look, texture_settings, lights, settings.as_float
        texture = yield Call(draw_texture_images, inputs, start, stop)
        drawn.append((obj, uv_map, texture, state))
    yield Step(0.98, "applying the textures")
    results = []
    presets = own_presets(scene, [obj for obj, *_ in drawn])
    other_look = (
        ("textures have the look of the scene, not those of objects",) if any(presets) else ()
    )
    for obj, uv_map, texture, state in drawn:
        image = apply_texture(scene, obj, uv_map, texture, state, look, texture_settings, settings)
        results.append(TextureResult(obj, image, (*filter(None, [texture.note]), *other_look)))
    return results
