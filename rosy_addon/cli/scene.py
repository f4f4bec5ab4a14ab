"""Access to .blend files, for the commands that read them."""

import os
import signal
import sys
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from ..core.errors import RosyError
from ..worker.lifeline import PROCESS_LIFELINE
from .options import Options
from .streams import print_error


def import_blender() -> None:
    """Import Blender's Python module. Its temporary folder is removed with this process, even if it is killed.

    Raises
    ------
    ImportError
        If it is not installed.
    KeyboardInterrupt
        After the import, if Ctrl-C was pressed during it. Blender would catch the exception.
    """
    if "bpy" not in sys.modules:
        os.environ["TMPDIR"] = str(PROCESS_LIFELINE.folder)
    interrupts: list[int] = []
    previous = signal.signal(signal.SIGINT, lambda number, _: interrupts.append(number))
    try:
        import bpy  # noqa: F401
    finally:
        signal.signal(signal.SIGINT, previous)
    if interrupts:
        raise KeyboardInterrupt


def open_scene(options: Options, command: str, path: Path | None) -> Any:
    """Open a .blend file, and return its scene. If `path` is None, return the current scene of Blender.

    The Python package may instead run the command in a Blender process, and exit.

    Raises
    ------
    RosyError
        If this is not Blender, or the file cannot be read.
    """
    if options.extras.run_in_blender is not None:
        options.extras.run_in_blender(options, command, path)
    try:
        import bpy
    except ImportError:
        raise RosyError(
            f"{command} needs Blender: run `blender -b SCENE.blend --command rosy {command}`, "
            "or install the Python module bpy"
        ) from None
    from ..scene.files import open_blend
    from ..ui.properties import ensure_registered

    ensure_registered()
    if path is not None:
        open_blend(path)
    return bpy.context.scene


def requested_cameras(scene: Any, options: Options) -> list[Any] | None:
    """Return the camera objects that the options name. If they name none, return None: the active camera."""
    from ..scene.cameras import scene_cameras

    if options.all_cameras:
        return scene_cameras(scene)
    return None if options.camera is None else [find_camera(scene, options.camera)]


def requested_objects(options: Options) -> list[Any] | None:
    """Return the objects that the options name. If they name none, return None: all objects with a field."""
    import bpy

    from ..scene.visible_objects import field_objects

    return None if options.object is None else field_objects(bpy.context.view_layer, options.object)


def print_warnings(warnings: Iterable[str]) -> None:
    """Print warnings to the error stream, equal ones only once."""
    for warning in dict.fromkeys(warnings):
        print_error(warning)


def find_camera(scene: Any, name: str) -> Any:
    """Return the object with this name, which should be a camera. Its type is checked when it is used.

    Raises
    ------
    RosyError
        If the scene has no object of this name. The message lists the cameras of the scene.
    """
    if name not in scene.objects:
        names = ", ".join(f"'{obj.name}'" for obj in scene.objects if obj.type == "CAMERA")
        raise RosyError(
            f"there is no camera '{name}' in scene '{scene.name}', only {names or 'none'}"
        )
    return scene.objects[name]
