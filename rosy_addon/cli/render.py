"""The commands `render` and `turntable`: pictures and videos of a mesh file."""

from __future__ import annotations

import argparse
from contextlib import suppress
from pathlib import Path
from typing import Any

from .. import api
from ..api.pictures import DEFAULT_SIZE, DEFAULT_VIDEO_SIZE, find_ffmpeg
from ..errors import RosyError
from ..turntable_video import NO_ENCODER, Encoder, check_video_path
from .extras import Extras
from .look import (
    add_color_option,
    add_flow_option,
    add_look_options,
    add_tone_options,
    picture_arguments,
)
from .mesh_field import add_mesh_options, load_mesh_and_field
from .options import (
    add_subcommand,
    add_workers_option,
    check_output,
    float_between,
    int_between,
)
from .streams import print_line
from .view import add_view_options


def add_render_command(subparsers: Any, extras: Extras) -> None:
    """Add the command `render`."""
    parser = add_subcommand(subparsers, "render", run_render)
    add_mesh_options(parser, extras)
    parser.add_argument("-o", "--output", required=True, type=Path, metavar="OUT.png")
    add_view_options(parser, DEFAULT_SIZE)
    add_workers_option(parser)
    add_look_options(parser)
    add_color_option(parser)
    add_tone_options(parser)
    parser.add_argument(
        "--tone-picture",
        type=Path,
        metavar="PICTURE.png",
        help="take the tone from a picture of the same mesh in the same view",
    )


def run_render(options: argparse.Namespace) -> None:
    """Draw the field of a mesh file as a picture."""
    check_output(options, ".png")
    arguments = picture_arguments(options)
    surface, field = load_mesh_and_field(options)
    picture = api.render(surface, field, tone_picture=options.tone_picture, **arguments)
    picture.save(options.output)


def add_turntable_command(subparsers: Any, extras: Extras) -> None:
    """Add the command `turntable`."""
    parser = add_subcommand(subparsers, "turntable", run_turntable)
    add_mesh_options(parser, extras)
    parser.add_argument("-o", "--output", required=True, type=Path, metavar="OUT.mp4|OUT.gif")
    parser.add_argument(
        "--pictures",
        type=int_between(1, 10_000),
        default=72,
        metavar="N",
        help="pictures in a full turn (%(default)d)",
    )
    add_rate_option(parser)
    add_flow_option(parser)
    parser.add_argument(
        "--still",
        action="store_true",
        help="leave the camera where it is: only streaks drift, as --flow says",
    )
    add_view_options(parser, DEFAULT_VIDEO_SIZE)
    add_workers_option(parser)
    add_look_options(parser)
    add_color_option(parser)
    add_tone_options(parser)


def add_rate_option(parser: argparse.ArgumentParser) -> None:
    """Add --rate, of a video."""
    parser.add_argument(
        "--rate",
        type=float_between(0.1, 1000.0),
        default=24.0,
        metavar="N",
        help="pictures per second (%(default)g)",
    )


def run_turntable(options: argparse.Namespace) -> None:
    """Draw the field of a mesh file from all sides, as a video."""
    check_output(options)
    check_video_path(options.output)
    if options.pictures < 2:
        raise RosyError("a turntable needs 2 or more --pictures")
    arguments = picture_arguments(options)
    encode = video_encoder(options)
    surface, field = load_mesh_and_field(options)
    api.turntable(
        surface,
        field,
        path=options.output,
        pictures=options.pictures,
        rate=options.rate,
        still=options.still,
        encode=encode,
        on_picture=lambda number: print_line(f"picture {number} of {options.pictures}"),
        **arguments,
    )


def video_encoder(options: argparse.Namespace) -> Encoder | None:
    """Return ffmpeg's or Blender's encoder for an .mp4 as the output; None for a .gif.

    Raises
    ------
    RosyError
        If there is no encoder.
    """
    if options.output.suffix.lower() != ".mp4":
        return None
    find_blender_encoder, encode = options.extras.find_blender_encoder, None
    if find_blender_encoder is not None and options.blender is not None:
        encode = find_blender_encoder(options.blender)
    if encode is None:
        encode = find_ffmpeg()
    if encode is None:
        with suppress(ImportError):
            from ..scene.video import encode_video as encode
    if encode is None and find_blender_encoder is not None:
        encode = find_blender_encoder(None)
    if encode is None:
        raise RosyError(f"{options.output}: {NO_ENCODER}")
    return encode
