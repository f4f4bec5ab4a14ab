"""The job of turntables: read an object, draw it from all sides, and write a video."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import bpy

from .file_io import write_bytes
from .gpu.select import picture_steps, select_device
from .image_io.gif import gif_bytes
from .rendering.view_input import ViewInput
from .scene.look_properties import read_look
from .scene.read_view import read_turntable, scene_depsgraph
from .scene.video import encode_video
from .turntable_video import (
    check_gif_memory,
    check_still,
    draw_frame,
    gif_frame,
    png_frame,
    turntable_views,
)
from .worker.job import Call, Step, Steps, job, part
from .worker.start import GuardedFolder

#: Least samples along each side of a pixel: streaks that move must not flicker.
MIN_SUPERSAMPLING = 2

#: Share of the progress bar after which the pictures are encoded.
ENCODING_START = 0.97


@job
def render_turntable(
    scene: bpy.types.Scene,
    obj: bpy.types.Object,
    path: Path,
    *,
    count: int,
    rate: float,
    size: tuple[int, int],
    view_angles: tuple[float, float],
    still: bool = False,
    workers: int = 0,
) -> Steps[Path]:
    """Draw an object with its field from all sides, and write the pictures as a video.

    A job that is cancelled leaves no file.

    Parameters
    ----------
    scene : bpy.types.Scene
        Its look and its lights are used.
    obj : bpy.types.Object
    path : Path
        Of a .mp4 or .gif file.
    count : int
        Pictures in a full turn.
    rate : float
        Pictures per second.
    size : (int, int)
        Pixels.
    view_angles : (float, float)
        Azimuth of the first view, and elevation, in degrees.
    still : bool
        Whether the camera stays at the first view, so that only streaks drift.
    workers : int
        Processes that draw large pictures together; 0 is one for each core.

    Returns
    -------
    Path
        The file.

    Raises
    ------
    RosyError
        If the field cannot be read or drawn, nothing moves, or the video cannot be written.
    """
    look = read_look(scene.rosy)
    look = replace(look, supersampling=max(look.supersampling, MIN_SUPERSAMPLING))
    check_still(look, still, obj.name)
    device = select_device(scene.rosy.device.lower(), look)
    instance, lights = read_turntable(scene, scene_depsgraph(scene), obj, look)
    views = turntable_views(instance, look, count, size, view_angles, lights=lights, still=still)
    is_gif = path.suffix.lower() == ".gif"
    if is_gif:
        check_gif_memory(count, *size)
    with GuardedFolder() as folder:
        frames = []
        for index, view in enumerate(views):
            start, stop = (ENCODING_START * done / count for done in (index, index + 1))
            steps = _frame_steps(view, device, is_gif, still, workers)
            frame = yield from part(steps, start, stop, f"picture {index + 1} of {count}")
            if is_gif:
                frames.append(frame)
            else:
                write_bytes(Path(folder) / f"{index:05d}.png", frame)
        label = "encoding the video"
        if is_gif:
            contents = yield Call(gif_bytes, (frames, rate), ENCODING_START, label=label)
        else:
            video = Path(folder) / "video.mp4"
            even_size = size[0] // 2 * 2, size[1] // 2 * 2
            steps = encode_video.begin(Path(folder), count, even_size, rate, video)
            yield from part(steps, ENCODING_START, 1.0, label)
            contents = video.read_bytes()
    yield Step(1.0, "writing the file")
    write_bytes(path, contents)
    return path


def _frame_steps(view: ViewInput, device: str, is_gif: bool, still: bool, workers: int) -> Steps:
    """Draw a frame: an array of colors for a .gif, otherwise the bytes of a PNG file."""
    if device == "cpu":
        return (yield Call(draw_frame, (view, is_gif, still, workers)))
    picture = yield from picture_steps(view, device)
    return (yield Call(gif_frame if is_gif else png_frame, (picture.rgba,), 1.0))
