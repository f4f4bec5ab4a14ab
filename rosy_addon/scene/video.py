"""The job that encodes a video from image files with Blender's encoder."""

from pathlib import Path

import bpy

from ..core.errors import RosyError
from ..worker.job import Step, Steps, job
from ..worker.program import run_encoder
from . import video_encoding


@job
def encode_video(
    folder: Path, count: int, size: tuple[int, int], fps: float, path: Path
) -> Steps[None]:
    """Encode the images ``00000.png``, ``00001.png`` ... of a folder as an .mp4 with Blender's encoder.

    If Blender runs with a window, a second Blender process encodes. It is ended if the job is cancelled.

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
    if bpy.app.background or not bpy.app.binary_path:
        yield Step(0.0, "encoding the video")
        try:
            video_encoding.encode_video(folder, count, size, fps, path)
        except (RuntimeError, TypeError, AttributeError) as reason:
            raise RosyError(f"{path}: this Blender cannot encode a video: {reason}") from reason
        return
    command = [bpy.app.binary_path, "-b", "--factory-startup", "--python-exit-code", "1"]
    command += ["--python", video_encoding.__file__, "--"]
    command += map(str, (folder, count, *size, repr(fps), path))
    yield from run_encoder.begin(command, f"{path}: this Blender cannot encode a video", path)
