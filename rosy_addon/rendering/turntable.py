"""Turntables: pictures of one mesh from all sides, written as a video."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterable, Sequence
from contextlib import nullcontext
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
from ..worker.start import GuardedFolder
from .draw import bake_picture, draw_picture
from .view_input import ViewInput

#: Suffixes of videos that can be written.
VIDEO_SUFFIXES = (".mp4", ".gif")

#: A function that encodes a video. Its arguments are the folder of pictures, their number and size, the
#: frames per second, and the file.
Encoder = Callable[[Path, int, tuple[int, int], float, Path], None]

#: What is wrong with an .mp4 for which there is no encoder.
NO_ENCODER = "an .mp4 needs ffmpeg or Blender; a .gif needs neither"

#: Bytes of memory of a pixel of a .gif: its colors until the end, and its compressed data.
GIF_BYTES = 4.5

#: Points per circle of the hull that is framed.
HULL_SAMPLES = 48

#: Share of the progress bar after which the pictures are encoded.
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

    Streaks that drift do so by whole cycles, so that the video is a loop.

    Parameters
    ----------
    instance : MeshInstance
        World space, z up.
    look : Look
    count : int
        Pictures per revolution.
    size : (int, int)
        Pixels.
    view_angles : (float, float)
        Azimuth of the first view, and elevation, in degrees.
    perspective : bool
    lights : sequence of Light
        World space. The camera moves, the lights do not.
    still : bool
        Whether the camera stays at the first view, so that only streaks drift.
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
    """Draw a picture as `draw_picture`, and evict from the cache what it has not used."""
    picture = draw_picture(view, cache, **options)
    cache.evict_unused()
    return picture


def check_still(look: Look, still: bool, name: str) -> None:
    """Raise a `RosyError` if neither the camera nor the streaks of a turntable move."""
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
    """Draw views and write them as a video. No file is written before all pictures are drawn.

    Parameters
    ----------
    draw : function
        Draws a view.
    views : iterable of ViewInput
        The result of `turntable_views`, or the views of another video.
    count : int
        Number of views.
    path : Path
        A .gif needs no encoder; an .mp4 does.
    fps : float
        Frames per second.
    encode : Encoder, optional
    on_picture : function, optional
        Called with the number of each picture, from 1, before it is drawn.

    Returns
    -------
    Path
        The file.

    Raises
    ------
    RosyError
        If an .mp4 has no encoder, or the video cannot be encoded or written.
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
    write_bytes(path, run(video_steps(draw_steps, views, count, path, fps, encode_steps)))
    return path


def video_steps(
    draw: Callable[[ViewInput], Steps[Any]],
    views: Iterable[ViewInput],
    count: int,
    path: Path,
    fps: float,
    encode: Callable[..., Steps[None]],
) -> Steps[bytes]:
    """Draw views as part of a job, and return the contents of a video of them.

    Parameters
    ----------
    draw : function
        Returns the steps that draw the `video_frame` of a view.
    views, count, path, fps
        See `turntable`. Nothing is written to the path; its suffix is the kind of the video.
    encode : function
        Returns the steps that encode an .mp4, given the arguments of an `Encoder`.
    """
    pictures = []
    with nullcontext("") if is_gif(path) else GuardedFolder() as name:
        folder = Path(name)
        for index, view in enumerate(views):
            width, height = view.camera.width, view.camera.height
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
                write_bytes(folder / f"{index:05d}.png", frame)
        label = "encoding the video"
        if is_gif(path):
            return (yield Call(gif_bytes, (pictures, fps), ENCODING_START, label=label))
        video, even_size = folder / "video.mp4", (width // 2 * 2, height // 2 * 2)
        steps = encode(folder, count, even_size, fps, video)
        yield from part(steps, ENCODING_START, 1.0, label)
        return video.read_bytes()


def is_gif(path: Path) -> bool:
    """Return whether a video is a .gif."""
    return path.suffix.lower() == ".gif"


def draw_frame(view: ViewInput, as_gif: bool, keep_gbuffers: bool, workers: int) -> Any:
    """Draw a picture as `bake_picture`, and return its `video_frame`."""
    return video_frame(bake_picture(view, keep_gbuffers, workers).rgba, as_gif)


def check_video_path(path: Path) -> None:
    """Check that a video can be written under a file name.

    Raises
    ------
    RosyError
        If the suffix is not one of `VIDEO_SUFFIXES`.
    """
    if path.suffix.lower() not in VIDEO_SUFFIXES:
        raise RosyError(f"{path}: the name of the video must end in {' or '.join(VIDEO_SUFFIXES)}")


def video_frame(rgba: np.ndarray, as_gif: bool) -> Any:
    """Return a picture on white paper, as a video of it is encoded.

    Parameters
    ----------
    rgba : (H, W, 4) float32 ndarray
        As `Picture.rgba`.
    as_gif : bool

    Returns
    -------
    (H, W, 3) uint8 ndarray or bytes
        Display values for a .gif, with the top row first. Otherwise a PNG file. An .mp4 needs even sides, so
        it lacks the last row or column of an odd one.
    """
    opaque = np.ones_like(rgba)
    opaque[..., :3] = 1 + rgba[..., 3:] * (rgba[..., :3] - 1)
    if as_gif:
        return np.rint(to_display(opaque[::-1, :, :3]) * 255).astype(np.uint8)
    return png_bytes(opaque[: len(rgba) // 2 * 2, : rgba.shape[1] // 2 * 2])


def _swept_hull(points: np.ndarray) -> np.ndarray:
    """Return points around everything that a mesh sweeps when it turns about its vertical axis.

    The mesh is cut into 32 horizontal slices. Each is enclosed by a cylinder, whose two rims are
    sampled.
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
