"""The main job: read the scene, project it, compose the picture, apply it to the objects."""

from __future__ import annotations

from collections.abc import Sequence

import bpy

from .compositor.look import Look
from .gpu.painter import find_card, painting
from .progress import Progress, Work, drain, part
from .projection.camera import Camera, check_size
from .projection.gbuffer import Body, GBuffer
from .projection.project import projecting
from .reuse import KEPT
from .scene.apply import Baked, Settings, Shot, apply_picture, check_appliable, settings_of
from .scene.bodies import read_scene
from .scene.cameras import camera_of_object, picture_size, render_camera
from .scene.lights import read_lights
from .scene.looks import look_of
from .scene.tones import read_rendered, tone_wish

__all__ = ["Baked", "bake", "baking"]

Source = bpy.types.Object | Camera


def baking(
    scene: bpy.types.Scene,
    depsgraph: bpy.types.Depsgraph | None = None,
    *,
    objects: Sequence[bpy.types.Object] | None = None,
    cameras: Sequence[Source] | None = None,
    look: Look | None = None,
    size: tuple[int, int] | None = None,
    settings: Settings | None = None,
) -> Work[list[Baked]]:
    """Draw the fields of a scene and put the pictures on the objects.

    Nothing is changed in the scene until all pictures are there: closing the generator before
    leaves no trace. Blender's data is read in the first step, at once.

    Parameters
    ----------
    scene : bpy.types.Scene
    depsgraph : bpy.types.Depsgraph, optional
        That of the scene's view layer in the context, or else its first, if not given.
    objects : sequence of bpy.types.Object, optional
        Whose fields are drawn; all that have one if not given. Everything else hides.
    cameras : sequence of bpy.types.Object or Camera, optional
        From where; the camera that renders the scene if not given, `scene_cameras` for all. A
        `Camera` is taken in its own size, as for a 3D view (`camera_of_view`).
    look : Look, optional
        The scene's if not given.
    size : (int, int), optional
        Of the pictures in pixels; if not given, that of renders, in the percentage that
        ``scene.rosy`` says.
    settings : Settings, optional
        How the pictures get into the scene; as ``scene.rosy`` says if not given.

    Yields
    ------
    Progress

    Returns
    -------
    list of Baked
        One a camera; the objects show the last one's.

    Raises
    ------
    RosyError
        If there is nothing to draw or it cannot be drawn; see `read_scene`, `camera_of_object`,
        `read_rendered`, `painting` and `check_appliable`.
    """
    look = look_of(scene.rosy) if look is None else look
    settings = settings_of(scene) if settings is None else settings
    sources = [render_camera(scene)] if cameras is None else list(cameras)
    yield Progress(0.0, "reading the scene")
    depsgraph = scene_depsgraph(scene) if depsgraph is None else depsgraph
    views = [camera_view(scene, depsgraph, source, size) for source in sources]
    fine = [view.scaled(look.supersampling) for view in views]
    wish = tone_wish(scene, look)
    reading = read_scene(depsgraph, objects, undefined_of(scene), KEPT, wish)
    rendered = None
    if look.tone == "picture":
        rendered = read_rendered(scene, depsgraph, render_camera(scene), look)
    lights = [read_lights(depsgraph, view.view) for view in views]
    check_appliable(reading.owners, settings)
    card = find_card(settings.device, look)
    shots = []
    for number, source in enumerate(sources):
        start, stop = (0.05 + 0.9 * done / len(sources) for done in (number, number + 1))
        work = painting(
            card, reading.bodies, fine[number], look, lights[number], _projecting, rendered
        )
        picture = yield from part(work, start, stop)
        shots.append(Shot(picture, views[number], _camera_object(scene, source)))
    KEPT.trim()
    yield Progress(0.97, "putting the picture on")
    return [apply_picture(scene, reading, shot, settings) for shot in shots]


def bake(
    scene: bpy.types.Scene,
    depsgraph: bpy.types.Depsgraph | None = None,
    *,
    objects: Sequence[bpy.types.Object] | None = None,
    cameras: Sequence[Source] | None = None,
    look: Look | None = None,
    size: tuple[int, int] | None = None,
    settings: Settings | None = None,
) -> list[Baked]:
    """`baking`, run to its end."""
    return drain(
        baking(
            scene,
            depsgraph,
            objects=objects,
            cameras=cameras,
            look=look,
            size=size,
            settings=settings,
        )
    )


def _projecting(bodies: Sequence[Body], camera: Camera, display: str) -> Work[GBuffer]:
    """`projecting`, or what an earlier bake has found if nothing has moved since."""
    view = camera.view.tobytes(), camera.projection.tobytes(), camera.width, camera.height
    key = "gbuffer", tuple(map(id, bodies)), view, camera.name, display
    found = KEPT.find(key)
    if found is None:
        # With the bodies, so that these numbers stay theirs.
        found = KEPT.put(key, (bodies, (yield from projecting(bodies, camera, display))))
    return found[1]


def _camera_object(scene: bpy.types.Scene, source: Source) -> bpy.types.Object | None:
    """The scene's camera that a picture is from, None for a view."""
    if not isinstance(source, Camera):
        return source
    thing = scene.objects.get(source.name)
    return thing if thing is not None and thing.type == "CAMERA" else None


def camera_view(
    scene: bpy.types.Scene,
    depsgraph: bpy.types.Depsgraph,
    source: Source,
    size: tuple[int, int] | None,
) -> Camera:
    """What a camera of the scene sees, in the size that is asked for or that the scene says."""
    if isinstance(source, Camera):
        return source
    if size is None:
        size = picture_size(scene, scene.rosy.percentage)
    return camera_of_object(scene, depsgraph, source, *check_size(*size))


def undefined_of(scene: bpy.types.Scene) -> str:
    """What the scene says is done about vectors that are not finite."""
    return "zero" if scene.rosy.undefined else "error"


def scene_depsgraph(scene: bpy.types.Scene) -> bpy.types.Depsgraph:
    """That of the view layer in the context, or of the scene's first one if that is of another."""
    context = bpy.context
    if context.scene == scene:
        return context.evaluated_depsgraph_get()
    with context.temp_override(scene=scene, view_layer=scene.view_layers[0]):
        return context.evaluated_depsgraph_get()
