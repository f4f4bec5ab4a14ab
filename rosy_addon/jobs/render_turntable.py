"""The job of turntables: read an object, draw it from a camera that orbits it, and write a video."""

from dataclasses import replace
from pathlib import Path
from typing import Any

from bpy.types import Object, Scene

from ..core.file_io import write_bytes
from ..gpu.select import picture_steps, select_device
from ..rendering import turntable
from ..rendering.view_input import ViewInput
from ..scene.look_properties import object_looks, read_look
from ..scene.read_view import read_turntable, scene_depsgraph
from ..scene.video import encode_video
from ..worker.job import Call, Step, Steps, job

#: Least number of samples along each side of a pixel, without which moving streaks flicker.
MIN_SUPERSAMPLING = 2


@job
def render_turntable(
    scene: Scene,
    obj: Object,
    path: Path,
    *,
    count: int,
    rate: float,
    size: tuple[int, int],
    view_angles: tuple[float, float],
    still: bool = False,
    workers: int = 0,
) -> Steps[Path]:
    """Draw an object with its field from a camera that orbits it, and write the pictures as a video.

    If the job is cancelled, no file is written.

    Parameters
    ----------
    scene : bpy.types.Scene
        The scene of the object, whose look and lights are used.
    obj : bpy.types.Object
        The object, which has a field.
    path : Path
        The .mp4 or .gif file.
    count : int
        Number of pictures in a full turn.
    rate : float
        Pictures per second.
    size : (int, int)
        Width and height in pixels.
    view_angles : (float, float)
        Azimuth of the first view, 0 from the front (-y) and 90 from the right (+x), and elevation of all
        views, in degrees.
    still : bool
        Whether the camera stays at the first view. Then only the streaks move.
    workers : int
        Number of processes that draw a large picture together. 0 means one per processor core.

    Returns
    -------
    Path
        The file.

    Raises
    ------
    RosyError
        If the field cannot be read or drawn, neither the camera nor the streaks move, or the video cannot be
        written.
    """
    (look,) = object_looks(scene, [obj], read_look(scene.rosy))
    look = replace(look, supersampling=max(look.supersampling, MIN_SUPERSAMPLING))
    turntable.check_still(look, still, obj.name)
    device = select_device(scene.rosy.device.lower(), look)
    instance, lights = read_turntable(scene, scene_depsgraph(scene), obj, look)
    views = turntable.turntable_views(
        instance, look, count, size, view_angles, lights=lights, still=still
    )
    as_gif = turntable.is_gif(path)

    def draw(view: ViewInput) -> Steps[Any]:
        # If the camera stands still, the G-buffer is kept for the next view.
        if device == "cpu":
            return (yield Call(turntable.draw_frame, (view, as_gif, still, workers)))
        picture = yield from picture_steps(view, device)
        return (yield Call(turntable.video_frame, (picture.rgba, as_gif), 1.0))

    contents = yield from turntable.video_steps(draw, views, count, path, rate, encode_video.begin)
    yield Step(1.0, "writing the file")
    write_bytes(path, contents, follow_links=True)
    return path
