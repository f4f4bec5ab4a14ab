"""Access to Blender files, for the commands that read them."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Any

from ..core.errors import RosyError
from .options import Options
from .streams import print_error


def open_scene(options: Options, command: str, path: Path | None) -> Any:
    """Open a Blender file, if one is given, and return the scene.

    The Python package may run the command in a Blender instead, and exit.

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
    """Return the camera objects that the options name; None for the scene's active camera."""
    from ..scene.cameras import scene_cameras

    if options.all_cameras:
        return scene_cameras(scene)
    return None if options.camera is None else [find_camera(scene, options.camera)]


def requested_objects(options: Options) -> list[Any] | None:
    """Return the objects that the options name; None for all whose fields can be drawn."""
    import bpy

    from ..scene.visible_objects import field_objects

    return None if options.object is None else field_objects(bpy.context.view_layer, options.object)


def print_warnings(warnings: Iterable[str]) -> None:
    """Print each of several warnings once."""
    for warning in dict.fromkeys(warnings):
        print_error(warning)


def find_camera(scene: Any, name: str) -> Any:
    """Return the camera object of a name."""
    if name not in scene.objects:
        names = ", ".join(f"'{obj.name}'" for obj in scene.objects if obj.type == "CAMERA")
        raise RosyError(
            f"there is no camera '{name}' in scene '{scene.name}', only {names or 'none'}"
        )
    return scene.objects[name]
