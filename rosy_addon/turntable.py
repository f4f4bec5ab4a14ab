"""A mesh and its field on a turntable: pictures all around, and what makes a film of them."""

from __future__ import annotations

import shutil
import subprocess
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np

from .compositor.colour import to_display
from .compositor.compose import compose
from .compositor.gif import gif_bytes
from .compositor.look import Look
from .compositor.png import write_png
from .errors import RosyError
from .files import write_bytes
from .projection.camera import Camera, orbit_camera
from .projection.gbuffer import Body
from .projection.project import project

#: Films that can be made, by the end of the name.
FILMS = (".mp4", ".gif")

#: Makes a film: folder of pictures, their number and size, the rate, and the file.
Encoder = Callable[[Path, int, tuple[int, int], float, Path], None]

#: Directions in which the outermost points are looked at, for a frame that holds all of them.
AROUND = 48


def pictures(
    body: Body,
    look: Look,
    count: int,
    size: tuple[int, int],
    view: tuple[float, float],
    perspective: bool = True,
) -> Iterator[np.ndarray]:
    """Pictures from all around, the camera going counter-clockwise.

    Parameters
    ----------
    body : Body
        In world space, z up.
    look : Look
    count : int
        Pictures of a full turn.
    size : (int, int)
        Pixels.
    view : (float, float)
        Azimuth of the first one, and elevation, degrees.
    perspective : bool

    Yields
    ------
    (H, W, 4) float32 ndarray
        As `Picture.rgba`.
    """
    points = body.world_points()
    hull = _turned_hull(points)
    for number in range(count):
        azimuth = view[0] + 360 * number / count
        camera = _camera(hull, azimuth, view[1], size, look.supersampling, perspective)
        yield compose(project([body], camera, look.display), look).rgba


def write_film(
    path: Path, frames: Iterator[np.ndarray], rate: float, encode: Encoder | None = None
) -> None:
    """Write pictures as a film, on white paper.

    Parameters
    ----------
    path : Path
        A .gif needs nothing, an .mp4 an encoder.
    frames : iterator of (H, W, 4) float32 ndarray
        Of one size; sides of an odd number of pixels are cut by one for an .mp4.
    rate : float
        Pictures a second.
    encode : function, optional
        Makes a film of pictures in a folder, given their number and size, the rate, and where to;
        the program ffmpeg if not given.

    Raises
    ------
    RosyError
        If the name ends in neither, or the film cannot be made or written.
    """
    if path.suffix.lower() == ".gif":
        write_bytes(path, gif_bytes([_on_paper(frame) for frame in frames], rate))
        return
    with tempfile.TemporaryDirectory() as name:
        folder, count, size = Path(name), 0, (0, 0)
        for frame in frames:
            frame = frame[: len(frame) // 2 * 2, : frame.shape[1] // 2 * 2]
            opaque = np.ones_like(frame)
            opaque[..., :3] = 1 + frame[..., 3:] * (frame[..., :3] - 1)
            write_png(folder / f"{count:05d}.png", opaque)
            count, size = count + 1, (frame.shape[1], frame.shape[0])
        film = folder / "film.mp4"
        (_by_ffmpeg if encode is None else encode)(folder, count, size, rate, film)
        write_bytes(path, film.read_bytes())


def has_ffmpeg() -> bool:
    """Whether that program is there."""
    return shutil.which("ffmpeg") is not None


def check_film(path: Path) -> None:
    """Find out before long work whether films have such names.

    Raises
    ------
    RosyError
    """
    if path.suffix.lower() not in FILMS:
        raise RosyError(f"{path}: films are written to {' and '.join(FILMS)} files")


def _by_ffmpeg(folder: Path, count: int, size: tuple[int, int], rate: float, path: Path) -> None:
    command = [
        "ffmpeg", "-v", "error", "-y", "-framerate", f"{rate:g}", "-i", f"{folder}/%05d.png",
        "-c:v", "libx264", "-crf", "16", "-pix_fmt", "yuv420p", str(path),
    ]  # fmt: skip
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode:
        why = (done.stderr.strip().splitlines() or ["it failed"])[-1]
        raise RosyError(f"ffmpeg: {why}")


def _on_paper(rgba: np.ndarray) -> np.ndarray:
    """(H, W, 3) uint8 from the top."""
    mixed = 1 + rgba[..., 3:] * (rgba[..., :3] - 1)
    return np.rint(to_display(mixed[::-1]) * 255).astype(np.uint8)


def _turned_hull(points: np.ndarray) -> np.ndarray:
    """Points that bound all that a mesh passes as it turns about the z axis through its middle."""
    middle = (points.min(axis=0) + points.max(axis=0)) / 2
    out = np.hypot(points[:, 0] - middle[0], points[:, 1] - middle[1])
    # The widest points of each of some slices will do.
    slices = np.clip(
        (points[:, 2] - points[:, 2].min()) / np.ptp(points[:, 2]).clip(1e-12) * 31, 0, 31
    )
    widest = np.zeros(32)
    np.maximum.at(widest, slices.astype(int), out)
    low, high = np.full(32, np.inf), np.full(32, -np.inf)
    np.minimum.at(low, slices.astype(int), points[:, 2])
    np.maximum.at(high, slices.astype(int), points[:, 2])
    used = np.isfinite(low)
    angle = np.linspace(0, 2 * np.pi, AROUND, endpoint=False)
    rings = []
    for height in (low[used], high[used]):
        x = middle[0] + widest[used, None] * np.cos(angle)
        y = middle[1] + widest[used, None] * np.sin(angle)
        z = np.broadcast_to(height[:, None], x.shape)
        rings.append(np.stack([x, y, z], axis=-1).reshape(-1, 3))
    return np.concatenate(rings)


def _camera(
    hull: np.ndarray,
    azimuth: float,
    elevation: float,
    size: tuple[int, int],
    finer: int,
    perspective: bool,
) -> Camera:
    width, height = (side * finer for side in size)
    return orbit_camera(hull, azimuth, elevation, width, height, perspective=perspective)
