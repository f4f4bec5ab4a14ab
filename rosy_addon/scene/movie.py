"""Films by Blender's own encoder, from pictures in a folder."""

from __future__ import annotations

from pathlib import Path

import bpy

from ..errors import RosyError


def encode(folder: Path, count: int, size: tuple[int, int], rate: float, path: Path) -> None:
    """Make an .mp4 of the pictures ``00000.png`` ... of a folder.

    Parameters
    ----------
    folder : Path
    count : int
    size : (int, int)
        Pixels, even.
    rate : float
        Pictures a second.
    path : Path
        Of the film.

    Raises
    ------
    RosyError
        If this Blender cannot.
    """
    scene = bpy.data.scenes.new("RoSy film")
    try:
        editor = scene.sequence_editor_create()
        strips = editor.strips if hasattr(editor, "strips") else editor.sequences
        strip = strips.new_image("film", str(folder / "00000.png"), channel=1, frame_start=1)
        for number in range(1, count):
            strip.elements.append(f"{number:05d}.png")
        strip.frame_final_duration = count
        render = scene.render
        render.resolution_x, render.resolution_y = size
        render.resolution_percentage = 100
        # As a fraction, within a thousandth.
        render.fps, render.fps_base = max(round(rate), 1), max(round(rate), 1) / rate
        scene.frame_start, scene.frame_end = 1, count
        scene.view_settings.view_transform = "Standard"
        settings = render.image_settings
        if hasattr(settings, "media_type"):
            settings.media_type = "VIDEO"
        settings.file_format = "FFMPEG"
        render.ffmpeg.format, render.ffmpeg.codec = "MPEG4", "H264"
        render.ffmpeg.constant_rate_factor = "HIGH"
        render.ffmpeg.audio_codec = "NONE"
        render.use_file_extension = False
        render.filepath = str(path)
        bpy.ops.render.render(animation=True, scene=scene.name)
    except (RuntimeError, TypeError, AttributeError) as reason:
        raise RosyError(f"{path}: this Blender makes no film: {reason}") from reason
    finally:
        bpy.data.scenes.remove(scene)
    if not path.is_file():
        raise RosyError(f"{path}: this Blender has made no film")
