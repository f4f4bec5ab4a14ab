"""The main job: read the scene, draw its fields, and apply the pictures to the objects."""

from collections.abc import Sequence
from dataclasses import replace

from bpy.types import Object, Scene

from ..compositor.ink_thresholds import unlit_look
from ..compositor.look import Look, is_hatched
from ..core.cache import BAKE_CACHE
from ..core.errors import RosyError
from ..gpu.select import image_steps, select_device
from ..scene import pictures
from ..scene.cameras import CameraSource, render_camera
from ..scene.keys import update_camera_planes
from ..scene.look_properties import read_look
from ..scene.picture_state import SceneState
from ..scene.read_view import read_views, scene_depsgraph
from ..worker.job import Step, Steps, job, part, shares


@job
def bake(
    scene: Scene,
    *,
    objects: Sequence[Object] | None = None,
    cameras: Sequence[CameraSource] | None = None,
    look: Look | None = None,
    size: tuple[int, int] | None = None,
    settings: pictures.OutputSettings | None = None,
    workers: int = 0,
) -> Steps[list[pictures.BakeResult]]:
    """Draw the fields of a scene and apply the pictures to the objects.

    The scene is read before the first picture is drawn, and changed only after the last one is drawn. If the
    job is cancelled before, the scene is unchanged.

    Parameters
    ----------
    scene : bpy.types.Scene
    objects : sequence of bpy.types.Object, optional
        Objects whose fields are drawn. By default all visible objects with a field. All other objects only
        hide what is behind them.
    cameras : sequence of bpy.types.Object or Camera, optional
        The cameras from which pictures are drawn. By default the active camera of the scene. A `Camera` has
        its own size, which is used instead of `size`; `camera_of_view` makes one from a 3D view.
    look : Look, optional
        Settings of the drawing. By default the look of the scene.
    size : (int, int), optional
        Width and height in pixels of the pictures. By default the render resolution of the scene, scaled by
        the percentage for pictures in RoSy's settings (``scene.rosy.percentage``).
    settings : OutputSettings, optional
        How the pictures are stored and applied. By default the settings of the scene.
    workers : int
        Number of processes that draw a large picture together. 0 means one per processor core.

    Returns
    -------
    list of BakeResult
        One result per camera. The objects show the picture from the last camera.

    Raises
    ------
    RosyError
        If there is nothing to draw, or a picture cannot be drawn or applied; see `read_views`,
        `select_device`, `picture_steps` and `check_targets`.
    """
    look = read_look(scene.rosy) if look is None else look
    settings = pictures.read_output_settings(scene) if settings is None else settings
    draws_thresholds = settings.relight and is_hatched(look)
    if draws_thresholds:
        look, settings = unlit_look(look), replace(settings, device="cpu")
    sources = [render_camera(scene)] if cameras is None else list(cameras)
    depsgraph = scene_depsgraph(scene)
    views, scene_data = read_views(
        scene, depsgraph, sources, look, objects=objects, size=size, cache=BAKE_CACHE
    )
    BAKE_CACHE.evict_over_limit()
    if draws_thresholds and views[0].looks:
        raise RosyError(
            "objects have looks of their own, and Relight draws one: switch Relight off"
        )
    pictures.check_targets(scene_data.objects, settings)
    pictures.check_files(settings, [view.camera.name for view in views])
    scene_state = SceneState(scene, depsgraph, scene_data.mesh_states)
    states = [scene_state.picture_state(scene, depsgraph, source) for source in sources]
    device = "cpu" if views[0].looks else select_device(settings.device, look)
    drawings = []
    for (view, source, state), start, stop in shares(
        zip(views, sources, states, strict=True), 0.97
    ):
        view = replace(view, draws_thresholds=draws_thresholds)
        steps = image_steps(view, device, settings.as_float, workers=workers)
        picture, image_data = yield from part(steps, start, stop)
        drawings.append((view, picture, image_data, source, replace(state, device=device)))
    yield Step(0.97, "applying the pictures")
    results = [pictures.apply_picture(scene, scene_data, settings, *one) for one in drawings]
    update_camera_planes(scene)
    return results
