"""Pictures as Blender images: packed, saved to a file, or one file for each frame."""

from __future__ import annotations

import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

import bpy
import numpy as np

from ..color import to_linear
from ..compositor.picture import Picture
from ..errors import RosyError
from ..file_io import check_writable, make_folder, replacing, write_bytes
from ..image_io.png import png_bytes
from ..progress import progress, report

#: Pixels by which colors are extended past the border of the covered area. A render whose
#: silhouette differs slightly (other subdivision, filtering) then still samples the picture.
BLEED_PIXELS = 4

#: Rows that are converted at once.
BLOCK_ROWS = 64

#: Label of all steps.
STEP_LABEL = "converting the picture"

#: Shown where there is no picture: the linear value of mid gray on screen.
NEUTRAL_GRAY = float(to_linear(np.array(0.5, dtype=np.float32)))


class ImageData(NamedTuple):
    """A picture as a Blender image stores it.

    Attributes
    ----------
    pixels : (H, W, 4) float32 ndarray
        Linear, with bleed; see `with_bleed`. Thresholds of ink with their spread, if the picture has them.
    png : bytes or None
        The file of an 8-bit image, None for an image in single precision.
    """

    pixels: np.ndarray
    png: bytes | None = None


def compute_image_data(picture: Picture, *, as_float: bool) -> ImageData:
    """Convert a picture for a Blender image.

    Parameters
    ----------
    picture : Picture
    as_float : bool
        Store linear values in single precision (.exr) instead of 8-bit sRGB (.png).

    Returns
    -------
    ImageData
    """
    with progress(0.0, 0.5):
        pixels = _bleed(picture.rgba)
    if picture.spread is not None:
        spread = picture.rgba.copy()
        spread[..., 0] = picture.spread
        with progress(0.5):
            spread = _bleed(spread)
        # Where nothing was drawn, the ink is a mean tone.
        is_blank = spread[..., 3] == 0
        is_blank &= (pixels[..., :3] == NEUTRAL_GRAY).all(axis=2)
        pixels[..., 3] = spread[..., 0]
        pixels[is_blank] = (0.5, 0.5, 0.5, 1 / 3)
    if as_float:
        return ImageData(pixels)
    with progress(0.5, 1.0, STEP_LABEL):
        return ImageData(pixels, png_bytes(pixels, is_color=picture.spread is None))


def _bleed(rgba: np.ndarray) -> np.ndarray:
    """Return `with_bleed` of a picture, a few rows at a time."""
    height = len(rgba)
    pixels = np.empty(rgba.shape, dtype=np.float32)
    for start in range(0, height, BLOCK_ROWS):
        report(start / height, STEP_LABEL)
        first = max(start - BLEED_PIXELS, 0)
        block = with_bleed(rgba[first : start + BLOCK_ROWS + BLEED_PIXELS])
        pixels[start : start + BLOCK_ROWS] = block[start - first :][:BLOCK_ROWS]
    return pixels


def new_image(
    name: str,
    image_data: ImageData,
    *,
    as_float: bool = False,
    is_color: bool = True,
    stem: Path | None = None,
) -> bpy.types.Image:
    """Create a Blender image.

    Parameters
    ----------
    name : str
        Name of the datablock.
    image_data : ImageData
        From `compute_image_data`, with the same parameters.
    as_float : bool
        Whether linear values are stored in single precision.
    is_color : bool
        Whether 8-bit values are colors (sRGB), and not data.
    stem : Path, optional
        Path to save the image at, without the suffix. By default it is packed into the .blend file.

    Raises
    ------
    RosyError
        If the file cannot be written. The image is deleted in this case.
    """
    height, width = image_data.pixels.shape[:2]
    image = bpy.data.images.new(name, width, height, alpha=True, float_buffer=as_float)
    try:
        image.alpha_mode = "CHANNEL_PACKED"
        image.colorspace_settings.name = "sRGB" if is_color and not as_float else "Non-Color"
        if as_float:
            image.pixels.foreach_set(image_data.pixels.ravel())
            image.update()
        if stem is not None:
            _save_image(image, image_data.png, stem)
        elif as_float:
            image.pack()
        else:
            image.pack(data=image_data.png, data_len=len(image_data.png))
            image.source = "FILE"
    except BaseException:
        bpy.data.images.remove(image)
        raise
    return image


def new_tiled_image(
    name: str,
    tiles: Mapping[int, ImageData],
    *,
    as_float: bool = False,
    is_color: bool = True,
    stem: Path | None = None,
) -> bpy.types.Image:
    """Create a Blender image of UDIM tiles.

    Parameters
    ----------
    name, as_float, is_color
        As for `new_image`.
    tiles : mapping of int to ImageData
        The tiles by their UDIM numbers.
    stem : Path, optional
        Path to save the tiles at, without their numbers and the suffix. By default they are packed into the
        .blend file.

    Raises
    ------
    RosyError
        If a file cannot be written.
    """
    if stem is not None:
        return _load_tiles(name, tiles, stem, as_float, is_color)
    # Blender packs tiles only from files.
    with tempfile.TemporaryDirectory(dir=bpy.app.tempdir or None) as folder:
        image = _load_tiles(name, tiles, Path(folder) / "tile", as_float, is_color)
        try:
            image.pack()
        except RuntimeError as reason:
            bpy.data.images.remove(image)
            raise RosyError(f"image '{name}': cannot be packed: {reason}") from reason
    # Where the tiles go if they are unpacked.
    image.filepath_raw = f"//{name}.<UDIM>{'.exr' if as_float else '.png'}"
    for file in image.packed_files:
        file.filepath = image.filepath_raw.replace("<UDIM>", str(file.tile_number))
    return image


def _load_tiles(
    name: str, tiles: Mapping[int, ImageData], stem: Path, as_float: bool, is_color: bool
) -> bpy.types.Image:
    """Write tiles to files, and load them as one image."""
    paths = {
        number: stem.with_name(f"{stem.name}.{number}{'.exr' if as_float else '.png'}")
        for number in sorted(tiles)
    }
    for number, path in paths.items():
        write_frame(path, tiles[number])
    first = next(iter(paths.values()))
    image = bpy.data.images.load(_blend_relative(first), check_existing=False)
    image.name = name
    image.source = "TILED"  # finds the other tiles
    image.alpha_mode = "CHANNEL_PACKED"
    image.colorspace_settings.name = "sRGB" if is_color and not as_float else "Non-Color"
    known = {tile.number for tile in image.tiles}
    for number in known - paths.keys():  # files of an earlier texture
        image.tiles.remove(image.tiles.get(number))
    for number in paths.keys() - known:
        image.tiles.new(number)
    return image


def with_bleed(rgba: np.ndarray) -> np.ndarray:
    """Return a picture whose border colors are extended by `BLEED_PIXELS` pixels.

    Pixels farther outside are `NEUTRAL_GRAY`. Alpha is not changed: it is the coverage.

    Parameters
    ----------
    rgba : (H, W, 4) float32 ndarray
        Linear.

    Returns
    -------
    (H, W, 4) float32 ndarray
    """
    # Pad by one pixel, so that every pixel of the picture has eight neighbors.
    padded = np.pad(rgba, ((1, 1), (1, 1), (0, 0)))
    height, width = padded.shape[:2]
    is_filled = padded[..., 3].ravel() > 0
    pixels = padded.reshape(-1, 4)
    pixels[~is_filled, :3] = NEUTRAL_GRAY
    is_inside = np.zeros((height, width), dtype=bool)
    is_inside[1:-1, 1:-1] = True
    neighbor_offsets = [
        row * width + column for row in (1, 0, -1) for column in (1, 0, -1) if row or column
    ]
    frontier = np.flatnonzero(is_filled)
    for _ in range(BLEED_PIXELS):
        is_adjacent = np.zeros_like(is_filled)
        for offset in neighbor_offsets:
            is_adjacent[frontier + offset] = True
        targets = np.flatnonzero(is_adjacent & ~is_filled & is_inside.ravel())
        total = np.zeros((len(targets), 3), dtype=np.float32)
        count = np.zeros((len(targets), 1), dtype=np.float32)
        for offset in neighbor_offsets:
            neighbor_filled = is_filled[targets + offset, None]
            total += pixels[targets + offset, :3] * neighbor_filled
            count += neighbor_filled
        pixels[targets, :3] = total / count
        is_filled[targets] = True
        frontier = targets
    return padded[1:-1, 1:-1].copy()


def frame_path(stem: Path, frame: int, as_float: bool) -> Path:
    """Return the path of one frame of an image sequence, numbered as Blender expects it."""
    return stem.with_name(f"{stem.name}_{frame:04d}{'.exr' if as_float else '.png'}")


def write_frame(path: Path, image_data: ImageData) -> None:
    """Write a frame of an image sequence or a tile: 8-bit .png, or .exr with half floats.

    If writing fails, no partial file is left.

    Parameters
    ----------
    path : Path
    image_data : ImageData

    Raises
    ------
    RosyError
        If the file cannot be written.
    """
    make_folder(path.parent)
    check_writable(path)
    if image_data.png is not None:
        write_bytes(path, image_data.png)
        return
    height, width = image_data.pixels.shape[:2]
    image = bpy.data.images.new(path.stem, width, height, alpha=True, float_buffer=True)
    # Blender takes the output format from a scene. A temporary one leaves the user's unchanged.
    scene = bpy.data.scenes.new(path.stem)
    try:
        image.colorspace_settings.name = "Non-Color"
        image.pixels.foreach_set(image_data.pixels.ravel())
        image_settings = scene.render.image_settings
        image_settings.file_format, image_settings.color_mode, image_settings.color_depth = (
            "OPEN_EXR",
            "RGBA",
            "16",
        )
        with replacing(path) as temporary:
            image.save_render(str(temporary), scene=scene)
    except RuntimeError as reason:
        raise RosyError(f"{path}: cannot be written: {reason}") from reason
    finally:
        bpy.data.images.remove(image)
        bpy.data.scenes.remove(scene)


def load_sequence(path: Path, as_float: bool) -> bpy.types.Image:
    """Load an image sequence as one Blender image, from the path of its first frame."""
    image = bpy.data.images.load(str(path), check_existing=False)
    image.source = "SEQUENCE"
    image.alpha_mode = "CHANNEL_PACKED"
    image.colorspace_settings.name = "Non-Color" if as_float else "sRGB"
    image.filepath = _blend_relative(path)
    return image


def _save_image(image: bpy.types.Image, png: bytes | None, stem: Path) -> None:
    """Save an image to a file, and make the image use this file. An older file is replaced.

    The contents of a .png are given. An .exr is written by Blender.
    """
    path = stem.with_name(stem.name + (".exr" if image.is_float else ".png"))
    make_folder(path.parent)
    check_writable(path)
    if png is None:
        image.file_format = "OPEN_EXR"
        image.filepath_raw = str(path)
        try:
            image.save()
        except RuntimeError as reason:
            raise RosyError(f"{path}: cannot be written: {reason}") from reason
    else:
        write_bytes(path, png)
        image.file_format = "PNG"
    image.source = "FILE"
    image.filepath = _blend_relative(path)
    image.reload()


def _blend_relative(path: Path) -> str:
    """Return a path relative to the .blend file (``//``) if that is saved and on the same drive."""
    try:
        return bpy.path.relpath(str(path)) if bpy.data.filepath else str(path)
    except ValueError:
        return str(path)  # another drive
