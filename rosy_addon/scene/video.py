"""Encoding a video from image files, with Blender's own encoder."""

from __future__ import annotations

import textwrap
from pathlib import Path

import bpy

from ..errors import RosyError
from ..processes import process_task
from ..progress import Task

#: The folder that contains `rosy_addon`.
ROOT = Path(__file__).resolve().parents[2]

#: A program for another Blender that calls `encode_video` with arguments that are filled in.
_ENCODING_PROGRAM = textwrap.dedent("""\
    import importlib.util, sys
    from pathlib import Path
    root = {root!r}
    spec = importlib.util.spec_from_file_location(
        "rosy", root + "/__init__.py", submodule_search_locations=[root]
    )
    sys.modules["rosy"] = importlib.util.module_from_spec(spec)
    from rosy.rosy_addon.scene.video import encode_video
    encode_video(Path({folder!r}), {count}, {size}, {fps}, Path({path!r}))
    """)


def encode_video_task(
    folder: Path, count: int, size: tuple[int, int], fps: float, path: Path
) -> Task[None]:
    """Do the same as `encode_video`. In a window, another Blender does it, so that it can be stopped.

    Closing the task stops it.
    """
    if bpy.app.background or not bpy.app.binary_path:
        encode_video(folder, count, size, fps, path)
        return
    program = _ENCODING_PROGRAM.format(
        root=str(ROOT), folder=str(folder), count=count, size=size, fps=fps, path=str(path)
    )
    command = [bpy.app.binary_path, "-b", "--factory-startup", "--python-exit-code", "1"]
    status, output = yield from process_task(
        [*command, "--python-expr", program], "encoding the video"
    )
    if status or not path.is_file():
        message = (output.strip().splitlines() or ["it failed"])[-1]
        raise RosyError(f"{path}: this Blender cannot encode a video: {message}")


def encode_video(folder: Path, count: int, size: tuple[int, int], fps: float, path: Path) -> None:
    """Encode the images ``00000.png``, ``00001.png`` ... of a folder as an .mp4 file (H.264).

    Parameters
    ----------
    folder : Path
    count : int
        Number of images.
    size : (int, int)
        Width and height in pixels. Both must be even.
    fps : float
        Frames per second.
    path : Path
        The video file.

    Raises
    ------
    RosyError
        If this build of Blender cannot encode the video.
    """
    scene = bpy.data.scenes.new("RoSy video")
    try:
        editor = scene.sequence_editor_create()
        strips = editor.strips if hasattr(editor, "strips") else editor.sequences
        strip = strips.new_image("video", str(folder / "00000.png"), channel=1, frame_start=1)
        for index in range(1, count):
            strip.elements.append(f"{index:05d}.png")  # this makes the strip a frame longer
        render = scene.render
        render.resolution_x, render.resolution_y = size
        render.resolution_percentage = 100
        # The frame rate is fps / fps_base.
        render.fps, render.fps_base = max(round(fps), 1), max(round(fps), 1) / fps
        scene.frame_start, scene.frame_end = 1, count
        scene.view_settings.view_transform = "Standard"
        image_settings = render.image_settings
        if hasattr(image_settings, "media_type"):
            image_settings.media_type = "VIDEO"
        image_settings.file_format = "FFMPEG"
        render.ffmpeg.format, render.ffmpeg.codec = "MPEG4", "H264"
        render.ffmpeg.constant_rate_factor = "HIGH"
        render.ffmpeg.audio_codec = "NONE"
        render.use_file_extension = False
        render.filepath = str(path)
        bpy.ops.render.render(animation=True, scene=scene.name)
    except (RuntimeError, TypeError, AttributeError) as reason:
        raise RosyError(f"{path}: this Blender cannot encode a video: {reason}") from reason
    finally:
        bpy.data.scenes.remove(scene)
    if not path.is_file():
        raise RosyError(f"{path}: Blender did not write the video")
