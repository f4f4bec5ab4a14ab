"""The main job: read the scene, draw its fields, and apply the pictures to the objects."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import bpy

from .cache import BAKE_CACHE
from .compositor.ink_thresholds import unlit_look
from .compositor.look import Look, is_hatched
from .compositor.picture_key import picture_key
from .gpu.select import select_renderer
from .progress import Progress, Task, as_task, run_to_completion, subtask
from .rendering.band_workers import BandWorkers
from .scene.backdrop import update_backdrops
from .scene.bake_records import DrawnFrom
from .scene.blender_images import compute_image_data
from .scene.cameras import CameraSource, render_camera
from .scene.keys import update_keys
from .scene.look_properties import look_at_frame, read_look
from .scene.picture_state import read_picture_states
from .scene.pictures import (
    BakeResult,
    OutputSettings,
    RenderedView,
    apply_picture,
    check_targets,
    read_output_settings,
)
from .scene.read_view import read_views, scene_depsgraph
from .scene.texture_nodes import Hatching

__all__ = ["BakeResult", "bake", "bake_task"]


def bake_task(
    scene: bpy.types.Scene,
    depsgraph: bpy.types.Depsgraph | None = None,
    *,
    objects: Sequence[bpy.types.Object] | None = None,
    cameras: Sequence[CameraSource] | None = None,
    look: Look | None = None,
    size: tuple[int, int] | None = None,
    settings: OutputSettings | None = None,
    workers: int = 0,
) -> Task[list[BakeResult]]:
    """Draw the fields of a scene and apply the pictures to the objects.

    The scene is read in the first step and changed in the last one. Closing the generator earlier
    leaves the scene unchanged.

    Parameters
    ----------
    scene : bpy.types.Scene
    depsgraph : bpy.types.Depsgraph, optional
        By default `scene_depsgraph`.
    objects : sequence of bpy.types.Object, optional
        Objects whose fields are drawn; by default all that have one. All other objects only occlude.
    cameras : sequence of bpy.types.Object or Camera, optional
        By default the scene's active camera. A `Camera` keeps its own size, as for a 3D view
        (`camera_of_view`).
    look : Look, optional
        By default the scene's.
    size : (int, int), optional
        Pixels; by default the size of renders times the scene's percentage for pictures.
    settings : OutputSettings, optional
        How the pictures are stored and applied; by default the scene's.
    workers : int
        Processes that draw large pictures together; 0 is one for each core.

    Yields
    ------
    Progress

    Returns
    -------
    list of BakeResult
        One per camera. The objects show the picture of the last one.

    Raises
    ------
    RosyError
        If there is nothing to draw or it cannot be drawn; see `read_views`, `select_renderer`,
        `Renderer.render_task` and `check_targets`.
    """
    look = look_at_frame(
        scene, read_look(scene.rosy) if look is None else look, scene.frame_current_final
    )
    settings = read_output_settings(scene) if settings is None else settings
    draws_thresholds = settings.relight and is_hatched(look)
    if draws_thresholds:
        look, settings = unlit_look(look), replace(settings, device="cpu")
    sources = [render_camera(scene)] if cameras is None else list(cameras)
    yield Progress(0.0, "reading the scene")
    depsgraph = scene_depsgraph(scene) if depsgraph is None else depsgraph
    reading = as_task(
        read_views, scene, depsgraph, sources, look, objects=objects, size=size, cache=BAKE_CACHE
    )
    scene_views = yield from subtask(reading, 0.0, 0.05)
    check_targets(scene_views.scene_data.objects, settings)
    states = read_picture_states(scene, depsgraph, sources)
    rendered_views = []
    with BandWorkers(workers) as pool:
        renderer = select_renderer(settings.device, look, BAKE_CACHE, workers=pool)
        for index, (source, view) in enumerate(zip(sources, scene_views.views, strict=True)):
            start, stop = (0.05 + 0.9 * finished / len(sources) for finished in (index, index + 1))
            view = replace(view, draws_thresholds=draws_thresholds)
            picture = yield from subtask(renderer.render_task(view), start, stop)
            image_task = as_task(compute_image_data, picture, as_float=settings.as_float)
            image_data = yield from subtask(image_task, stop, stop)
            drawn_from = DrawnFrom(
                source, {None: states[index]}, renderer.device_name, picture_key(look, picture)
            )
            hatching = Hatching(look, picture.line_count) if draws_thresholds else None
            rendered_views.append(
                RenderedView(picture, image_data, view.camera, drawn_from, hatching)
            )
    BAKE_CACHE.evict_over_limit()
    yield Progress(0.97, "applying the pictures")
    results = [
        apply_picture(scene, scene_views.scene_data, rendered_view, settings)
        for rendered_view in rendered_views
    ]
    update_backdrops(scene)
    update_keys(scene)
    return results


def bake(
    scene: bpy.types.Scene,
    depsgraph: bpy.types.Depsgraph | None = None,
    *,
    objects: Sequence[bpy.types.Object] | None = None,
    cameras: Sequence[CameraSource] | None = None,
    look: Look | None = None,
    size: tuple[int, int] | None = None,
    settings: OutputSettings | None = None,
    workers: int = 0,
) -> list[BakeResult]:
    """Run `bake_task` to its end."""
    return run_to_completion(
        bake_task(
            scene,
            depsgraph,
            objects=objects,
            cameras=cameras,
            look=look,
            size=size,
            settings=settings,
            workers=workers,
        )
    )
