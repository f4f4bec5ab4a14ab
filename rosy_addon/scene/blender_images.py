"""Create Blender images from pictures: packed, saved to a file, or as a file for each frame."""

import tempfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

import bpy
import numpy as np
from bpy.types import Image

from ..core.errors import RosyError
from ..core.file_io import make_folder, replacing, write_bytes
from ..image_io.exr import is_whole_exr
from ..image_io.image_data import ImageData, image_size


def new_image(
    name: str, image_data: ImageData, *, is_color: bool = True, stem: Path | None = None
) -> Image:
    """Create a Blender image.

    Parameters
    ----------
    name : str
        Name of the datablock.
    image_data : ImageData
        The bytes of a PNG file for an image with 8 bits per channel, or an array of linear values for an
        image in single precision.
    is_color : bool
        Whether 8-bit values are colors (sRGB). Otherwise they are data, which Blender does not convert.
    stem : Path, optional
        Path of the file that is written, without the suffix. By default the image is packed into the .blend
        file.

    Raises
    ------
    RosyError
        If the file cannot be written. The image is deleted in this case.
    """
    as_float = not isinstance(image_data, bytes)
    image = bpy.data.images.new(name, *image_size(image_data), alpha=True, float_buffer=as_float)
    try:
        image.alpha_mode = "CHANNEL_PACKED"
        image.colorspace_settings.name = "sRGB" if is_color and not as_float else "Non-Color"
        if as_float:
            image.pixels.foreach_set(image_data.ravel())
            image.update()
        if stem is not None:
            _save_image(image, image_data, stem)
        elif as_float:
            image.pack()
        else:
            image.pack(data=image_data, data_len=len(image_data))
            image.source = "FILE"
    except BaseException:
        bpy.data.images.remove(image)
        raise
    return image


def new_tiled_image(
    name: str, tiles: Mapping[int, ImageData], *, is_color: bool = True, stem: Path | None = None
) -> Image:
    """Create a Blender image of UDIM tiles.

    Parameters
    ----------
    name : str
        Name of the datablock.
    is_color : bool
        Whether 8-bit values are colors (sRGB) instead of data.
    tiles : mapping of int to ImageData
        The tiles by their UDIM numbers.
    stem : Path, optional
        Path of the files that are written, without the tile number and the suffix. By default the tiles are
        packed into the .blend file.

    Raises
    ------
    RosyError
        If a file cannot be written.
    """
    if stem is not None:
        return _load_tiles(name, tiles, stem, is_color)
    # Blender packs tiles only from files.
    with tempfile.TemporaryDirectory(dir=bpy.app.tempdir or None) as folder:
        image = _load_tiles(name, tiles, Path(folder) / "tile", is_color)
        try:
            image.pack()
        except RuntimeError as reason:
            bpy.data.images.remove(image)
            raise RosyError(f"image '{name}': cannot be packed: {reason}") from reason
    # Paths to which Blender writes the tiles if the user unpacks them.
    image.filepath_raw = f"//{name}.<UDIM>{Path(image.filepath_raw).suffix}"
    for file in image.packed_files:
        file.filepath = image.filepath_raw.replace("<UDIM>", str(file.tile_number))
    return image


def _load_tiles(name: str, tiles: Mapping[int, ImageData], stem: Path, is_color: bool) -> Image:
    """Write tiles to files, and load them as one image.

    The files are named by `stem` (a path), the tile number and the suffix. `is_color` says whether 8-bit
    values are colors instead of data.
    """
    as_float = not all(isinstance(tile, bytes) for tile in tiles.values())
    paths = {
        number: image_path(stem.with_name(f"{stem.name}.{number}"), as_float)
        for number in sorted(tiles)
    }
    write_images({path: tiles[number] for number, path in paths.items()})
    first = next(iter(paths.values()))
    image = bpy.data.images.load(_blend_relative(first), check_existing=False)
    image.name = name
    image.source = "TILED"  # finds the other tiles
    image.alpha_mode = "CHANNEL_PACKED"
    image.colorspace_settings.name = "sRGB" if is_color and not as_float else "Non-Color"
    known = {tile.number for tile in image.tiles}
    for number in known - paths.keys():  # from files of an earlier texture
        image.tiles.remove(image.tiles.get(number))
    for number in paths.keys() - known:
        image.tiles.new(number)
    return image


def frame_path(stem: Path, frame: int, as_float: bool) -> Path:
    """Return the path of a frame of an image sequence: stem, frame number in at least 4 digits, suffix.

    The suffix is .exr if `as_float`, otherwise .png.
    """
    return image_path(stem.with_name(f"{stem.name}_{frame:04d}"), as_float)


def image_path(stem: Path, as_float: bool) -> Path:
    """Return the path of an image file: stem, suffix. The stem may have dots.

    The suffix is .exr for linear values, or .png for 8 bits per channel.
    """
    return stem.with_name(stem.name + (".exr" if as_float else ".png"))


def write_images(contents: Mapping[Path, ImageData]) -> None:
    """Write frames of image sequences, or UDIM tiles, as 8-bit .png files or as .exr files with half floats.

    If one of them cannot be written, none is, and no partial file is left.

    Parameters
    ----------
    contents : mapping of Path to ImageData
        For each file, with its suffix, the bytes of a PNG file, or an array of linear values, which is written
        as an .exr.

    Raises
    ------
    RosyError
        If a file cannot be written.
    """
    for path in contents:
        make_folder(path.parent)
    with replacing(*contents) as temporaries:
        for temporary, (path, image_data) in zip(temporaries, contents.items(), strict=True):
            if isinstance(image_data, bytes):
                temporary.write_bytes(image_data)
            else:
                with _checking(temporary, path):
                    _write_half_floats(temporary, image_data)


def _write_half_floats(path: Path, pixels: np.ndarray) -> None:
    """Write an array of linear values to a file, as an .exr with half floats."""
    image = bpy.data.images.new(path.stem, *image_size(pixels), alpha=True, float_buffer=True)
    # Blender takes the output format from a scene. A temporary one leaves the user's unchanged.
    scene = bpy.data.scenes.new(path.stem)
    try:
        image.colorspace_settings.name = "Non-Color"
        image.pixels.foreach_set(pixels.ravel())
        settings = scene.render.image_settings
        settings.file_format, settings.color_mode, settings.color_depth = "OPEN_EXR", "RGBA", "16"
        image.save_render(str(path), scene=scene)
    finally:
        bpy.data.images.remove(image)
        bpy.data.scenes.remove(scene)


def load_sequence(path: Path, as_float: bool) -> Image:
    """Load an image sequence as one Blender image, from the path of its first frame.

    `as_float` says whether the files have linear values (.exr) instead of 8-bit sRGB (.png).
    """
    image = bpy.data.images.load(str(path), check_existing=False)
    image.source = "SEQUENCE"
    image.alpha_mode = "CHANNEL_PACKED"
    image.colorspace_settings.name = "Non-Color" if as_float else "sRGB"
    image.filepath = _blend_relative(path)
    return image


def _save_image(image: Image, image_data: ImageData, stem: Path) -> None:
    """Save an image to a file, and make the image use this file. An existing file is replaced.

    `stem` is the path without the suffix. If the image has pixels in single precision, Blender writes them as
    an .exr file. Otherwise `image_data` has the bytes of a PNG file, which are written as they are.
    """
    path = image_path(stem, image.is_float)
    make_folder(path.parent)
    if image.is_float:
        with replacing(path) as (temporary,), _checking(temporary, path):
            image.file_format, image.filepath_raw = "OPEN_EXR", str(temporary)
            image.save()
    else:
        write_bytes(path, image_data)
        image.file_format = "PNG"
    image.source = "FILE"
    image.filepath = _blend_relative(path)
    image.reload()


@contextmanager
def _checking(temporary: Path, path: Path) -> Iterator[None]:
    """Context manager: check that Blender has written a complete .exr file to the path `temporary` in the block.

    `path` is the final path, for the error message. Blender does not say why it cannot write a file. `replacing`
    has ruled out other causes, so the disk is most likely full. If only the end of the file does not fit, Blender
    raises no error.
    """
    reason = None
    try:
        yield
    except RuntimeError as error:
        reason = error
    if reason is not None or not is_whole_exr(temporary):
        raise RosyError(f"{path}: cannot be written by Blender: is the disk full?") from reason


def _blend_relative(path: Path) -> str:
    """Return a path relative to the .blend file (``//``), or the path itself if that is not possible."""
    try:
        return bpy.path.relpath(str(path)) if bpy.data.filepath else str(path)
    except ValueError:
        return str(path)  # the .blend file is on another drive
