"""Where Blender wants an extension to keep what a user makes."""

from __future__ import annotations

import os
from pathlib import Path

import bpy

from ..compositor.presets import own_folder

#: The extension's own name in Blender: this file is two packages below it.
EXTENSION = __package__.rsplit(".", 2)[0]


def presets_folder() -> Path:
    """The folder of the user's own presets; it need not be there.

    That of the extension in Blender's user folders; if RoSy does not run as an extension, or the
    environment names another (ROSY_PRESETS), the one that it has without Blender.
    """
    if "ROSY_PRESETS" not in os.environ:
        try:
            return Path(bpy.utils.extension_path_user(EXTENSION, path="presets"))
        except ValueError:  # no extension
            pass
    return own_folder()
