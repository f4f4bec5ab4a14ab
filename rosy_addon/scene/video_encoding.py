"""Encode a video from image files with Blender's own encoder.

A second Blender process runs this file as a script, so the file does not import any module of RoSy::

    blender -b --factory-startup --python video_encoding.py -- FOLDER COUNT WIDTH HEIGHT FPS VIDEO.mp4
"""

import sys
from pathlib import Path

import bpy


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
    RuntimeError, TypeError, AttributeError
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
        # Blender's frame rate is fps / fps_base, and fps must be an integer.
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
        if bpy.app.version >= (5, 0, 0):  # names in braces are replaced
            render.filepath = render.filepath.replace("{", "{{").replace("}", "}}")
        bpy.ops.render.render(animation=True, scene=scene.name)
    finally:
        bpy.data.scenes.remove(scene)
    if not path.is_file():
        raise RuntimeError("nothing was written")


if __name__ == "__main__":
    folder, count, width, height, fps, video = sys.argv[sys.argv.index("--") + 1 :]
    encode_video(Path(folder), int(count), (int(width), int(height)), float(fps), Path(video))
