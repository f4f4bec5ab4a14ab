"""Preset files: find, read, write, rename and delete saved looks.

A preset is a small JSON file with a name, a description, and the settings that differ from the
default look. Shipped presets, a user's own presets and presets that users share have the same
format. The preview picture is a .png file next to it. It can be drawn again from the look
(`preview.draw_preview`), so shared presets need none, and pictures from others are never read.
"""

import json
import os
import reprlib
import sys
import unicodedata
from contextlib import suppress
from pathlib import Path
from typing import Any, NamedTuple

from ..compositor.look import Look
from ..core.errors import RosyError
from ..core.file_io import make_folder, read_bytes, system_errors, write_bytes
from ..core.settings import settings_of
from ..image_io.png import write_png
from .preview import draw_preview

#: Key (stem of the file name) of the preset with the default look.
DEFAULT_KEY = "default"

_PRESET_FOLDERS = [folder / "presets" for folder in Path(__file__).resolve().parents[1:3]]

#: Folder of the shipped presets: inside the package where pip installed it, and beside the package
#: in the extension and in the repository.
SHIPPED_FOLDER = next(
    (folder for folder in _PRESET_FOLDERS if (folder / f"{DEFAULT_KEY}.json").is_file()),
    _PRESET_FOLDERS[0],
)

#: Maximum numbers of characters of a name and of a description, and of bytes of a preset file.
MAX_NAME_LENGTH, MAX_DESCRIPTION_LENGTH, MAX_FILE_BYTES = 48, 200, 1 << 16

#: File names that Windows reserves for devices, with any extension.
WINDOWS_DEVICE_NAMES = {"con", "prn", "aux", "nul"} | {
    f"{port}{digit}" for port in ("com", "lpt") for digit in range(10)
}


class Preset(NamedTuple):
    """A saved look with a name and a description.

    Attributes
    ----------
    name : str
        The name that users see: one line of at most `MAX_NAME_LENGTH` characters.
    description : str
        A description of one line of at most `MAX_DESCRIPTION_LENGTH` characters.
    look : Look
    """

    name: str
    description: str
    look: Look


def default_user_folder() -> Path:
    """Return the folder of a user's own presets when RoSy is used outside Blender.

    The environment variable ROSY_PRESETS holds its path. If it is not set, the folder is ``rosy/presets`` in
    the user data folder of the operating system.
    """
    if os.environ.get("ROSY_PRESETS"):
        return Path(os.environ["ROSY_PRESETS"])
    home = Path.home()
    if sys.platform == "win32":
        data = Path(os.environ.get("APPDATA") or home / "AppData" / "Roaming")
    elif sys.platform == "darwin":
        data = home / "Library" / "Application Support"
    else:
        data = Path(os.environ.get("XDG_DATA_HOME") or home / ".local" / "share")
    return data / "rosy" / "presets"


def preset_files(user_folder: Path | None = None) -> dict[str, Path]:
    """Return the files of all presets, shipped ones and the user's own, by their keys.

    Parameters
    ----------
    user_folder : Path, optional
        Folder of the user's own presets. They replace shipped presets with the same key. If the folder
        cannot be read, only the shipped presets are listed.

    Returns
    -------
    dict of str to Path
        Files by their keys, in the order of `merge_preset_files`.
    """
    with suppress(RosyError):
        return merge_preset_files(user_preset_files(user_folder))
    return merge_preset_files({})


def merge_preset_files(user_files: dict[str, Path]) -> dict[str, Path]:
    """Return the files of the shipped presets and of the user's own presets by their keys (see `preset_key`).

    The default preset comes first, then the other shipped presets in alphabetical order, then `user_files`.
    These replace shipped presets with the same key.
    """
    shipped = {path.stem: path for path in sorted(SHIPPED_FOLDER.glob("*.json"))}
    files = {DEFAULT_KEY: shipped.pop(DEFAULT_KEY), **shipped}
    return {key: path for key, path in files.items() if key not in user_files} | user_files


def user_preset_files(user_folder: Path | None) -> dict[str, Path]:
    """Return the files of the user's own presets by their keys, in alphabetical order.

    The result is empty if the folder is None or does not exist.

    Raises
    ------
    RosyError
        If the folder exists and cannot be read.
    """
    if user_folder is None:
        return {}
    with system_errors(user_folder, "presets cannot be read"):
        try:
            names = sorted(os.listdir(user_folder))
        except FileNotFoundError:
            return {}
    paths = [user_folder / name for name in names if name.endswith(".json")]
    return {path.stem: path for path in paths if os.path.isfile(path)}


def preset_keys(user_folder: Path | None = None) -> list[str]:
    """Return the keys of all presets, in the order of `preset_files`."""
    return list(preset_files(user_folder))


def find_preset_file(preset: str | Path, user_folder: Path | None = None) -> Path:
    """Return the file of a preset, given its key, its name or its path.

    Parameters
    ----------
    preset : str or Path
        The key of a preset, its name, or the path of a .json file. A path is returned unchanged.
    user_folder : Path, optional
        Folder of the user's own presets.

    Raises
    ------
    RosyError
        If no preset has that key or name, or the user's presets cannot be read.
    """
    path = Path(preset)
    if path.suffix.lower() == ".json":
        return path
    files = preset_files(user_folder)
    if str(preset) in files:
        return files[str(preset)]
    for key, path in files.items():
        with suppress(RosyError):
            if preset_key(str(preset)) in (key, preset_key(read_preset(path).name)):
                return path
    user_preset_files(user_folder)  # Raise the error of a folder that cannot be read.
    raise RosyError(f"there is no preset '{preset}': choose {', '.join(files)}")


def load_preset(preset: str | Path, user_folder: Path | None = None) -> Preset:
    """Read a preset, given its key, its name or the path of its file.

    `user_folder` is the folder of the user's own presets, if there is one.

    Raises
    ------
    RosyError
        If there is no such preset, or its file cannot be read.
    """
    return read_preset(find_preset_file(preset, user_folder))


def read_preset(path: str | os.PathLike[str]) -> Preset:
    """Read a preset file. Files from untrusted sources are safe to read.

    Parameters
    ----------
    path : path-like
        A JSON file. It contains an object with the keys `name`, `description` and `look`. The look is an
        object with the settings that differ from the default look.

    Raises
    ------
    RosyError
        If the file cannot be read, is larger than `MAX_FILE_BYTES` or is not a preset, or if it has
        an unknown setting or a value that is not allowed.
    """
    data = _read_json_object(path)
    try:
        name, description, look = (data.pop(key) for key in ("name", "description", "look"))
    except KeyError as missing:
        raise RosyError(f"{path}: the preset has no {missing}") from None
    if data:
        raise RosyError(f"{path}: unknown entry {reprlib.repr(next(iter(data)))}")
    if not isinstance(look, dict):
        raise RosyError(f"{path}: 'look' must be a JSON object of settings")
    unknown = sorted(set(look) - set(settings_of(Look)))
    if unknown:
        raise RosyError(
            f"{path}: unknown setting {reprlib.repr(unknown[0])}: check its spelling, or update RoSy"
        )
    try:
        return _validated(Preset(name, description, Look().with_settings(look)))
    except RosyError as reason:
        raise RosyError(f"{path}: {reason}") from None


def write_preset(path: Path, preset: Preset, *, follow_links: bool = False) -> None:
    """Write a preset file with the settings that differ from the default look.

    If `path` is a symbolic link, `follow_links` says whether its target is replaced instead of the link.

    Raises
    ------
    RosyError
        If the name or the description of the preset is not allowed, or if the file cannot be written.
    """
    _validated(preset)
    settings = {name: getattr(preset.look, name) for name in settings_of(Look)}
    changed = {name: value for name, value in settings.items() if value != getattr(Look, name)}
    data = preset._asdict() | {"look": changed}
    text = json.dumps(data, indent=2, ensure_ascii=False) + "\n"
    write_bytes(path, text.encode("utf-8"), follow_links=follow_links)


def preview_path(path: Path) -> Path:
    """Return the path of the preview picture of a preset file. The picture may not exist."""
    return path.with_suffix(".png")


def preset_key(name: str) -> str:
    """Return the key of a preset with a given name. The key is also the stem of its file name.

    It consists of the letters and digits of the name in lower case, with dashes between words.
    If Windows reserves this file name, the suffix "-preset" is added.

    Raises
    ------
    RosyError
        If the name contains neither a letter nor a digit.
    """
    normalized = unicodedata.normalize("NFC", name).lower()
    words = "".join(character if character.isalnum() else " " for character in normalized).split()
    if not words:
        raise RosyError(f"preset {reprlib.repr(name)}: the name needs a letter or a digit")
    key = "-".join(words)
    return f"{key}-preset" if key in WINDOWS_DEVICE_NAMES else key


def save_preset(preset: Preset, user_folder: Path, *, replace: bool = False) -> str:
    """Save a preset of the user, and draw and save its preview picture.

    Parameters
    ----------
    preset : Preset
    user_folder : Path
        Folder of the user's own presets. It is created if it does not exist.
    replace : bool
        Whether to replace an existing preset of the user with the same key.

    Returns
    -------
    str
        Key of the preset.

    Raises
    ------
    RosyError
        If the name or the description is not allowed, if a shipped preset has the name, if another preset of
        the user has it and `replace` is not set, or if a file cannot be written.
    """
    path = _target_path(_validated(preset), user_folder, replace)
    make_folder(user_folder)
    write_png(preview_path(path), draw_preview(preset.look))
    write_preset(path, preset)
    return path.stem


def rename_preset(key: str, name: str, description: str, user_folder: Path) -> str:
    """Change the name and the description of one of the user's own presets.

    Parameters
    ----------
    key : str
        Current key of the preset.
    name, description : str
        New name and description. They may be the same as before.
    user_folder : Path
        Folder of the user's own presets.

    Returns
    -------
    str
        New key of the preset.

    Raises
    ------
    RosyError
        If the preset is not the user's own, if the name or the description is not allowed, or if another
        preset has the name.
    """
    path = _user_file(key, user_folder)
    preset = _validated(read_preset(path)._replace(name=name, description=description))
    target = path if preset_key(name) == path.stem else _target_path(preset, user_folder, False)
    write_preset(target, preset)
    if target != path:
        if preview_path(path).is_file():
            os.replace(preview_path(path), preview_path(target))
        _delete_file(path)
    return target.stem


def remove_preset(key: str, user_folder: Path) -> None:
    """Delete one of the user's own presets, and its preview picture.

    Raises
    ------
    RosyError
        If the preset is not the user's own, or a file cannot be deleted.
    """
    path = _user_file(key, user_folder)
    _delete_file(path)
    _delete_file(preview_path(path))


def _validated(preset: Preset) -> Preset:
    """Return the preset unchanged. Raise RosyError if its name or description is not allowed."""
    limits = (("name", MAX_NAME_LENGTH), ("description", MAX_DESCRIPTION_LENGTH))
    for attribute, max_length in limits:
        text = getattr(preset, attribute)
        if not isinstance(text, str):
            raise RosyError(f"the {attribute} of the preset must be text, not {reprlib.repr(text)}")
        if len(text) > max_length:
            raise RosyError(
                f"the {attribute} of the preset has {len(text):,} characters, more than {max_length}"
            )
        if not text.isprintable():
            raise RosyError(
                f"the {attribute} of the preset must be one line of text, not {reprlib.repr(text)}"
            )
    preset_key(preset.name)
    return preset


def _target_path(preset: Preset, user_folder: Path, replace: bool) -> Path:
    """Return the path at which to save a user's preset.

    Raise RosyError if a shipped preset has its name, or if the file exists and `replace` is false.
    """
    key = preset_key(preset.name)
    if key in {*preset_keys(), *(preset_key(load_preset(name).name) for name in preset_keys())}:
        raise RosyError(f"'{preset.name}' is the name of a preset of RoSy: choose another name")
    path = user_folder / f"{key}.json"
    if path.exists() and not replace:
        raise RosyError(f"preset '{key}' already exists: replace it, or choose another name")
    return path


def _user_file(key: str, user_folder: Path) -> Path:
    """Return the file of one of the user's own presets. Raise RosyError if none of them has this key."""
    path = preset_files(user_folder).get(key)
    if path is None or path.parent != user_folder:
        raise RosyError(f"'{key}' is not one of your presets")
    return path


def _delete_file(path: Path) -> None:
    """Delete a file if it exists. Raise RosyError if it cannot be deleted."""
    with system_errors(path, "cannot be deleted"):
        path.unlink(missing_ok=True)


def _read_json_object(path: str | os.PathLike[str]) -> dict[str, Any]:
    """Read a file that contains one JSON object. Raise RosyError if it contains anything else."""
    data = read_bytes(path, reject_binary=True, max_bytes=MAX_FILE_BYTES)
    try:
        parsed = json.loads(data.decode("utf-8-sig"), object_pairs_hook=_reject_duplicate_keys)
    except RosyError as reason:
        raise RosyError(f"{path}: {reason}") from None
    except json.JSONDecodeError as reason:
        raise RosyError(f"{path}:{reason.lineno}: {reason.msg.lower()}") from None
    except UnicodeDecodeError:
        raise RosyError(f"{path}: is not UTF-8 text") from None
    except RecursionError:
        raise RosyError(f"{path}: is nested too deeply") from None
    except ValueError:  # An integer has more digits than Python converts.
        raise RosyError(f"{path}: contains a number that is too long") from None
    if not isinstance(parsed, dict):
        raise RosyError(f"{path}: a preset must be a JSON object in braces")
    return parsed


def _reject_duplicate_keys(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    """Return the (key, value) pairs of a JSON object as a dict. Raise RosyError if a key appears twice."""
    result = dict(pairs)
    if len(result) < len(pairs):
        names = [name for name, _ in pairs]
        duplicate = next(name for name in names if names.count(name) > 1)
        raise RosyError(f"{reprlib.repr(duplicate)} appears twice")
    return result
