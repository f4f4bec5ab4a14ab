"""Processes that bake frames, for the command `bake`."""

from __future__ import annotations

import argparse
import os
import sys
from pathlib import Path

from ..errors import RosyError
from ..file_io import check_readable
from ..frame_workers import parse_frames, run_local
from ..preset_files.store import SHIPPED_FOLDER, find_preset_file
from .presets import user_presets_folder
from .streams import print_line


def uses_workers(options: argparse.Namespace) -> bool:
    """Return whether other processes draw the frames."""
    return options.jobs > 1 or options.scheduler is not None


def run_workers(options: argparse.Namespace) -> None:
    """Draw the frames in other processes, on this machine or on a cluster."""
    blender_path = sys.modules["bpy"].app.binary_path if "bpy" in sys.modules else ""
    scene = options.scene
    if scene is None:
        blend_data = sys.modules["bpy"].data if "bpy" in sys.modules else None
        if blend_data is None or not blend_data.filepath or blend_data.is_dirty:
            raise RosyError(
                "--jobs and --scheduler need a saved file: save it, or give SCENE.blend"
            )
        scene = Path(blend_data.filepath)
    check_readable(scene)
    real_path, arguments = os.path.realpath(scene), _forwarded_args(options)
    frames = parse_frames(options.frames)
    if options.scheduler is not None:
        arguments = ["bake", real_path, *arguments]
        output_lines = options.extras.run_on_cluster(arguments, frames, options.scheduler)
    else:
        if blender_path:
            command = [blender_path, "-b", real_path, "--command", "rosy", "bake"]
        elif options.extras.program:
            command = [*options.extras.program, "bake", real_path]
        else:
            raise RosyError("--jobs needs Blender, or the command line of the Python package")
        output_lines = run_local([*command, *arguments], frames, options.jobs)
    for line in output_lines:
        if line.startswith("frame "):
            print_line(line)


def _forwarded_args(options: argparse.Namespace) -> list[str]:
    """Return the options that are passed on to the other processes.

    Each is one word, because names may begin with a dash.
    """
    arguments = [f"--out={os.path.realpath(options.out)}"]
    arguments += [f"--object={name}" for name in options.object or ()]
    if options.camera is not None:
        arguments.append(f"--camera={options.camera}")
    if options.all_cameras:
        arguments.append("--all-cameras")
    if options.size is not None:
        arguments.append(f"--size={options.size[0]}x{options.size[1]}")
    if options.preset is not None:
        arguments.append(f"--preset={_forwarded_preset(options.preset)}")
    if options.device is not None:
        arguments.append(f"--device={options.device}")
    arguments += [f"--set={setting}" for setting in options.set]
    if options.extras.run_in_blender is not None and options.blender is not None:
        arguments.append(f"--blender={_forwarded_program(options.blender)}")
    # The processes for frames use all cores already.
    arguments.append(f"--workers={options.workers or 1}")
    return arguments


def _forwarded_preset(preset: str) -> str:
    """Return the name of a preset of RoSy, or the path of another one.

    RoSy may be installed in another folder where the worker runs.
    """
    path = find_preset_file(preset, user_presets_folder())
    return path.stem if path.parent == SHIPPED_FOLDER else os.path.realpath(path)


def _forwarded_program(program: str) -> str:
    """Return the path of a program, which may be a link, or a name that is looked up on the PATH."""
    return os.path.abspath(program) if os.path.exists(program) else program
