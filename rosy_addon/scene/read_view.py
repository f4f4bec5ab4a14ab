"""Read a scene as the input of a renderer: one `ViewInput` per camera, with the lights of the scene."""

from collections.abc import Sequence
from typing import Any

import bpy
import numpy as np
from bpy.types import Depsgraph, Object, Scene

from ..compositor.look import Look
from ..compositor.shading import Light, metered
from ..core.cache import BAKE_CACHE, Cache
from ..core.errors import RosyError
from ..projection.gbuffer import MeshInstance
from ..rendering.view_input import ViewInput
from .cameras import CameraSource, render_camera, resolve_camera
from .look_inputs import ReadRequest, load_reference, nonfinite_policy, read_request
from .look_properties import drift_in_scene, object_looks
from .meshes import evaluated_mesh, read_uvs
from .scene_reader import SceneData, read_scene


def read_views(
    scene: Scene,
    depsgraph: Depsgraph,
    cameras: Sequence[CameraSource],
    look: Look,
    *,
    objects: Sequence[Object] | None = None,
    size: tuple[int, int] | None = None,
    cache: Cache | None = None,
) -> tuple[tuple[ViewInput, ...], SceneData]:
    """Read a scene as the input of a renderer, for one or more cameras. Each mesh is read only once.

    Parameters
    ----------
    scene : bpy.types.Scene
    depsgraph : bpy.types.Depsgraph
        Depsgraph of a view layer of the scene.
    cameras : sequence of bpy.types.Object or Camera
        Cameras from which pictures will be drawn; see `resolve_camera`.
    look : Look
        Lights, tones, values for the color map, and the reference render are read only if it uses them.
    objects : sequence of bpy.types.Object, optional
        Objects whose fields are drawn. By default all visible objects with a field. All other objects only
        hide what is behind them.
    size : (int, int), optional
        Width and height in pixels; see `resolve_camera`.
    cache : Cache, optional
        Keeps meshes, fields and tones that have not changed since an earlier reading.

    Returns
    -------
    views : tuple of ViewInput
        One per camera. They share their mesh instances.
    scene_data : SceneData
        The mesh instances, and the objects that they come from.

    Raises
    ------
    RosyError
        If two cameras have the same name, or for the reasons of `resolve_camera`, `read_scene` and
        `load_reference`.
    """
    resolved_cameras = [resolve_camera(scene, depsgraph, camera, size) for camera in cameras]
    names = [camera.name for camera in resolved_cameras]
    repeated = next((name for name in names if names.count(name) > 1), None)
    if repeated is not None:
        raise RosyError(
            f"several cameras have the name '{repeated}', and their pictures would replace each other: "
            "rename them in their libraries, or draw from one"
        )
    scene_data = read_scene(depsgraph, objects, read_request(scene, look), cache)
    reference = None
    if look.tone == "picture":
        reference = load_reference(scene, depsgraph, render_camera(scene))
    instances = tuple(scene_data.instances)
    drift = drift_in_scene(scene, look, scene.frame_current_final)
    lights, views = lights_for(scene, depsgraph, look, instances), []
    looks = object_looks(scene, scene_data.objects, look)
    is_mixed = any(one != look for one in looks)
    looks = (*looks, *[look] * (len(instances) - len(looks))) if is_mixed else ()
    for camera in resolved_cameras:
        in_view = tuple(light.transformed(camera.view) for light in lights)
        views.append(
            ViewInput(instances, camera, look, in_view, reference, drift=drift, looks=looks)
        )
    return tuple(views), scene_data


def read_turntable(
    scene: Scene, depsgraph: Depsgraph, obj: Object, look: Look
) -> tuple[MeshInstance, tuple[Light, ...]]:
    """Read one object and the lights of the scene, for views of the object from all sides.

    Returns
    -------
    instance : MeshInstance
        The object's mesh with its field, in world space.
    lights : tuple of Light
        See `lights_for`.

    Raises
    ------
    RosyError
        See `read_scene`.
    """
    scene_data = read_scene(depsgraph, [obj], read_request(scene, look))
    return scene_data.instances[0], lights_for(scene, depsgraph, look, scene_data.instances)


def scene_depsgraph(scene: Scene) -> Depsgraph:
    """Return the evaluated depsgraph of a scene.

    If the scene is the current one, its current view layer is evaluated, otherwise its first view layer.
    """
    context = bpy.context
    if context.scene == scene:
        return context.evaluated_depsgraph_get()
    with context.temp_override(scene=scene, view_layer=scene.view_layers[0]):
        return context.evaluated_depsgraph_get()


def lights_for(
    scene: Scene, depsgraph: Depsgraph, look: Any, instances: Sequence[MeshInstance]
) -> tuple[Light, ...]:
    """Return the lights of a scene in world space, scaled by `metered` to the brightness of mesh instances.

    `look` is a `Look` or a `StrokeStyle`. If it does not use the lights of the scene, the result is empty.
    """
    lights = read_lights(depsgraph) if look.light == "scene" else ()
    return metered(lights, instances, scene.rosy.exposure)


def read_lights(depsgraph: Depsgraph) -> list[Light]:
    """Return all lights that are visible in renders, including instances, in world space.

    A white diffuse surface that faces a sun with a strength of pi W/m2 has a radiance of 1. At the distance r
    from a point light of power P, it has a radiance of P / (4 pi^2 r^2). Spots and area lights are treated as
    point lights. An area light counts as a point light of four times its power: on the axis of the area
    light, this gives the same radiance.

    Parameters
    ----------
    depsgraph : bpy.types.Depsgraph

    Returns
    -------
    list of Light
    """
    return [light for light, _ in rendered_lights(depsgraph)]


def rendered_lights(depsgraph: Depsgraph) -> list[tuple[Light, Object]]:
    """Return the lights of `read_lights`, each with its original object."""
    lights = []
    for instance in depsgraph.object_instances:
        obj = instance.object
        if obj.type == "LIGHT" and not obj.original.hide_render and instance.show_self:
            matrix = np.array(instance.matrix_world)
            lights.append((_convert_light(obj.data, matrix), obj.original))
    return lights


def _convert_light(data: bpy.types.Light, matrix: np.ndarray) -> Light:
    """Convert a light of Blender to a `Light`. `matrix` transforms its local space to world space."""
    has_temperature = getattr(data, "use_temperature", False)
    temperature_color = data.temperature_color if has_temperature else np.ones(3)
    color = np.array(data.color) * np.array(temperature_color)
    energy = data.energy * 2.0 ** getattr(data, "exposure", 0.0)
    if data.type == "SUN":
        direction = matrix[:3, 2] / np.linalg.norm(matrix[:3, 2])
        return Light("sun", direction, color, energy / np.pi, data.use_shadow)
    axial_gain = 4.0 if data.type == "AREA" else 1.0
    strength = axial_gain * energy / (4 * np.pi**2)
    return Light("point", matrix[:3, 3].copy(), color, strength, data.use_shadow)


def read_texture_input(
    scene: Scene, depsgraph: Depsgraph, obj: Object, uv_map: str, color_attribute: str | None
) -> tuple[MeshInstance, np.ndarray]:
    """Read an evaluated object with its field, and the UV map of its texture.

    `uv_map` is the name of the UV map; the active one if it is empty. `color_attribute` is the name of the
    attribute with the values for the color map; if it is None, no values are read. Surfaces and fields are kept
    in the cache of bakes.

    Returns
    -------
    instance : MeshInstance
        One instance of the object with its field, in world space.
    uv : (C, 2) float32 ndarray
        UV coordinates of the corners of the mesh.

    Raises
    ------
    RosyError
        If the evaluated object has no field, no UV map or no such attribute, for example because a modifier
        removes it.
    """
    request = ReadRequest(nonfinite_policy(scene), color_attribute=color_attribute)
    instance = read_scene(depsgraph, [obj], request, BAKE_CACHE).instances[0]
    BAKE_CACHE.evict_over_limit()
    with evaluated_mesh(obj.evaluated_get(depsgraph)) as mesh:
        uv = read_uvs(mesh, uv_map, f"object '{obj.name}'")
    return instance, uv
