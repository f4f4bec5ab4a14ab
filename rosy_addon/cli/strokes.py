"""The command `strokes`: draw evenly spaced streamlines as an .svg file, or as polylines in space."""

import argparse
import re
import sys
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

from .. import api
from ..api.pictures import DEFAULT_SIZE
from ..core.errors import RosyError
from ..core.file_io import check_writable
from ..field.mesh_io import READERS
from ..line_drawing.polyline_files import check_drawing_suffix
from ..line_drawing.style import StrokeStyle
from ..line_drawing.svg import Pen
from ..projection.camera import check_size
from ..worker.frame_workers import parse_frames
from .mesh_field import JOIN_TEXT, add_field_options, load_mesh_and_field
from .options import Options, add_subcommand, float_between
from .scene import find_camera, open_scene, print_warnings, requested_objects
from .streams import print_line

#: Attributes of `Pen` that are arguments of `api.strokes`.
PEN_ARGUMENTS = ("width", "colors", "paper", "millimeters", "plotter")

#: Names of kinds of files. Some options apply only to one of these; see `CommandParser.only_for`.
MESH_FILES, SCENES, PICTURES = "mesh files", ".blend files", ".svg files"


def add_strokes_command(subparsers: Any) -> None:
    """Add the command `strokes`."""
    parser = add_subcommand(subparsers, run_strokes)
    parser.description += " For a .blend file, the defaults are the settings of the scene."
    text = f"{', '.join(READERS)} or .blend; in Blender, by default, the open file"
    parser.add_argument("mesh", nargs="?", type=Path, metavar="MESH|SCENE.blend", help=text)
    with parser.only_for(MESH_FILES):
        parser.add_toggle("--join", JOIN_TEXT)
        add_field_options(parser)
        parser.add_direction_options()
        parser.add_preset_option("preset whose look the strokes follow")
    text = "file of strokes: a picture as .svg, or polylines in space as .ply, .obj or .csv"
    parser.add_output_option("OUT", text)
    parser.add_size_option()
    with parser.only_for(SCENES):
        parser.add_object_option("objects of a .blend file; by default all with a field")
        parser.add_value("--camera", "NAME", "camera of a .blend file; by default the scene's")
        text = "frames of a .blend file, each in its own file; # in OUT stands for the frame number"
        parser.add_value("--frames", "A-B[:STEP]", text)
    parser.add_set_option(StrokeStyle, "one setting of the strokes")
    # If an option of the pen is not given, `Options` has no attribute for it.
    add = partial(parser.add_value, default=argparse.SUPPRESS)
    add("--width", "PX", f"width of the strokes ({Pen.width:g})", float_between(0.01, 1e3))
    with parser.only_for(PICTURES):
        toggle = partial(parser.add_toggle, default=argparse.SUPPRESS)
        text = "lines of constant width, without paper, in an order that keeps the pen travel short"
        toggle("--plotter", text)
        text, parse = "width of the page in millimeters", float_between(1.0, 1e5)
        add("--mm", "WIDTH", text, parse, dest="millimeters")
        add("--colors", "C,C,...", "SVG colors of the layers (#000000)")
        toggle("--paper", "white paper behind the strokes")


def run_strokes(options: Options) -> None:
    """Draw evenly spaced strokes along the fields of meshes, as an .svg file or as polylines."""
    options.check_output()
    if check_drawing_suffix(options.output) != ".svg":
        options.check_only_for(PICTURES, options.output)
    # Errors in the options are reported before files are read.
    StrokeStyle().with_settings(options.requested_settings())
    if options.mesh is None and "bpy" not in sys.modules:
        raise RosyError("no input: give a mesh file, or SCENE.blend")
    if options.mesh is None or options.mesh.suffix.lower() == ".blend":
        options.check_only_for(MESH_FILES, options.mesh or "the open file")
        _draw_scene_strokes(options)
        return
    options.check_only_for(SCENES, options.mesh)
    size = check_size(*(options.size or DEFAULT_SIZE))
    arguments = {"view": options.view, "size": size, "orthographic": bool(options.orthographic)}
    arguments |= {"preset": options.preset}
    pen, settings = pen_of(options, Pen()), options.requested_settings()
    arguments |= {name: getattr(pen, name) for name in PEN_ARGUMENTS if name in vars(options)}
    surface, field = load_mesh_and_field(options)
    api.strokes(surface, field, **arguments, **settings).save(options.output)


def _draw_scene_strokes(options: Options) -> None:
    """Draw the strokes of a .blend file, at one frame or several.

    The settings of the scene apply unless an option overrides them.
    """
    frames = [] if options.frames is None else parse_frames(options.frames)
    output = options.output
    if len(frames) > 1 and "#" not in output.name:
        raise RosyError(f"{output}: several frames need # in the file name for the frame number")
    scene = open_scene(options, "strokes", options.mesh)
    if options.frames is None:
        _draw_frame_strokes(options, scene, output)
    paths = {frame: _path_of_frame(output, frame) for frame in frames}
    for path in paths.values():
        check_writable(path, follow_links=path == output)
    for frame, path in paths.items():
        scene.frame_set(frame)
        try:
            _draw_frame_strokes(options, scene, path)
        except RosyError as error:
            raise RosyError(f"frame {frame}: {error}") from None


def _path_of_frame(path: Path, frame: int) -> Path:
    """Return the path with each run of # in the file name replaced by the frame number.

    The number is padded with zeros to the length of the run.
    """
    return path.with_name(re.sub("#+", lambda row: f"{frame:0{len(row[0])}d}", path.name))


def _draw_frame_strokes(options: Options, scene: Any, path: Path) -> None:
    """Draw the strokes of the current frame to a file, as the operator for strokes does."""
    import bpy

    from ..jobs.draw_strokes import draw_strokes
    from ..scene.stroke_objects import target_objects

    camera = None if options.camera is None else find_camera(scene, options.camera)
    objects = requested_objects(options) or target_objects(scene, bpy.context.view_layer)

    def adjust(style: StrokeStyle, pen: Pen) -> tuple[StrokeStyle, Pen]:
        return style.with_settings(options.requested_settings()), pen_of(options, pen)

    # The user has not given the names of the files of frames, so links with these names are not followed.
    output = {"kind": "FILE", "path": path.absolute(), "follow_links": path == options.output}
    output |= {"size": options.size}
    result = draw_strokes(scene, objects=objects, camera=camera, adjust=adjust, **output)
    print_warnings(result.notes)
    print_line(f"{result.camera}: {result.path}")


def pen_of(options: Options, base: Pen) -> Pen:
    """Return a copy of the pen `base` with the changes of --width, --mm, --plotter, --colors and --paper."""
    values, names = vars(options), ("width", "millimeters", "plotter")
    overrides = {name: values[name] for name in names if name in values}
    if "colors" in values:
        overrides |= {"colors": values["colors"].split(","), "outline": None}
    if values.get("plotter"):
        overrides["paper"] = None
    elif "paper" in values:
        overrides["paper"] = Pen.paper if values["paper"] else None
    return replace(base, **overrides)
