"""Pictures as Blender's images."""

from __future__ import annotations

import os
from pathlib import Path

import bpy
import numpy as np

from ..compositor.colour import to_display, to_linear
from ..compositor.picture import Picture
from ..compositor.png import write_png
from ..errors import RosyError
from ..files import check_writable

#: How far, in pixels, colours are carried on past the border of what is covered, so that a render
#: whose border differs by a little (other subdivision, filtering) still finds the picture there.
MARGIN = 4

#: What is shown where there is no picture: mid grey on screen, in linear light.
NEUTRAL = float(to_linear(np.array(0.5, dtype=np.float32)))


def new_image(
    name: str, picture: Picture, *, as_float: bool = False, folder: Path | None = None
) -> bpy.types.Image:
    """A new image of a picture.

    Parameters
    ----------
    name : str
    picture : Picture
    as_float : bool
        Linear values in single precision, an .exr file; 8 bits sRGB, a .png file, if not.
    folder : Path, optional
        Where to save it; packed into the .blend file if not given.

    Raises
    ------
    RosyError
        If it cannot be written. No image is left then.
    """
    rgba = with_margin(picture.rgba)
    height, width = rgba.shape[:2]
    image = bpy.data.images.new(name, width, height, alpha=True, float_buffer=as_float)
    try:
        image.alpha_mode = "CHANNEL_PACKED"
        image.colorspace_settings.name = "Non-Color" if as_float else "sRGB"
        if not as_float:
            rgba[..., :3] = to_display(rgba[..., :3])
        image.pixels.foreach_set(np.ascontiguousarray(rgba, dtype=np.float32).ravel())
        image.update()
        if folder is None:
            image.pack()
        else:
            _save(image, picture, folder / bpy.path.clean_name(name))
    except BaseException:
        bpy.data.images.remove(image)
        raise
    return image


def with_margin(rgba: np.ndarray) -> np.ndarray:
    """A picture with the colours of its border carried on by `MARGIN` pixels, and neutral beyond.

    Alpha stays: it says what is covered.
    """
    # With a frame of its own, so that every pixel has eight neighbours.
    framed = np.pad(rgba, ((1, 1), (1, 1), (0, 0)))
    height, width = framed.shape[:2]
    known = framed[..., 3].ravel() > 0
    colour = framed.reshape(-1, 4)
    colour[~known, :3] = NEUTRAL
    inside = np.zeros((height, width), dtype=bool)
    inside[1:-1, 1:-1] = True
    around = [row * width + column for row in (1, 0, -1) for column in (1, 0, -1) if row or column]
    covered = np.flatnonzero(known)
    for _ in range(MARGIN):
        fresh = np.zeros_like(known)
        for away in around:
            fresh[covered + away] = True
        place = np.flatnonzero(fresh & ~known & inside.ravel())
        total = np.zeros((len(place), 3), dtype=np.float32)
        count = np.zeros((len(place), 1), dtype=np.float32)
        for away in around:
            there = known[place + away, None]
            total += colour[place + away, :3] * there
            count += there
        colour[place, :3] = total / count
        known[place] = True
        covered = place
    return framed[1:-1, 1:-1].copy()


def check_folder(folder: Path) -> None:
    """Find out before long work whether pictures can be saved to a folder; make it if need be.

    Raises
    ------
    RosyError
        If not.
    """
    if not folder.exists():
        parent = next((up for up in folder.parents if up.exists()), folder)
        if not parent.is_dir() or not os.access(parent, os.W_OK):
            raise RosyError(f"{folder}: cannot be made: {parent} may not be written")
        return
    if not folder.is_dir():
        raise RosyError(f"{folder}: is not a folder")
    check_writable(folder / "picture.png")


def frame_path(folder: Path, name: str, frame: int, as_float: bool) -> Path:
    """The file of one frame of a sequence, numbered as Blender finds it."""
    stem = bpy.path.clean_name(f"RoSy {name}")
    return folder / f"{stem}_{frame:04d}{'.exr' if as_float else '.png'}"


def write_frame(path: Path, picture: Picture, as_float: bool) -> None:
    """Write one frame: 8 bit .png, or half floats as .exr; all of it or nothing.

    Raises
    ------
    RosyError
        If it cannot be written.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    check_writable(path)
    rgba = with_margin(picture.rgba)
    if not as_float:
        write_png(path, rgba)
        return
    height, width = rgba.shape[:2]
    image = bpy.data.images.new(path.stem, width, height, alpha=True, float_buffer=True)
    # Blender writes by the settings of a scene; one of its own, since the user's stays as it is.
    scene = bpy.data.scenes.new(path.stem)
    aside = path.with_name(f".{os.getpid()}.{path.name}")
    try:
        image.colorspace_settings.name = "Non-Color"
        image.pixels.foreach_set(np.ascontiguousarray(rgba, dtype=np.float32).ravel())
        written = scene.render.image_settings
        written.file_format, written.color_mode, written.color_depth = "OPEN_EXR", "RGBA", "16"
        image.save_render(str(aside), scene=scene)
        os.replace(aside, path)
    except (RuntimeError, OSError) as reason:
        aside.unlink(missing_ok=True)
        raise RosyError(f"{path}: cannot be written: {reason}") from reason
    finally:
        bpy.data.images.remove(image)
        bpy.data.scenes.remove(scene)


def load_strip(path: Path, as_float: bool) -> bpy.types.Image:
    """A sequence of pictures as one image, by the file of its first frame."""
    image = bpy.data.images.load(str(path), check_existing=False)
    image.source = "SEQUENCE"
    image.alpha_mode = "CHANNEL_PACKED"
    image.colorspace_settings.name = "Non-Color" if as_float else "sRGB"
    image.filepath = _relative(path)
    return image


def _save(image: bpy.types.Image, picture: Picture, stem: Path) -> None:
    """Have a file hold what an image holds; it takes the place of one from an earlier bake."""
    path = stem.with_name(stem.name + (".exr" if image.is_float else ".png"))
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
    except OSError as reason:
        raise RosyError(f"{path.parent}: cannot be made: {reason.strerror.lower()}") from reason
    check_writable(path)
    if image.is_float:
        image.file_format = "OPEN_EXR"
        image.filepath_raw = str(path)
        try:
            image.save()
        except RuntimeError as reason:
            raise RosyError(f"{path}: cannot be written: {reason}") from reason
    else:
        write_png(path, with_margin(picture.rgba))
        image.file_format = "PNG"
    image.source = "FILE"
    image.filepath = _relative(path)
    image.reload()


def _relative(path: Path) -> str:
    """As Blender writes paths beside a saved file."""
    try:
        return bpy.path.relpath(str(path)) if bpy.data.filepath else str(path)
    except ValueError:
        return str(path)  # another drive
