"""The presets that the panels show, with their pictures. They are read again when files change."""

import time
from pathlib import Path
from typing import Any, NamedTuple

import bpy
import bpy.utils.previews

from ..core.errors import RosyError
from ..core.file_io import file_stamp
from ..preset_files import store
from ..scene.files import user_presets_folder
from ..scene.look_properties import apply_look, matches_look

#: Icon of a preset without a picture, and icon of a preset that is not found.
DEFAULT_ICON, MISSING_ICON = "PRESET", "QUESTION"

#: Seconds between two checks of the files, if their folders have not changed.
REFRESH_SECONDS = 1.0


class PresetEntry(NamedTuple):
    """A preset, its file, and whether it is the user's own and can be changed."""

    path: Path
    preset: store.Preset
    is_user: bool


class _PresetLibrary:
    """A cache of the presets, with the state of their files when they were read."""

    def __init__(self) -> None:
        self.folder_keys: tuple[Any, ...] = ()
        self.checked_at = 0.0
        self.file_keys: dict[Path, tuple[Any, ...]] = {}
        self.entries: dict[str, PresetEntry] = {}
        self.load_errors: list[str] = []
        #: Blender's collection of preview images (None unless the extension is registered), and the icon ids
        #: of the images.
        self.previews: Any = None
        self.icon_ids: dict[str, int] = {}
        #: Items of the enum property. A reference is kept here, as Blender keeps none to the texts of items.
        self.enum_items: list[tuple] = []

    def refresh(self) -> None:
        """Read the files again if any was added, changed or removed.

        Panels call this many times per redraw. Each call checks the modification times of the folders, which
        change when files are added or removed. Edited files are looked for every `REFRESH_SECONDS`.
        """
        user_folder = user_presets_folder()
        folder_keys = (user_folder, file_stamp(user_folder), file_stamp(store.SHIPPED_FOLDER))
        if folder_keys == self.folder_keys and time.monotonic() < self.checked_at + REFRESH_SECONDS:
            return
        self.folder_keys, self.checked_at = folder_keys, time.monotonic()
        load_errors = []
        try:
            user_files = store.user_preset_files(user_folder)
        except RosyError as error:
            user_files, load_errors = {}, [str(error)]
        paths = store.merge_preset_files(user_files)
        file_keys = {
            path: (file_stamp(path), file_stamp(store.preview_path(path)))
            for path in paths.values()
        }
        if file_keys == self.file_keys:
            return
        self.file_keys, self.entries, self.load_errors = file_keys, {}, load_errors
        for key, path in paths.items():
            try:
                preset = store.read_preset(path)
                self.entries[key] = PresetEntry(path, preset, path.parent == user_folder)
            except RosyError as error:
                self.load_errors.append(str(error))
        self._load_previews()

    def _load_previews(self) -> None:
        """Load the pictures of the presets, and free pictures that are no longer used."""
        self.icon_ids = {}
        if self.previews is None or bpy.app.background:
            return
        preview_names = {}
        for key, entry in self.entries.items():
            image_path = store.preview_path(entry.path)
            if image_path.is_file():
                preview_names[key] = f"{image_path} {file_stamp(image_path)}"
                if preview_names[key] not in self.previews:
                    self.previews.load(preview_names[key], str(image_path), "IMAGE")
        for name in set(self.previews) - set(preview_names.values()):
            del self.previews[name]
        self.icon_ids = {key: self.previews[name].icon_id for key, name in preview_names.items()}


_LIBRARY = _PresetLibrary()


def entries() -> dict[str, PresetEntry]:
    """Return all readable presets by their keys, in the order of the panel."""
    _LIBRARY.refresh()
    return _LIBRARY.entries


def load_errors() -> list[str]:
    """Return the error messages of presets that cannot be read."""
    _LIBRARY.refresh()
    return _LIBRARY.load_errors


def user_preset_keys(_owner: Any = None, _context: Any = None, _typed: str = "") -> list[str]:
    """Return the keys of the user's own presets. This is also a function for the search of a text property."""
    return [key for key, entry in entries().items() if entry.is_user]


def preset_name(key: str) -> str:
    """Return the name of a preset for display, given its key. If it is not found, return the key."""
    entry = entries().get(key)
    return key if entry is None else entry.preset.name


def search_presets(_owner: Any, _context: Any, _typed: str) -> list[str]:
    """Return the keys of all presets, for the search of a text property."""
    return list(entries())


def active_entry(settings: Any) -> PresetEntry | None:
    """Return the preset from which the look of ``scene.rosy`` was copied. None if it is not found."""
    return entries().get(settings.preset_name)


def is_changed(settings: Any) -> bool:
    """Return whether the look of ``scene.rosy`` differs from its preset."""
    entry = active_entry(settings)
    return entry is None or not matches_look(settings, entry.preset.look)


def apply_preset(settings: Any, preset: str) -> None:
    """Copy the look of a preset, given its key, its name or the path of its file, to ``scene.rosy``.

    Raises
    ------
    RosyError
        If there is no such preset, or its file cannot be read.
    """
    path = store.find_preset_file(preset, user_presets_folder())
    apply_look(settings, store.read_preset(path).look)
    keys = [key for key, entry in entries().items() if entry.path == path]
    settings.preset_name = keys[0] if keys else str(path)


def rename_references(old: str, new: str) -> None:
    """Replace the key of a renamed preset in all scenes of this file."""
    for scene in bpy.data.scenes:
        if scene.rosy.preset_name == old:
            scene.rosy.preset_name = new


def enum_items(settings: Any, _context: Any) -> list[tuple]:
    """Return the items of the enum property of presets."""
    result: list[tuple] = []
    for key, entry in entries().items():
        icon = _LIBRARY.icon_ids.get(key, DEFAULT_ICON)
        result.append((key, entry.preset.name, entry.preset.description, icon, len(result)))
    name = getattr(settings, "preset_name", None)
    if name and name not in _LIBRARY.entries:
        description = "This preset was not found. The look is unchanged"
        result.append((name, Path(name).stem, description, MISSING_ICON, len(result)))
    if result != _LIBRARY.enum_items:
        _LIBRARY.enum_items = result
    return _LIBRARY.enum_items


def get_enum_index(settings: Any) -> int:
    """Return the index of the chosen preset among the items."""
    indices = {item[0]: item[4] for item in enum_items(settings, None)}
    return indices.get(settings.preset_name, 0)


def set_enum_index(settings: Any, index: int) -> None:
    """Apply the preset at an index among the items."""
    key = enum_items(settings, None)[index][0]
    entry = entries().get(key)
    if entry is not None:
        apply_look(settings, entry.preset.look)
        settings.preset_name = key


def register() -> None:
    """Create the collection of preview images."""
    _LIBRARY.previews = bpy.utils.previews.new()


def unregister() -> None:
    """Free the preview images, and forget all presets."""
    global _LIBRARY
    bpy.utils.previews.remove(_LIBRARY.previews)
    _LIBRARY = _PresetLibrary()
