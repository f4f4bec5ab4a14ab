"""The command `bake`: draw pictures of a .blend file from its cameras, in one process or several."""

import os
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

from ..core.errors import RosyError, counted
from ..core.file_io import check_folder, check_readable
from ..core.progress import listening
from ..gpu.select import RENDER_DEVICES
from ..preset_files.store import SHIPPED_FOLDER
from ..worker.frame_workers import parse_frames, run_local
from .options import Options, add_subcommand, int_between, parse_size
from .scene import open_scene, print_warnings, requested_cameras, requested_objects
from .streams import print_line


def add_bake_command(subparsers: Any, has_cluster: bool) -> None:
    """Add the command `bake`, with --scheduler if it can run on a cluster."""
    parser = add_subcommand(subparsers, run_bake)
    text = "Blender file; by default the open one"
    parser.add_argument("scene", nargs="?", type=Path, metavar="SCENE.blend", help=text)
    parser.add_object_option("objects to draw; by default all with a field")
    cameras = parser.add_mutually_exclusive_group()
    text = "camera to draw from; by default the scene's active one"
    cameras.add_argument("--camera", metavar="NAME", help=text)
    cameras.add_argument("--all-cameras", action="store_true", help="draw from all cameras")
    parser.add_look_options()
    parser.add_value("--size", "WxH", "size in pixels; by default the scene's", parse_size)
    parser.add_value("--out", "DIR", "write the pictures to this folder as .png files", Path)
    text = (
        "draw with the processor (cpu), the graphics card (gpu), or the graphics card if there is one "
        "(auto); by default as set in the scene"
    )
    parser.add_argument("--device", choices=list(RENDER_DEVICES), help=text)
    parser.add_workers_option()
    parser.add_switch("--save", "save the Blender file")
    text = "draw a picture of each frame from the camera that renders it; pictures that exist and are up to date are kept"
    parser.add_value("--frames", "A-B[:STEP]", text)
    workers = parser.add_mutually_exclusive_group()
    text, parse = "number of processes for the frames", int_between(1, 1024)
    workers.add_argument("--jobs", type=parse, default=1, metavar="J", help=text)
    parser.set_defaults(scheduler=None)
    if has_cluster:
        text = "address of a Dask cluster whose workers draw the frames"
        workers.add_argument("--scheduler", metavar="ADDRESS", help=text)


def run_bake(options: Options) -> None:
    """Draw the fields of a Blender file from its cameras, at one frame or several."""
    _check_bake_options(options)
    if options.out is None and not options.save:
        raise RosyError("the pictures would not be saved: give --out DIR, --save, or both")
    if uses_workers(options) and not options.extras.is_in_blender:
        run_workers(options)
        if not options.save:
            return
    scene = open_scene(options, "bake", options.scene)
    import bpy

    from ..scene.files import is_beside_blend, save_blend
    from ..scene.pictures import read_output_settings

    out = None if options.out is None else Path(os.path.realpath(options.out))
    settings = read_output_settings(scene, out)
    if out is None and settings.folder is not None and not is_beside_blend(settings.folder):
        # The file may come from another person, and must not choose a folder to write to.
        place = os.path.realpath(settings.folder)
        raise RosyError(f"the file stores its pictures in another place, {place}: give --out DIR")
    if options.device is not None:
        settings = replace(settings, device=options.device)
    results = _bake(options, scene, settings)
    print_warnings(warning for result in results for warning in result.warnings)
    for result in results:
        if options.frames is None:
            location = bpy.path.abspath(result.image.filepath) if options.out else result.image.name
        else:
            location = result.path
            if result.skipped:
                print_line(f"{counted(len(result.skipped), 'frame')} of {result.camera} up to date")
        print_line(f"{result.camera}: {location}")
    if options.save:
        print_line(save_blend())


def _check_bake_options(options: Options) -> None:
    """Raise an error if options contradict each other, or --out cannot be written."""
    if options.frames is None and uses_workers(options):
        raise RosyError("--jobs and --scheduler distribute frames: give --frames A-B")
    if options.frames is not None and options.out is None:
        raise RosyError("--frames writes files: give --out DIR")
    if options.out is not None:
        check_folder(options.out)


def _bake(options: Options, scene: Any, settings: Any) -> list[Any]:
    """Draw the current frame or several frames in this process. Return a `BakeResult` for each camera.

    `settings` are `OutputSettings`: how the pictures are stored and applied.
    """
    from ..jobs.animation import bake_animation
    from ..jobs.bake import bake
    from ..scene.look_properties import read_look

    objects, cameras = requested_objects(options), requested_cameras(scene, options)
    has_look = options.preset or options.set
    look = options.requested_look(read_look(scene.rosy)) if has_look else None
    arguments = {"objects": objects, "cameras": cameras, "look": look, "size": options.size}
    arguments |= {"settings": settings, "workers": options.workers}
    if options.frames is None:
        return bake(scene, **arguments)
    frames = parse_frames(options.frames)
    if uses_workers(options):
        # The workers have drawn all frames. The first and the last frame are needed here, as they determine
        # the frame range of the materials.
        frames = sorted({frames[0], frames[-1]})
    with listening(_FrameLog()):
        return bake_animation(scene, frames, show=options.save, **arguments)


class _FrameLog:
    """A listener for progress that prints a line when a frame of an animation begins."""

    def __init__(self) -> None:
        self._last_label = ""

    def __call__(self, fraction: float, label: str) -> None:
        if label != self._last_label and label.startswith("frame "):
            self._last_label = label
            print_line(f"{label} ({100 * fraction:.0f} %)")


def uses_workers(options: Options) -> bool:
    """Return whether the options ask for other processes to draw the frames."""
    return options.jobs > 1 or options.scheduler is not None


def run_workers(options: Options) -> None:
    """Draw the frames in other processes, on this machine or on a cluster."""
    bpy, scene = sys.modules.get("bpy"), options.scene
    if scene is None:
        if bpy is None or not bpy.data.filepath or bpy.data.is_dirty:
            raise RosyError(
                "--jobs and --scheduler need a saved file: save it, or give SCENE.blend"
            )
        scene = Path(bpy.data.filepath)
    check_readable(scene)
    real_path, arguments = os.path.realpath(scene), _forwarded_args(options)
    frames = parse_frames(options.frames)
    if options.scheduler is not None:
        arguments = ["bake", real_path, *arguments]
        output_lines = options.extras.run_on_cluster(arguments, frames, options.scheduler)
    else:
        if bpy is not None and bpy.app.binary_path:
            command = [bpy.app.binary_path, "-b", real_path, "--command", "rosy", "bake"]
        elif options.extras.program:
            command = [*options.extras.program, "bake", real_path]
        else:
            raise RosyError("--jobs needs Blender, or the command line of the Python package")
        output_lines = run_local([*command, *arguments], frames, options.jobs)
    for line in output_lines:
        if line.startswith("frame "):
            print_line(line)


def _forwarded_args(options: Options) -> list[str]:
    """Return the arguments of the processes that draw frames, for the options of this command.

    An option and its value are one argument (``--object=-x``), because names may begin with a dash.
    """
    size, preset = options.size, options.requested_preset()
    blender = getattr(options, "blender", None)
    values = {
        "out": [os.path.realpath(options.out)],
        "object": options.object or [],
        "camera": [options.camera],
        "size": [size and "{}x{}".format(*size)],
        "preset": [preset and _forwarded_preset(preset)],
        "device": [options.device],
        "set": options.set,
        "blender": [blender and _forwarded_program(blender)],
        # The processes that draw frames already use all cores.
        "workers": [options.workers or 1],
    }
    words = [f"--{name}={value}" for name in values for value in values[name] if value is not None]
    return [*words, "--all-cameras"] if options.all_cameras else words


def _forwarded_preset(path: Path) -> str:
    """Return how other processes find a preset: by its name if RoSy provides it, otherwise by its path.

    RoSy may be installed in another folder on the machine of a worker.
    """
    return path.stem if path.parent == SHIPPED_FOLDER else os.path.realpath(path)


def _forwarded_program(program: str) -> str:
    """Return the absolute path of a program; if there is no such file, its name, which the PATH resolves."""
    return os.path.abspath(program) if os.path.exists(program) else program
