"""The command `bake`: pictures of a Blender file, from its cameras."""

from __future__ import annotations

import argparse
import os
from dataclasses import replace
from pathlib import Path
from typing import Any

from ..errors import RosyError, counted
from ..file_io import check_folder
from ..frame_workers import parse_frames
from ..gpu.select import RENDER_DEVICES
from ..progress import listening
from .bake_workers import run_workers, uses_workers
from .extras import Extras
from .look import add_flow_option, add_look_options, requested_look
from .options import add_object_option, add_subcommand, add_workers_option, parse_size
from .scene import open_scene, print_warnings, requested_cameras, requested_objects
from .streams import print_line


def add_bake_command(subparsers: Any, extras: Extras) -> None:
    """Add the command `bake`, with --scheduler if there is a cluster to run it on."""
    parser = add_subcommand(subparsers, "bake", run_bake)
    parser.add_argument(
        "scene",
        nargs="?",
        type=Path,
        metavar="SCENE.blend",
        help="Blender file; by default the open one",
    )
    add_object_option(parser, "objects to draw; by default all with a field")
    cameras = parser.add_mutually_exclusive_group()
    cameras.add_argument(
        "--camera", metavar="NAME", help="camera to draw from; by default the scene's active one"
    )
    cameras.add_argument("--all-cameras", action="store_true", help="draw from all cameras")
    add_look_options(parser)
    add_flow_option(parser)
    parser.add_argument(
        "--size", type=parse_size, metavar="WxH", help="size in pixels; by default the scene's"
    )
    parser.add_argument(
        "--out", type=Path, metavar="DIR", help="write the pictures to this folder as .png files"
    )
    parser.add_argument(
        "--device",
        choices=list(RENDER_DEVICES),
        help="draw with the processor (cpu), the graphics card (gpu), or the graphics card if there is "
        "one (auto); by default as set in the scene",
    )
    add_workers_option(parser)
    parser.add_argument("--save", action="store_true", help="save the Blender file")
    parser.add_argument(
        "--frames",
        metavar="A-B[:STEP]",
        help="draw a picture of each frame from the camera that renders it; pictures that exist and "
        "are up to date are kept",
    )
    workers = parser.add_mutually_exclusive_group()
    workers.add_argument(
        "--jobs", type=int, default=1, metavar="J", help="number of processes for the frames"
    )
    parser.set_defaults(scheduler=None)
    if extras.run_on_cluster is not None:
        workers.add_argument(
            "--scheduler",
            metavar="ADDRESS",
            help="address of a Dask cluster whose workers draw the frames",
        )


def run_bake(options: argparse.Namespace) -> None:
    """Draw the fields of a Blender file from its cameras, at one frame or several."""
    _check_bake_options(options)
    if options.out is None and not options.save:
        raise RosyError("the pictures would not be saved: give --out DIR, --save, or both")
    if uses_workers(options) and not options.extras.frames_are_drawn:
        run_workers(options)
        if not options.save:
            return
    scene = open_scene(options, "bake", options.scene)
    import bpy

    from ..bake import bake as bake_scene
    from ..scene.blend_files import save_blend
    from ..scene.look_properties import read_look
    from ..scene.pictures import is_beside_blend, read_output_settings

    out = None if options.out is None else Path(os.path.realpath(options.out))
    settings = read_output_settings(scene, out)
    if out is None and settings.folder is not None and not is_beside_blend(settings.folder):
        # The file may come from someone else.
        raise RosyError(
            f"the file stores its pictures in another place, {os.path.realpath(settings.folder)}: give --out DIR"
        )
    if options.device is not None:
        settings = replace(settings, device=options.device)
    if options.frames is not None:
        _bake_animation(options, scene, settings)
        return
    results = bake_scene(
        scene,
        objects=requested_objects(options),
        cameras=requested_cameras(scene, options),
        look=requested_look(options, read_look(scene.rosy)),
        size=options.size,
        settings=settings,
        workers=options.workers,
    )
    print_warnings(warning for result in results for warning in result.warnings)
    for result in results:
        location = bpy.path.abspath(result.image.filepath) if options.out else result.image.name
        print_line(f"{result.camera}: {location}")
    if options.save:
        print_line(save_blend())


def _check_bake_options(options: argparse.Namespace) -> None:
    """Raise an error if options contradict each other, or --out cannot be written."""
    if options.frames is None and uses_workers(options):
        raise RosyError("--jobs and --scheduler distribute frames: give --frames A-B")
    if options.frames is not None and options.out is None:
        raise RosyError("--frames writes files: give --out DIR")
    if options.jobs < 1:
        raise RosyError(f"--jobs {options.jobs}: expected 1 or more")
    if options.out is not None:
        check_folder(options.out)


def _bake_animation(options: argparse.Namespace, scene: Any, settings: Any) -> None:
    """Draw the frames in this process, and print what was written."""

    from ..animation import bake_animation
    from ..scene.blend_files import save_blend
    from ..scene.look_properties import read_look

    frames = parse_frames(options.frames)
    if uses_workers(options):
        # The workers have drawn all frames. The first and the last set the range of the materials.
        frames = sorted({frames[0], frames[-1]})
    has_look_options = bool(options.preset or options.set)
    with listening(_FrameLog()):
        results = bake_animation(
            scene,
            frames,
            objects=requested_objects(options),
            cameras=requested_cameras(scene, options),
            look=requested_look(options, read_look(scene.rosy)) if has_look_options else None,
            size=options.size,
            settings=settings,
            workers=options.workers,
            show=options.save,
        )
    print_warnings(warning for result in results for warning in result.warnings)
    for result in results:
        if result.skipped:
            print_line(f"{counted(len(result.skipped), 'frame')} of {result.camera} up to date")
        print_line(f"{result.camera}: {result.sequence.path}")
    if options.save:
        print_line(save_blend())


class _FrameLog:
    """Prints a line for each frame of an animation when it begins."""

    def __init__(self) -> None:
        self._last_label = ""

    def __call__(self, fraction: float, label: str) -> None:
        if label != self._last_label and label.startswith("frame "):
            self._last_label = label
            print_line(f"{label} ({100 * fraction:.0f} %)")
