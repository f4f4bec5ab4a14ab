"""Looks as data: the presets that come with RoSy, and a user's own."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any, NamedTuple

from ..errors import RosyError
from ..files import read_bytes
from .look import Look

#: Where the presets that come with RoSy are.
FOLDER = Path(__file__).resolve().parents[2] / "presets"


class Preset(NamedTuple):
    """A look with a name.

    Attributes
    ----------
    name : str
    description : str
    look : Look
    """

    name: str
    description: str
    look: Look


def preset_names() -> list[str]:
    """The presets that come with RoSy, in alphabetical order."""
    return sorted(path.stem for path in FOLDER.glob("*.json"))


def load_preset(preset: str | Path) -> Preset:
    """Read a preset.

    Parameters
    ----------
    preset : str or Path
        One of `preset_names`, or the path of a .json file: an object with a `name`, a
        `description`, and a `look` of settings that differ from the default.

    Raises
    ------
    RosyError
        If there is none of that name, the file is no such object, or it holds a setting that does
        not exist or a value that is not allowed.
    """
    path = Path(preset)
    if path.suffix != ".json":
        if str(preset) not in preset_names():
            raise RosyError(f"no preset is named '{preset}'; there are {', '.join(preset_names())}")
        path = FOLDER / f"{preset}.json"
    data = _json_object(path)
    try:
        name, description, look = (data.pop(key) for key in ("name", "description", "look"))
    except KeyError as missing:
        raise RosyError(f"{path}: a preset needs a {missing}") from None
    if data:
        raise RosyError(f"{path}: a preset has no '{next(iter(data))}'")
    if not isinstance(look, dict):
        raise RosyError(f"{path}: 'look' is not an object of settings")
    try:
        return Preset(str(name), str(description), Look().with_settings(look))
    except RosyError as reason:
        raise RosyError(f"{path}: {reason}") from None


def _json_object(path: Path) -> dict[str, Any]:
    try:
        data = json.loads(read_bytes(path, text=True).decode("utf-8"))
    except json.JSONDecodeError as reason:
        raise RosyError(f"{path}:{reason.lineno}: {reason.msg.lower()}") from None
    except UnicodeDecodeError:
        raise RosyError(f"{path}: is not UTF-8 text") from None
    if not isinstance(data, dict):
        raise RosyError(f"{path}: a preset is an object, with braces")
    return data
