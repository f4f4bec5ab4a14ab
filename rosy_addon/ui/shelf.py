"""Presets as the panel shows them: pictures, names and sentences, read again when files change."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any, NamedTuple

import bpy
import bpy.utils.previews

from ..compositor.presets import (
    FOLDER,
    Preset,
    find_preset,
    picture_path,
    preset_files,
    read_preset,
)
from ..errors import RosyError
from ..scene.folders import presets_folder
from ..scene.looks import apply_look, is_look_of

#: What is shown for a preset that has no picture, or is not there.
NO_PICTURE, MISSING = "PRESET", "QUESTION"

#: Seconds after which files are looked at again, if their folders are as they were.
PATIENCE = 1.0


class Entry(NamedTuple):
    """A preset on the shelf: its file, what it holds, and whether the user may change it."""

    path: Path
    preset: Preset
    own: bool


class _Shelf:
    """What was read last, and from files in which state."""

    def __init__(self) -> None:
        self.folders: tuple[Any, ...] = ()
        self.looked = 0.0
        self.state: dict[Path, tuple[Any, ...]] = {}
        self.entries: dict[str, Entry] = {}
        self.faults: list[str] = []
        #: Blender's pictures, while there are panels to show them, and their numbers.
        self.pictures: Any = None
        self.icons: dict[str, int] = {}
        #: Blender itself holds on to no text of an item.
        self.items: list[tuple] = []

    def read(self) -> None:
        """Read the files again if any was added, changed or taken away.

        Panels ask many times whenever they are drawn: folders tell at once what was added or taken
        away, and whether a file was edited is looked up once in a while.
        """
        own = presets_folder()
        folders = (own, _state(own), _state(FOLDER))
        if folders == self.folders and time.monotonic() < self.looked + PATIENCE:
            return
        self.folders, self.looked = folders, time.monotonic()
        files = preset_files(own)
        state = {path: (_state(path), _state(picture_path(path))) for path in files.values()}
        if state == self.state:
            return
        self.state, self.entries, self.faults = state, {}, []
        for key, path in files.items():
            try:
                self.entries[key] = Entry(path, read_preset(path), path.parent == own)
            except RosyError as reason:
                self.faults.append(str(reason))
        self._show_pictures()

    def _show_pictures(self) -> None:
        """Give every preset the picture beside it, and let go of those not shown any longer."""
        self.icons = {}
        if self.pictures is None or bpy.app.background:
            return
        wanted = {}
        for key, entry in self.entries.items():
            picture = picture_path(entry.path)
            if picture.is_file():
                wanted[key] = f"{picture} {_state(picture)}"
                if wanted[key] not in self.pictures:
                    self.pictures.load(wanted[key], str(picture), "IMAGE")
        for name in set(self.pictures) - set(wanted.values()):
            del self.pictures[name]
        self.icons = {key: self.pictures[name].icon_id for key, name in wanted.items()}


_SHELF = _Shelf()


def entries() -> dict[str, Entry]:
    """All presets that can be read, by what they are called by, in the order they are shown."""
    _SHELF.read()
    return _SHELF.entries


def faults() -> list[str]:
    """What is wrong with presets that cannot be read, a line each."""
    _SHELF.read()
    return _SHELF.faults


def names() -> list[str]:
    """What presets are called by, for properties that search."""
    return list(entries())


def own_names() -> list[str]:
    """The same of the user's own."""
    return [key for key, entry in entries().items() if entry.own]


def chosen(settings: Any) -> Entry | None:
    """The preset that the look of ``scene.rosy`` was taken from; none if it is not there."""
    return entries().get(settings.preset_name)


def is_changed(settings: Any) -> bool:
    """Whether the look of ``scene.rosy`` is no longer that of its preset."""
    entry = chosen(settings)
    return entry is None or not is_look_of(settings, entry.preset.look)


def apply_preset(settings: Any, preset: str) -> None:
    """Give ``scene.rosy`` the look of a preset.

    Raises
    ------
    RosyError
        If there is none of that name, or its file cannot be read.
    """
    path = find_preset(preset, presets_folder())
    apply_look(settings, read_preset(path).look)
    keys = [key for key, entry in entries().items() if entry.path == path]
    settings.preset_name = keys[0] if keys else str(path)


def follow(old: str, new: str) -> None:
    """Let the scenes of this file know a preset by its new name."""
    for scene in bpy.data.scenes:
        if scene.rosy.preset_name == old:
            scene.rosy.preset_name = new


def items(settings: Any, _context: Any) -> list[tuple]:
    """Items of the property that shows and chooses a preset."""
    found = [
        (key, entry.preset.name, entry.preset.description, _SHELF.icons.get(key, NO_PICTURE), place)
        for place, (key, entry) in enumerate(entries().items())
    ]
    name = getattr(settings, "preset_name", None)
    if name and name not in _SHELF.entries:
        about = "This preset is not here; the look is as it was"
        found.append((name, Path(name).stem, about, MISSING, len(found)))
    if found != _SHELF.items:
        _SHELF.items = found
    return _SHELF.items


def get_chosen(settings: Any) -> int:
    """Place of the chosen preset among the items."""
    places = {item[0]: item[4] for item in items(settings, None)}
    return places.get(settings.preset_name, 0)


def set_chosen(settings: Any, place: int) -> None:
    """Take the look of the preset at a place among the items."""
    key = items(settings, None)[place][0]
    entry = entries().get(key)
    if entry is not None:
        apply_look(settings, entry.preset.look)
        settings.preset_name = key


def _state(path: Path) -> tuple[int, ...]:
    """Changes whenever a file or a folder does."""
    try:
        found = path.stat()
    except OSError:
        return ()
    return found.st_mtime_ns, found.st_size


def register() -> None:
    """Make room for pictures."""
    _SHELF.pictures = bpy.utils.previews.new()


def unregister() -> None:
    """Let go of them."""
    global _SHELF
    bpy.utils.previews.remove(_SHELF.pictures)
    _SHELF = _Shelf()
