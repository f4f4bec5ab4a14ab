"""Looks as data: the presets that come with RoSy, and a user's own.

A preset is a small text file, the same for RoSy's own, for those a user keeps and for those that
users pass on: a name, a sentence, and the settings that differ from the default. Its picture lies
beside it as a .png, and can always be drawn again from the look (`preview.draw_preview`); so files
that are passed on need none, and pictures of strangers are never read.
"""

from __future__ import annotations

import json
import os
import reprlib
import sys
import unicodedata
from contextlib import suppress
from dataclasses import fields
from pathlib import Path
from typing import Any, NamedTuple

from ..errors import RosyError
from ..files import read_bytes, write_bytes
from .look import Look
from .png import write_png
from .preview import draw_preview

#: Where the presets that come with RoSy are.
FOLDER = Path(__file__).resolve().parents[2] / "presets"

#: The one that holds RoSy's default look.
DEFAULT = "default"

#: Characters of a name and of a description, bytes of a file, at most.
LONGEST_NAME, LONGEST_DESCRIPTION, LARGEST_FILE = 48, 200, 1 << 16

#: Names that Windows keeps for devices, whatever ending they are given.
DEVICES = {"con", "prn", "aux", "nul"} | {f"{p}{n}" for p in ("com", "lpt") for n in range(10)}


class Preset(NamedTuple):
    """A look with a name.

    Attributes
    ----------
    name : str
        As a user sees it: a line of at most `LONGEST_NAME` characters.
    description : str
        A sentence: a line of at most `LONGEST_DESCRIPTION` characters.
    look : Look
    """

    name: str
    description: str
    look: Look


def own_folder() -> Path:
    """Where a user's own presets are if no Blender says where: ROSY_PRESETS, or with user data."""
    if "ROSY_PRESETS" in os.environ:
        return Path(os.environ["ROSY_PRESETS"])
    home = Path.home()
    if sys.platform == "win32":
        data = Path(os.environ.get("APPDATA", home / "AppData" / "Roaming"))
    elif sys.platform == "darwin":
        data = home / "Library" / "Application Support"
    else:
        data = Path(os.environ.get("XDG_DATA_HOME", home / ".local" / "share"))
    return data / "rosy" / "presets"


def preset_files(own: Path | None = None) -> dict[str, Path]:
    """The files of all presets, by the names they are called by.

    Parameters
    ----------
    own : Path, optional
        Folder of the user's own, which go before those of RoSy that are called the same.

    Returns
    -------
    dict of str to Path
        The default first, then RoSy's in alphabetical order, then the user's.
    """
    shipped = {path.stem: path for path in sorted(FOLDER.glob("*.json"))}
    found = {DEFAULT: shipped.pop(DEFAULT), **shipped}
    if own is not None and own.is_dir():
        mine = {path.stem: path for path in sorted(own.glob("*.json")) if path.is_file()}
        found = {key: path for key, path in found.items() if key not in mine} | mine
    return found


def preset_names(own: Path | None = None) -> list[str]:
    """What presets are called by; see `preset_files`."""
    return list(preset_files(own))


def find_preset(preset: str | Path, own: Path | None = None) -> Path:
    """The file of a preset.

    Parameters
    ----------
    preset : str or Path
        One of `preset_names`, the name that users see, or the path of a .json file.
    own : Path, optional
        Folder of the user's own.

    Raises
    ------
    RosyError
        If there is none of that name.
    """
    path = Path(preset)
    if path.suffix.lower() == ".json":
        return path
    files = preset_files(own)
    if str(preset) in files:
        return files[str(preset)]
    for path in files.values():
        with suppress(RosyError):
            if key_of(read_preset(path).name) == key_of(str(preset)):
                return path
    raise RosyError(f"no preset is named '{preset}'; there are {', '.join(files)}")


def load_preset(preset: str | Path, own: Path | None = None) -> Preset:
    """Read one of the presets there are, or a file; see `find_preset` and `read_preset`."""
    return read_preset(find_preset(preset, own))


def read_preset(path: str | os.PathLike[str]) -> Preset:
    """Read the file of a preset; one from a stranger is safe to read.

    Parameters
    ----------
    path : path-like
        Of an object with a `name`, a `description`, and a `look` of settings that differ from the
        default.

    Raises
    ------
    RosyError
        If it is no such object or larger than `LARGEST_FILE`, or it holds a setting that does not
        exist or a value that is not allowed.
    """
    data = _json_object(path)
    try:
        name, description, look = (data.pop(key) for key in ("name", "description", "look"))
    except KeyError as missing:
        raise RosyError(f"{path}: a preset needs a {missing}") from None
    if data:
        raise RosyError(f"{path}: a preset has no {_quoted(next(iter(data)))}")
    if not isinstance(look, dict):
        raise RosyError(f"{path}: 'look' is not an object of settings")
    unknown = sorted(set(look) - {entry.name for entry in fields(Look)})
    if unknown:
        raise RosyError(
            f"{path}: a look has no setting {_quoted(unknown[0])}: it is misspelt, or of a newer RoSy"
        )
    try:
        return _checked(Preset(name, description, Look().with_settings(look)))
    except RosyError as reason:
        raise RosyError(f"{path}: {reason}") from None


def write_preset(path: str | os.PathLike[str], preset: Preset) -> None:
    """Write a preset as a file that can be passed on, with the settings that differ alone.

    Raises
    ------
    RosyError
        If its name or description is not allowed, or the file cannot be written.
    """
    _checked(preset)
    data = preset._replace(look=changed_settings(preset.look))._asdict()
    text = json.dumps(data, indent=2, ensure_ascii=False) + "\n"
    write_bytes(path, text.encode("utf-8"))


def changed_settings(look: Look) -> dict[str, Any]:
    """The settings in which a look differs from the default, in their order."""
    values = {entry.name: (getattr(look, entry.name), entry.default) for entry in fields(Look)}
    return {name: value for name, (value, default) in values.items() if value != default}


def picture_path(path: Path) -> Path:
    """Where the picture of a preset's file lies, if there is one."""
    return path.with_suffix(".png")


def key_of(name: str) -> str:
    """What a preset is called by, and its file: letters and digits of its name, and dashes.

    Raises
    ------
    RosyError
        If there is no letter or digit in the name.
    """
    plain = unicodedata.normalize("NFC", name).lower()
    words = "".join(sign if sign.isalnum() else " " for sign in plain).split()
    if not words:
        raise RosyError(f"preset {_quoted(name)}: a name needs a letter or a digit")
    key = "-".join(words)
    return f"{key}-preset" if key in DEVICES else key


def save_preset(preset: Preset, own: Path, *, replace: bool = False) -> str:
    """Keep a preset, with its picture.

    Parameters
    ----------
    preset : Preset
    own : Path
        Folder of the user's own; made if it is missing.
    replace : bool
        Whether one that is there already may be replaced.

    Returns
    -------
    str
        What it is called by.

    Raises
    ------
    RosyError
        If its name or description is not allowed, is that of one that comes with RoSy, or of one
        of the user's own that may not be replaced; or it cannot be written.
    """
    path = _free_place(_checked(preset), own, replace)
    _make_folder(own)
    write_png(picture_path(path), draw_preview(preset.look))
    write_preset(path, preset)
    return path.stem


def rename_preset(key: str, name: str, description: str, own: Path) -> str:
    """Give one of the user's own presets another name, another description or both.

    Returns
    -------
    str
        What it is called by now.

    Raises
    ------
    RosyError
        If it is not the user's own, or the name is not allowed or taken.
    """
    path = _own_file(key, own)
    preset = _checked(read_preset(path)._replace(name=name, description=description))
    target = path if key_of(name) == path.stem else _free_place(preset, own, replace=False)
    write_preset(target, preset)
    if target != path:
        if picture_path(path).is_file():
            os.replace(picture_path(path), picture_path(target))
        _remove(path)
    return target.stem


def remove_preset(key: str, own: Path) -> None:
    """Delete one of the user's own presets, and its picture.

    Raises
    ------
    RosyError
        If it is not the user's own, or may not be deleted.
    """
    path = _own_file(key, own)
    _remove(path)
    _remove(picture_path(path))


def _checked(preset: Preset) -> Preset:
    """The same, if a user can be shown its name and description."""
    limits = (("name", LONGEST_NAME), ("description", LONGEST_DESCRIPTION))
    for what, longest in limits:
        words = getattr(preset, what)
        if not isinstance(words, str):
            raise RosyError(f"the {what} of a preset is {_quoted(words)}, not a text")
        if len(words) > longest:
            raise RosyError(
                f"the {what} of a preset has {len(words):,} characters, {longest} at most"
            )
        if not words.isprintable():
            raise RosyError(f"the {what} of a preset, {_quoted(words)}, is not a line of text")
    key_of(preset.name)
    return preset


def _free_place(preset: Preset, own: Path, replace: bool) -> Path:
    """Where a preset of the user's can be kept."""
    key = key_of(preset.name)
    if key in {*preset_names(), *(key_of(load_preset(name).name) for name in preset_names())}:
        raise RosyError(f"preset '{preset.name}' comes with RoSy: choose another name")
    path = own / f"{key}.json"
    if path.exists() and not replace:
        raise RosyError(f"there is a preset '{key}' already: replace it, or choose another name")
    return path


def _own_file(key: str, own: Path) -> Path:
    path = preset_files(own).get(key)
    if path is None or path.parent != own:
        raise RosyError(f"'{key}' is not a preset of your own")
    return path


def _make_folder(folder: Path) -> None:
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as reason:
        raise RosyError(f"{folder}: cannot be made: {str(reason.strerror).lower()}") from None


def _remove(path: Path) -> None:
    try:
        path.unlink(missing_ok=True)
    except OSError as reason:
        raise RosyError(f"{path}: cannot be deleted: {str(reason.strerror).lower()}") from None


def _json_object(path: str | os.PathLike[str]) -> dict[str, Any]:
    data = read_bytes(path, text=True, limit=LARGEST_FILE)
    try:
        found = json.loads(data.decode("utf-8-sig"), object_pairs_hook=_without_doubles)
    except RosyError as reason:
        raise RosyError(f"{path}: {reason}") from None
    except json.JSONDecodeError as reason:
        raise RosyError(f"{path}:{reason.lineno}: {reason.msg.lower()}") from None
    except UnicodeDecodeError:
        raise RosyError(f"{path}: is not UTF-8 text") from None
    except RecursionError:
        raise RosyError(f"{path}: is nested too deeply") from None
    except ValueError:  # a whole number of thousands of digits
        raise RosyError(f"{path}: holds a number that is too long") from None
    if not isinstance(found, dict):
        raise RosyError(f"{path}: a preset is an object, with braces")
    return found


def _without_doubles(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    found = dict(pairs)
    if len(found) < len(pairs):
        names = [name for name, _ in pairs]
        twice = next(name for name in names if names.count(name) > 1)
        raise RosyError(f"{_quoted(twice)} is there twice")
    return found


def _quoted(value: Any) -> str:
    """A value from a file in one short line."""
    return reprlib.repr(value)
