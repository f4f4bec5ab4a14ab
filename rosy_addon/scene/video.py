"""Encoding a video from image files, in steps."""

from __future__ import annotations

from pathlib import Path

import bpy

from ..errors import RosyError
from ..processes import process_task
from ..progress import report, run_with_report
from . import video_encoding


def encode_video(folder: Path, count: int, size: tuple[int, int], fps: float, path: Path) -> None:
    """Encode the images of a folder with Blender's encoder. See `video_encoding.encode_video`.

    In a window, another Blender does it, so that it can be stopped: closing the task stops it.

    Raises
    ------
    RosyError
        If this build of Blender cannot encode the video.
    """
    if bpy.app.background or not bpy.app.binary_path:
        try:
            video_encoding.encode_video(folder, count, size, fps, path)
        except (RuntimeError, TypeError, AttributeError) as reason:
            raise RosyError(f"{path}: this Blender cannot encode a video: {reason}") from reason
        return
    command = [bpy.app.binary_path, "-b", "--factory-startup", "--python-exit-code", "1"]
    command += ["--python", video_encoding.__file__, "--"]
    command += map(str, (folder, count, *size, repr(fps), path))
    status, output = run_with_report(process_task(command, "encoding the video"), report)
    if status or not path.is_file():
        message = (output.strip().splitlines() or ["it failed"])[-1]
        raise RosyError(f"{path}: this Blender cannot encode a video: {message}")
