"""Open and save .blend files, with error messages for the user."""

from __future__ import annotations

import os
from pathlib import Path

import bpy

from ..core.errors import RosyError
from ..core.file_io import check_readable


def open_blend(path: Path) -> None:
    """Open a .blend file. It replaces the file that is open.

    Raises
    ------
    RosyError
        If the file is missing or cannot be read.
    """
    check_readable(path)
    try:
        bpy.ops.wm.open_mainfile(filepath=os.path.realpath(path), load_ui=False)
    except RuntimeError as reason:
        raise RosyError(f"{path}: cannot be read: {_one_line(reason)}") from None


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
    """Return the message of one of Blender's errors as one line."""
    lines = [line.removeprefix("Error:").strip() for line in str(error).splitlines()]
    return "; ".join(line for line in lines if line)
