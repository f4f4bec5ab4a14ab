"""Path of the folder of the user's presets in Blender."""

from __future__ import annotations

import os
from pathlib import Path

import bpy

from ..preset_files.store import default_user_folder

#: Package name of the extension in Blender. This file is two packages below it.
EXTENSION_ID = __package__.rsplit(".", 2)[0]


def user_presets_folder() -> Path:
    """Return the folder of the user's own presets. It may not exist yet.

    It is in the folder that Blender provides for the files of an extension. If RoSy does not run as
    an extension, or the environment variable ROSY_PRESETS is set, it is `default_user_folder`.
    """
    if not os.environ.get("ROSY_PRESETS"):
        try:
            return Path(bpy.utils.extension_path_user(EXTENSION_ID, path="presets"))
        except ValueError:  # not installed as an extension
            pass
    return default_user_folder()
