"""Names of the files of pictures, a different one for each camera and scene."""

from __future__ import annotations

import unicodedata
import zlib

import bpy

#: Largest number of bytes of a stem. File systems allow 255 for a whole name, which also has a hash, a
#: number and suffixes.
MAX_STEM_BYTES = 180

#: Kinds of pictures whose stems do not say it.
PLAIN_KINDS = ("camera", "scene")


def picture_stem(name: str, kind: str = "camera") -> str:
    """Return the stem of the picture files of a camera or a scene, such as ``RoSy_Camera``.

    Those of an object are such as ``RoSy_Cube_texture``, with the kind of texture.

    Characters that file systems do not allow become underscores, and long names are cut. If cameras
    or scenes would then have the same file, also where file systems ignore case, one of them has
    the plain name, and the stems of the others end in a hash. Which one depends only on the names
    in the .blend file, so several processes agree.
    """
    siblings = {("camera", obj.name) for obj in bpy.data.objects if obj.type == "CAMERA"}
    siblings |= {("scene", scene.name) for scene in bpy.data.scenes}
    if kind not in PLAIN_KINDS:
        siblings |= {(kind, obj.name) for obj in bpy.data.objects if obj.type == "MESH"}
    siblings.add((kind, name))
    stem = _clean_stem(*_label(kind, name))
    rivals = [key for key in siblings if _file_key(_clean_stem(*_label(*key))) == _file_key(stem)]
    first = min(rivals, key=lambda key: (_clean_stem(*_label(*key)) != f"RoSy_{key[1]}", key))
    if (kind, name) == first:
        return stem
    return f"{stem}-{zlib.crc32(f'{kind} {name}'.encode()):08x}"


def _label(kind: str, name: str) -> tuple[str, str]:
    """Return what the stem consists of: a name, and what follows it."""
    return name, "" if kind in PLAIN_KINDS else f" {kind}"


def _clean_stem(name: str, ending: str) -> str:
    """Return the stem with underscores for characters that are not allowed, cut to its length."""
    stem = bpy.path.clean_name(f"RoSy {name}").encode()[:MAX_STEM_BYTES]
    return stem.decode(errors="ignore") + bpy.path.clean_name(ending)


def _file_key(stem: str) -> str:
    """Return a text that is the same for stems which some file system takes for the same name."""
    return unicodedata.normalize("NFC", unicodedata.normalize("NFC", stem).casefold())
