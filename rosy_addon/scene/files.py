"""Files and folders: open and save .blend files, name picture files, and find the user's folders."""

import atexit
import os
import unicodedata
import zlib
from pathlib import Path

import bpy

from ..core.errors import RosyError
from ..core.file_io import check_readable
from ..preset_files.store import default_user_folder


def open_blend(path: Path) -> None:
    """Open a .blend file, without running scripts and drivers in it. It replaces the file that is open.

    Raises
    ------
    RosyError
        If the file is missing or cannot be read.
    """
    check_readable(path)
    try:
        name = os.path.realpath(path)
        bpy.ops.wm.open_mainfile(filepath=name, load_ui=False, use_scripts=False)
    except RuntimeError as reason:
        raise RosyError(f"{path}: cannot be read: {_one_line(reason)}") from None
    # The module bpy 4.2 crashes at its end if a driver was not allowed to run.
    if not bpy.app.binary_path:
        atexit.register(bpy.ops.wm.read_factory_settings, use_empty=True)


def save_blend() -> str:
    """Save the open file under its name, and return its path.

    Raises
    ------
    RosyError
        If the file was never saved, or cannot be written.
    """
    path = bpy.data.filepath
    if not path:
        raise RosyError(
            "--save: the open file was never saved and has no name: save it in Blender first"
        )
    try:
        bpy.ops.wm.save_mainfile()
    except RuntimeError as reason:
        raise RosyError(f"{path}: cannot be written: {_one_line(reason)}") from None
    return path


def _one_line(error: RuntimeError) -> str:
    """Return the message of an error of Blender as one line."""
    lines = [line.removeprefix("Error:").strip() for line in str(error).splitlines()]
    return "; ".join(line for line in lines if line)


#: Largest number of bytes of the stem of a file name. File systems allow 255 for the whole name, which also
#: has a hash, a frame number and suffixes.
MAX_STEM_BYTES = 180

#: Kinds of pictures whose file names do not mention the kind.
PLAIN_KINDS = ("camera", "scene")


def picture_stem(name: str, kind: str = "camera") -> str:
    """Return the stem of the names of picture files, such as ``RoSy_Camera`` or ``RoSy_Cube_texture``.

    `name` is the name of a camera (`kind` "camera"), of a scene (`kind` "scene") or of an object with a
    texture. For a texture, `kind` says what it shows, such as "texture" or "flow", and ends the stem.

    Characters that file systems do not allow become underscores, and long names are cut. Two names may then
    have stems that some file systems treat as equal, for example because they ignore case. The first of the
    names then has the plain stem, and the stems of the others end in a hash. Names that were not changed come
    first, then the order is alphabetical. It depends only on the names in the .blend file, so all processes
    agree.
    """
    siblings = {("camera", obj.name) for obj in bpy.data.objects if obj.type == "CAMERA"}
    siblings |= {("scene", scene.name) for scene in bpy.data.scenes}
    if kind not in PLAIN_KINDS:
        siblings |= {(kind, obj.name) for obj in bpy.data.objects if obj.type == "MESH"}
    siblings.add((kind, name))
    stem = _clean_stem(kind, name)
    rivals = [key for key in siblings if _file_key(_clean_stem(*key)) == _file_key(stem)]
    first = min(rivals, key=lambda key: (_clean_stem(*key) != f"RoSy_{key[1]}", key))
    if (kind, name) == first:
        return stem
    return f"{stem}-{zlib.crc32(f'{kind} {name}'.encode()):08x}"


def _clean_stem(kind: str, name: str) -> str:
    """Return ``RoSy_``, the name and, for a texture, the kind, as the stem of a file name.

    Characters that are not allowed become underscores, and a long name is cut.
    """
    stem = bpy.path.clean_name(f"RoSy {name}").encode()[:MAX_STEM_BYTES]
    ending = "" if kind in PLAIN_KINDS else f" {kind}"
    return stem.decode(errors="ignore") + bpy.path.clean_name(ending)


def _file_key(stem: str) -> str:
    """Return a key of a stem. Stems that some file system treats as the same name have equal keys."""
    return unicodedata.normalize("NFC", unicodedata.normalize("NFC", stem).casefold())


#: Package name of the extension in Blender: this module is in the package two levels below it.
EXTENSION_ID = __package__.rsplit(".", 2)[0]


def user_presets_folder() -> Path:
    """Return the folder of the user's own presets. It may not exist yet.

    It is the path in the environment variable ROSY_PRESETS, if this is set. Otherwise it is in the folder
    that Blender provides for the files of an extension or, if RoSy does not run as an extension, in the
    user data folder of the operating system (`default_user_folder`).
    """
    if not os.environ.get("ROSY_PRESETS"):
        try:
            return Path(bpy.utils.extension_path_user(EXTENSION_ID, path="presets"))
        except ValueError:  # not installed as an extension
            pass
    return default_user_folder()


def output_folder(scene: bpy.types.Scene) -> Path:
    """Return the folder in which the pictures of a scene are saved.

    Raises
    ------
    RosyError
        If no folder is set, or it is relative to a .blend file that was never saved.
    """
    directory = scene.rosy.directory
    if not directory.strip():
        raise RosyError(f"scene '{scene.name}' has no folder for pictures: choose one (Output)")
    # Made absolute, as Blender would later interpret a path relative to the working directory in another way.
    return absolute_path(directory).absolute()


def absolute_path(path: str) -> Path:
    """Return a path in which ``//`` at the start is replaced by the folder of the .blend file.

    Raises
    ------
    RosyError
        If the path starts with ``//`` and the .blend file was never saved.
    """
    if path.startswith("//") and not bpy.data.filepath:
        raise RosyError(f"{path}: save the .blend file first, or choose an absolute path")
    return Path(bpy.path.abspath(path))


def is_beside_blend(folder: Path) -> bool:
    """Return whether a folder is the folder of the .blend file, or inside it. Symbolic links are resolved."""
    blend = bpy.data.filepath
    blend_folder = os.path.realpath(Path(blend).parent)
    return bool(blend) and Path(os.path.realpath(folder)).is_relative_to(blend_folder)
