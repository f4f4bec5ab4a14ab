"""Turntables: draw a mesh from a camera that orbits it, and write the pictures as a video."""

import itertools
from collections.abc import Callable, Iterable, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from ..compositor.flow import drift_at
from ..compositor.look import Look, has_flow
from ..compositor.picture import Picture
from ..compositor.shading import Light
from ..core.cache import Cache
from ..core.color import to_display
from ..core.errors import RosyError
from ..core.file_io import write_bytes
from ..core.memory import check_memory
from ..image_io.gif import gif_bytes
from ..image_io.png import png_bytes
from ..projection.camera import orbit_camera
from ..projection.gbuffer import MeshInstance
from ..worker.job import Call, Steps, call_steps, part, run
from ..worker.lifeline import Lifeline
from .draw import bake_picture, draw_picture
from .view_input import ViewInput

#: Suffixes of the video files that can be written.
VIDEO_SUFFIXES = (".mp4", ".gif")

#: A function that encodes a video. Its arguments are the folder of pictures, their number and size, the
#: frames per second, and the file.
Encoder = Callable[[Path, int, tuple[int, int], float, Path], None]

#: Message if an .mp4 is to be written and there is no encoder.
NO_ENCODER = "an .mp4 needs ffmpeg or Blender; a .gif needs neither"

#: Memory per pixel of all pictures of a .gif, in bytes: 3 for colors, which are kept until the end, and an
#: estimate of the compressed data.
GIF_BYTES = 4.5

#: Number of points on each circle of `_swept_hull`.
HULL_SAMPLES = 48

#: Fraction of the progress at which all pictures are drawn and encoding begins.
ENCODING_START = 0.97


def turntable_views(
    instance: MeshInstance,
    look: Look,
    count: int,
    size: tuple[int, int],
    view_angles: tuple[float, float],
    *,
    perspective: bool = True,
    lights: Sequence[Light] = (),
    still: bool = False,
) -> list[ViewInput]:
    """Return the views of a camera that orbits a mesh once, counter-clockwise.

    Moving streaks drift by a whole number of their cycles in the video, so that it can be played as a loop.

    Parameters
    ----------
    instance : MeshInstance
        The mesh, in world space with z up.
    look : Look
        Settings of the drawing.
    count : int
        Number of views.
    size : (int, int)
        Width and height in pixels.
    view_angles : (float, float)
        Azimuth of the first view, 0 from the front (-y) and 90 from the right (+x), and elevation of all
        views, in degrees.
    perspective : bool
        Whether the camera is perspective. If not, it is orthographic.
    lights : sequence of Light
        In world space. The lights do not move with the camera.
    still : bool
        Whether the camera stays at the first view. Then only the streaks move.
    """
    points = instance.face_points() if still else _swept_hull(instance.face_points())
    views = []
    for index in range(count):
        azimuth = view_angles[0] + (0 if still else 360 * index / count)
        camera = orbit_camera(points, azimuth, view_angles[1], *size, perspective=perspective)
        camera_lights = tuple(light.transformed(camera.view) for light in lights)
        drift = drift_at(look, index, count)
        views.append(ViewInput((instance,), camera, look, camera_lights, drift=drift))
    return views


def draw_next(view: ViewInput, cache: Cache, **options: Any) -> Picture:
    """Draw a picture with `draw_picture`, and remove from the cache what this picture has not used."""
    picture = draw_picture(view, cache, **options)
    cache.evict_unused()
    return picture


def check_still(look: Look, still: bool, name: str) -> None:
    """Raise a `RosyError` if neither the camera nor the streaks of a turntable move.

    `name` is the name of the object or mesh in the message.
    """
    if still and not has_flow(look):
        raise RosyError(
            f"{name}: nothing moves: a still camera needs a look whose flow is above 0, with the method "
            "sheets or ibfv and gray streaks"
        )


def turntable(
    draw: Callable[[ViewInput], Picture],
    views: Iterable[ViewInput],
    count: int,
    path: Path,
    fps: float,
    encode: Encoder | None = None,
    on_picture: Callable[[int], None] | None = None,
) -> Path:
    """Draw views and write them as a video. The file is written after all pictures are drawn.

    Parameters
    ----------
    draw : function
        Function that draws a view.
    views : iterable of ViewInput
        Result of `turntable_views`, or the views of another video.
    count : int
        Number of views.
    path : Path
        The file: a .gif, or an .mp4, which needs `encode`.
    fps : float
        Frames per second.
    encode : Encoder, optional
        Function that encodes an .mp4.
    on_picture : function, optional
        Function that is called before each picture is drawn, with its number, from 1.

    Returns
    -------
    Path
        Path of the video file.

    Raises
    ------
    RosyError
        If `encode` is missing for an .mp4, or the video cannot be encoded or written.
    """
    if encode is None and not is_gif(path):
        raise RosyError(f"{path}: {NO_ENCODER}")

    numbers = itertools.count(1)

    def draw_numbered(view: ViewInput) -> Any:
        if on_picture is not None:
            on_picture(next(numbers))
        return video_frame(draw(view).rgba, is_gif(path))

    def encode_steps(*arguments: Any) -> Steps[None]:
        assert encode is not None
        return call_steps(encode, *arguments)

    draw_steps = partial(call_steps, draw_numbered)
    contents = run(video_steps(draw_steps, views, count, path, fps, encode_steps))
    write_bytes(path, contents, follow_links=True)
    return path


def video_steps(
    draw: Callable[[ViewInput], Steps[Any]],
    views: Iterable[ViewInput],
    count: int,
    path: Path,
    fps: float,
    encode: Callable[..., Steps[None]],
) -> Steps[bytes]:
    """Draw views as part of a job, encode the pictures, and return the contents of the video file.

    Parameters
    ----------
    draw : function
        ``draw(view)`` returns the steps of a job. The job draws the view, and its result is the `video_frame`
        of the picture.
    views : iterable of ViewInput
    count : int
        Number of views.
    path : Path
        Only the suffix is used, for the format: .gif or .mp4. Nothing is written to the path.
    fps : float
        Frames per second.
    encode : function
        Takes the arguments of an `Encoder`, and returns the steps of a job that encodes an .mp4.
    """
    pictures = []
    with Lifeline() as lifeline:
        for index, view in enumerate(views):
            width, height = view.camera.size
            if is_gif(path) and not index:
                check_memory(
                    GIF_BYTES * count * width * height,
                    f"a .gif of {count} pictures of {width} x {height} pixels",
                    "choose a smaller size or fewer pictures, or write an .mp4",
                )
            start, stop = (ENCODING_START * done / count for done in (index, index + 1))
            frame = yield from part(draw(view), start, stop, f"picture {index + 1} of {count}")
            if is_gif(path):
                pictures.append(frame)
            else:
                write_bytes(lifeline.folder / f"{index:05d}.png", frame)
        label = "encoding the video"
        if is_gif(path):
            return (yield Call(gif_bytes, (pictures, fps), ENCODING_START, label=label))
        folder = lifeline.folder
        video, even_size = folder / "video.mp4", (width // 2 * 2, height // 2 * 2)
        steps = encode(folder, count, even_size, fps, video)
        yield from part(steps, ENCODING_START, 1.0, label)
        return video.read_bytes()


def is_gif(path: Path) -> bool:
    """Return whether the suffix of a video file is .gif."""
    return path.suffix.lower() == ".gif"


def draw_frame(view: ViewInput, as_gif: bool, keep_gbuffers: bool, workers: int) -> Any:
    """Draw a picture with `bake_picture`, and return its `video_frame` for a .gif, or else for an .mp4.

    `keep_gbuffers` says whether G-buffers are kept in the cache of this process. `workers` is the number of
    processes that draw a large picture; 0 means one per processor core.
    """
    return video_frame(bake_picture(view, keep_gbuffers, workers).rgba, as_gif)


def check_video_path(path: Path) -> None:
    """Check that a file name has a suffix of a video that can be written.

    Raises
    ------
    RosyError
        If the suffix is not one of `VIDEO_SUFFIXES`.
    """
    if path.suffix.lower() not in VIDEO_SUFFIXES:
        raise RosyError(f"{path}: the name of the video must end in {' or '.join(VIDEO_SUFFIXES)}")


def video_frame(rgba: np.ndarray, as_gif: bool) -> Any:
    """Composite a picture over white, and convert it to what the encoder of a video needs.

    Parameters
    ----------
    rgba : (H, W, 4) float32 ndarray
        Picture: linear, not premultiplied, rows from the bottom.
    as_gif : bool
        Whether the video is a .gif. If not, it is an .mp4.

    Returns
    -------
    (H, W, 3) uint8 ndarray or bytes
        For a .gif, sRGB values with the top row first. For an .mp4, the bytes of a PNG file. The sides of an
        .mp4 must be even, so a last odd row or column is cut off.
    """
    opaque = np.ones_like(rgba)
    opaque[..., :3] = 1 + rgba[..., 3:] * (rgba[..., :3] - 1)
    if as_gif:
        return np.rint(to_display(opaque[::-1, :, :3]) * 255).astype(np.uint8)
    return png_bytes(opaque[: len(rgba) // 2 * 2, : rgba.shape[1] // 2 * 2])


def _swept_hull(points: np.ndarray) -> np.ndarray:
    """Return points, (n, 3), that enclose all positions of a mesh while it turns about its vertical axis.

    `points` are the vertices of the mesh, (V, 3), with z up.
    The mesh is cut into 32 horizontal slices. Each slice is enclosed by a cylinder. The points are samples of
    the two rims of each cylinder.
    """
    center = (points.min(axis=0) + points.max(axis=0)) / 2
    radius = np.hypot(points[:, 0] - center[0], points[:, 1] - center[1])
    height = (points[:, 2] - points[:, 2].min()) / np.ptp(points[:, 2]).clip(1e-12)
    slice_index = np.clip(height * 31, 0, 31).astype(int)
    max_radius = np.zeros(32)
    np.maximum.at(max_radius, slice_index, radius)
    min_z, max_z = np.full(32, np.inf), np.full(32, -np.inf)
    np.minimum.at(min_z, slice_index, points[:, 2])
    np.maximum.at(max_z, slice_index, points[:, 2])
    is_occupied = np.isfinite(min_z)
    angle = np.linspace(0, 2 * np.pi, HULL_SAMPLES, endpoint=False)
    x = center[0] + max_radius[is_occupied, None] * np.cos(angle)
    y = center[1] + max_radius[is_occupied, None] * np.sin(angle)
    rims = [np.broadcast_to(rim_z[is_occupied, None], x.shape) for rim_z in (min_z, max_z)]
    return np.concatenate([np.stack([x, y, z], axis=-1).reshape(-1, 3) for z in rims])
