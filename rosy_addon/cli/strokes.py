"""The command `strokes`: evenly spaced streamlines as an .svg file, or as polylines in space."""

from __future__ import annotations

import argparse
import os
import re
import sys
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

from ..api.drawings import draw_strokes
from ..api.pictures import DEFAULT_SIZE, DEFAULT_VIEW
from ..core.errors import RosyError
from ..core.settings import settings_of
from ..field.generate import GeneratorSettings
from ..line_drawing.polyline_files import check_drawing_suffix
from ..line_drawing.style import StrokeStyle
from ..line_drawing.svg import Pen
from ..projection.camera import check_size
from ..rendering.mesh_view import check_light
from ..worker.frame_workers import parse_frames
from .mesh_field import add_mesh_options, load_mesh_and_field
from .options import CommandParser, Options, add_subcommand, float_between
from .scene import find_camera, open_scene, print_warnings, requested_objects
from .streams import print_line

#: Default values of the options that are only for mesh files, and only for .blend files.
MESH_ONLY_DEFAULTS = {
    **dict.fromkeys(("field", "degree", "generate", "strokes", "guides", "field_mesh", "up")),
    **dict.fromkeys(("array", "step", "singularities", *settings_of(GeneratorSettings))),
    **dict.fromkeys(("uv", "firmness", "undefined"), False),
    "orthographic": None,
    "view": DEFAULT_VIEW,
}
#: The same of the options that are only for pictures.
PAGE_ONLY_DEFAULTS = dict.fromkeys(("plotter", "millimeters", "colors", "paper"))
#: What users give for a value, if it has another name.
OPTION_NAMES = {
    "field": "FIELD",
    "orthographic": "--ortho",
    "millimeters": "--mm",
    "colors": "--colors",
}

SCENE_ONLY_DEFAULTS = dict.fromkeys(("object", "camera", "frames"))


def add_strokes_command(subparsers: Any) -> None:
    """Add the command `strokes`."""
    parser = add_subcommand(subparsers, "strokes", run_strokes)
    parser.description += " For a .blend file, the defaults are the settings of the scene."
    add_mesh_options(parser, allow_scene=True)
    parser.add_output_option(
        "OUT", "file of strokes: a picture as .svg, or polylines in space as .ply, .obj or .csv"
    )
    parser.add_view_options()
    parser.add_object_option("objects of a .blend file; by default all with a field")
    parser.add_value("--camera", "NAME", "camera of a .blend file; by default the scene's")
    parser.add_value(
        "--frames",
        "A-B[:STEP]",
        "frames of a .blend file, each in its own file; # in OUT stands for the frame number",
    )
    parser.add_set_option(StrokeStyle, "one setting of the strokes")
    add_pen_options(parser)


def run_strokes(options: Options) -> None:
    """Draw evenly spaced strokes along the fields of meshes, as an .svg file or as polylines."""
    options.check_output()
    if check_drawing_suffix(options.output) != ".svg":
        _reject_options(options, PAGE_ONLY_DEFAULTS, options.output, ".svg files")
    # Mistakes are reported before files are read.
    style = StrokeStyle().with_settings(options.requested_settings(StrokeStyle))
    if options.mesh is None and "bpy" not in sys.modules:
        raise RosyError("no input: give a mesh file, or SCENE.blend")
    if options.mesh is None or options.mesh.suffix.lower() == ".blend":
        name = options.mesh or "the open file"
        _reject_options(options, MESH_ONLY_DEFAULTS, name, "mesh files")
        _draw_scene_strokes(options)
        return
    _reject_options(options, SCENE_ONLY_DEFAULTS, options.mesh, ".blend files")
    pen = pen_of(options, Pen())
    check_light(style.light, str(options.mesh))
    size, is_ortho = check_size(*(options.size or DEFAULT_SIZE)), bool(options.orthographic)
    surface, field = load_mesh_and_field(options)
    drawing = draw_strokes(surface, field, style, pen, options.view, size, is_ortho)
    drawing.save(options.output)


def _draw_scene_strokes(options: Options) -> None:
    """Draw the strokes of a Blender file, at one frame or several.

    The settings of the scene apply unless an option overrides them.
    """
    frames = [None] if options.frames is None else list(parse_frames(options.frames))
    if len(frames) > 1 and "#" not in options.output.name:
        raise RosyError(
            f"{options.output}: several frames need # in the file name for the frame number"
        )
    scene = open_scene(options, "strokes", options.mesh)
    for frame in frames:
        if frame is None:
            _draw_frame_strokes(options, scene, options.output)
            continue
        scene.frame_set(frame)
        try:
            _draw_frame_strokes(options, scene, _path_of_frame(options.output, frame))
        except RosyError as error:
            raise RosyError(f"frame {frame}: {error}") from None


def _path_of_frame(path: Path, frame: int) -> Path:
    """Return the path with each run of # in the file name replaced by the frame number."""
    return path.with_name(re.sub("#+", lambda row: f"{frame:0{len(row[0])}d}", path.name))


def _draw_frame_strokes(options: Options, scene: Any, path: Path) -> None:
    """Draw the strokes of the current frame, as the operator does."""
    import bpy

    from ..jobs.draw_strokes import draw_strokes
    from ..scene.cameras import frame_camera
    from ..scene.stroke_objects import read_pen, read_stroke_style, target_objects

    if options.camera is not None:
        camera = find_camera(scene, options.camera)
    else:
        camera = None if options.frames is None else frame_camera(scene, scene.frame_current)
    settings, layer = scene.rosy.strokes, bpy.context.view_layer
    objects = requested_objects(options) or target_objects(scene, layer)
    result = draw_strokes(
        scene,
        kind="FILE",
        path=Path(os.path.realpath(path)),
        objects=objects,
        camera=camera,
        style=read_stroke_style(settings).with_settings(options.requested_settings(StrokeStyle)),
        pen=pen_of(options, read_pen(settings)),
        size=options.size,
    )
    print_warnings(result.notes)
    print_line(f"{result.camera}: {result.path}")


def _reject_options(
    options: Options, defaults: dict[str, Any], file: Path | str, file_kind: str
) -> None:
    """Raise an error if an option is set that is for another kind of file.

    Parameters
    ----------
    options : Options
    defaults : dict
        Default values of the options that are not allowed.
    file : Path or str
        The file that they do not apply to.
    file_kind : str
        The files that they are for.
    """
    for name, default in defaults.items():
        if getattr(options, name, default) != default:
            option = OPTION_NAMES.get(name, "--" + name.replace("_", "-"))
            raise RosyError(f"{file}: {option} applies only to {file_kind}")


def add_pen_options(parser: CommandParser) -> None:
    """Add options for the fields of `Pen`. Those not given are not set."""
    add = partial(parser.add_value, default=argparse.SUPPRESS)
    switch = partial(
        parser.add_argument, action=argparse.BooleanOptionalAction, default=argparse.SUPPRESS
    )
    add("--width", "PX", f"width of the strokes ({Pen.width:g})", float_between(0.01, 1e3))
    switch(
        "--plotter",
        help="lines of constant width, without paper, in an order that keeps the pen travel short",
    )
    page_width = float_between(1.0, 1e5)
    add("--mm", "WIDTH", "width of the page in millimeters", page_width, dest="millimeters")
    add("--colors", "C,C,...", "SVG colors of the layers (#000000)")
    switch("--paper", help="white paper behind the strokes")


def pen_of(options: Options, base: Pen) -> Pen:
    """Return the pen with the fields that the options override."""
    values = vars(options)
    overrides = {
        name: values[name] for name in ("width", "millimeters", "plotter") if name in values
    }
    if "colors" in values:
        overrides |= {"colors": values["colors"].split(","), "outline": None}
    if values.get("plotter"):
        overrides["paper"] = None
    elif "paper" in values:
        overrides["paper"] = Pen.paper if values["paper"] else None
    return replace(base, **overrides)
