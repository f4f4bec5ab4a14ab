"""Turntables: pictures of one mesh from all sides, written as a video."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from .cache import Cache
from .color import to_display
from .compositor.flow import flow_at
from .compositor.look import Look, has_flow
from .compositor.picture import Picture
from .compositor.shading import Light
from .errors import RosyError
from .file_io import write_bytes
from .image_io.gif import gif_bytes
from .image_io.png import png_bytes
from .memory import check_memory
from .progress import progress, report
from .projection.camera import orbit_camera
from .projection.gbuffer import MeshInstance
from .rendering.draw import bake_picture, draw_picture
from .rendering.view_input import ViewInput
from .worker.start import GuardedFolder

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
) -> Iterator[ViewInput]:
    """Yield the views of a camera that orbits a mesh once, counter-clockwise.

    Streaks that drift do so by whole cycles, so that the video is a loop.

    Parameters
    ----------
    instance : MeshInstance
        In world space, z up.
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

    Yields
    ------
    ViewInput
    """
    points = instance.face_points() if still else _swept_hull(instance.face_points())
    for index in range(count):
        azimuth = view_angles[0] + (0 if still else 360 * index / count)
        camera = orbit_camera(points, azimuth, view_angles[1], *size, perspective=perspective)
        camera_lights = tuple(light.transformed(camera.view) for light in lights)
        yield ViewInput((instance,), camera, flow_at(look, index, count), camera_lights)


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
    views: Iterator[ViewInput],
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
    views : iterator of ViewInput
        From `turntable_views`.
    count : int
        Number of views.
    path, fps, encode
        See `VideoWriter`.
    on_picture : function, optional
        Called with the number of each picture, from 1, before it is drawn.

    Returns
    -------
    Path
        The file.
    """
    with VideoWriter(path, fps, encode) as writer:
        for index, view in enumerate(views):
            if on_picture is not None:
                on_picture(index + 1)
            start, stop = (ENCODING_START * done / count for done in (index, index + 1))
            if not index:
                writer.check_memory(count, view.camera.width, view.camera.height)
            label = f"picture {index + 1} of {count}"
            report(start, label)
            with progress(start, stop, label):
                writer.add(draw(view).rgba)
        with progress(ENCODING_START, 1.0, "encoding the video"):
            writer.write()
    return path


class VideoWriter:
    """Collects pictures and writes them as a video, on white paper. A context manager.

    Parameters
    ----------
    path : Path
        A .gif needs no encoder; an .mp4 does.
    fps : float
        Frames per second.
    encode : function, optional
        Encodes the pictures of a folder as .mp4, given the folder, the number and size of the
        pictures, the frames per second and the file.

    Raises
    ------
    RosyError
        If an .mp4 has no encoder.
    """

    def __init__(self, path: Path, fps: float, encode: Encoder | None = None) -> None:
        self._path, self._fps = path, fps
        self._encode = encode
        self._is_gif = path.suffix.lower() == ".gif"
        if encode is None and not self._is_gif:
            raise RosyError(f"{path}: {NO_ENCODER}")
        self._folder = None if self._is_gif else GuardedFolder()
        self._gif_frames: list[np.ndarray] = []
        self._count, self._size = 0, (0, 0)

    def __enter__(self) -> VideoWriter:
        return self

    def __exit__(self, *_: object) -> None:
        if self._folder is not None:
            self._folder.cleanup()

    def check_memory(self, count: int, width: int, height: int) -> None:
        """Check that a number of pictures can take the memory that they need as a .gif.

        Raises
        ------
        RosyError
            If they need more than `available_memory`.
        """
        if self._is_gif:
            check_gif_memory(count, width, height)

    def add(self, rgba: np.ndarray) -> None:
        """Add a picture.

        Parameters
        ----------
        rgba : (H, W, 4) float32 ndarray
            As `Picture.rgba`. All pictures have the same size. An .mp4 needs even sides, so the
            last row or column of an odd one is cut off.
        """
        if self._folder is None:
            self._gif_frames.append(gif_frame(rgba))
            return
        path = Path(self._folder.name) / f"{self._count:05d}.png"
        write_bytes(path, png_frame(rgba))
        self._size = rgba.shape[1] // 2 * 2, rgba.shape[0] // 2 * 2
        self._count += 1

    def write(self) -> None:
        """Write the video.

        Raises
        ------
        RosyError
            If it cannot be encoded or written.
        """
        if self._folder is None:
            write_bytes(self._path, gif_bytes(self._gif_frames, self._fps))
            return
        folder = Path(self._folder.name)
        video_path = folder / "video.mp4"
        assert self._encode is not None
        self._encode(folder, self._count, self._size, self._fps, video_path)
        write_bytes(self._path, video_path.read_bytes())


def check_gif_memory(count: int, width: int, height: int) -> None:
    """Raise a `RosyError` if a .gif of a number of pictures needs more than `available_memory`."""
    check_memory(
        GIF_BYTES * count * width * height,
        f"a .gif of {count} pictures of {width} x {height} pixels",
        "choose a smaller size or fewer pictures, or write an .mp4",
    )


def draw_frame(view: ViewInput, is_gif: bool, keep_gbuffers: bool, workers: int) -> Any:
    """Draw a picture as `bake_picture`, and return its `gif_frame` or its `png_frame`."""
    picture = bake_picture(view, keep_gbuffers, workers)
    return gif_frame(picture.rgba) if is_gif else png_frame(picture.rgba)


def check_video_path(path: Path) -> None:
    """Check that a video can be written under a file name.

    Raises
    ------
    RosyError
        If the suffix is not one of `VIDEO_SUFFIXES`.
    """
    if path.suffix.lower() not in VIDEO_SUFFIXES:
        raise RosyError(f"{path}: the name of the video must end in {' or '.join(VIDEO_SUFFIXES)}")


def _over_white(rgba: np.ndarray) -> np.ndarray:
    """Return a picture on white paper as (H, W, 3) float32, linear."""
    return 1 + rgba[..., 3:] * (rgba[..., :3] - 1)


def png_frame(rgba: np.ndarray) -> bytes:
    """Return a picture on white paper as a PNG file, without the last row or column of an odd side."""
    rgba = rgba[: len(rgba) // 2 * 2, : rgba.shape[1] // 2 * 2]
    opaque = np.ones_like(rgba)
    opaque[..., :3] = _over_white(rgba)
    return png_bytes(opaque)


def gif_frame(rgba: np.ndarray) -> np.ndarray:
    """Return a picture on white paper as (H, W, 3) uint8, with the top row first."""
    return np.rint(to_display(_over_white(rgba)[::-1]) * 255).astype(np.uint8)


def _swept_hull(points: np.ndarray) -> np.ndarray:
    """Return points around everything that a mesh sweeps when it turns about its vertical axis.

    The mesh is cut into 32 horizontal slices. Each is enclosed by a cylinder, whose two rims are
    sampled.
    """
    center = (points.min(axis=0) + points.max(axis=0)) / 2
    radius = np.hypot(points[:, 0] - center[0], points[:, 1] - center[1])
    slice_position = np.clip(
        (points[:, 2] - points[:, 2].min()) / np.ptp(points[:, 2]).clip(1e-12) * 31, 0, 31
    )
    max_radius = np.zeros(32)
    np.maximum.at(max_radius, slice_position.astype(int), radius)
    min_z, max_z = np.full(32, np.inf), np.full(32, -np.inf)
    np.minimum.at(min_z, slice_position.astype(int), points[:, 2])
    np.maximum.at(max_z, slice_position.astype(int), points[:, 2])
    is_occupied = np.isfinite(min_z)
    angle = np.linspace(0, 2 * np.pi, HULL_SAMPLES, endpoint=False)
    rings = []
    for rim_z in (min_z[is_occupied], max_z[is_occupied]):
        x = center[0] + max_radius[is_occupied, None] * np.cos(angle)
        y = center[1] + max_radius[is_occupied, None] * np.sin(angle)
        z = np.broadcast_to(rim_z[:, None], x.shape)
        rings.append(np.stack([x, y, z], axis=-1).reshape(-1, 3))
    return np.concatenate(rings)
