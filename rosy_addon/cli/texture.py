"""The command `texture`: the field drawn in the UV map of a mesh file."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from .. import api
from ..api.textures import UDIM_TOKEN, texture_look
from ..surface_texture.draw import (
    CONTENTS,
    DEFAULT_MARGIN,
    DEFAULT_SIZE,
    MAX_MARGIN,
    MAX_SIZE,
    MIN_SIZE,
)
from .extras import Extras
from .look import add_look_options, requested_preset, requested_settings
from .mesh_field import add_mesh_options, load_mesh_and_field, printed_warnings
from .options import add_subcommand, check_output, float_tuple, int_between


def add_texture_command(subparsers: Any, extras: Extras) -> None:
    """Add the command `texture`."""
    parser = add_subcommand(subparsers, "texture", run_texture)
    add_mesh_options(parser, extras)
    parser.add_argument(
        "-o",
        "--output",
        required=True,
        type=Path,
        metavar="OUT.png",
        help=f"{UDIM_TOKEN} in the name stands for the number of a tile: each has a file of its own",
    )
    parser.add_argument(
        "--size",
        type=int_between(MIN_SIZE, MAX_SIZE),
        default=DEFAULT_SIZE,
        metavar="N",
        help="width and height in texels (%(default)d)",
    )
    parser.add_argument(
        "--margin",
        type=int_between(0, MAX_MARGIN),
        default=DEFAULT_MARGIN,
        metavar="N",
        help="width of the margin around charts, in texels (%(default)d)",
    )
    parser.add_argument(
        "--light-direction",
        type=float_tuple(3, "X,Y,Z"),
        metavar="X,Y,Z",
        help="direction to a lamp, in the axes of the mesh: draw its hatching as ink, and not thresholds "
        "for a shader",
    )
    parser.add_argument(
        "--content",
        choices=list(CONTENTS),
        default="look",
        help="; ".join(f"{name}: {text[0].lower()}{text[1:]}" for name, text in CONTENTS.items()),
    )
    add_look_options(parser)


def run_texture(options: argparse.Namespace) -> None:
    """Draw the field of a mesh file as a texture for its UV map."""
    check_output(options, ".png")
    preset, settings = requested_preset(options), requested_settings(options)
    # Mistakes are reported before the mesh is read.
    texture_look(preset, settings)
    surface, field = load_mesh_and_field(options)
    with printed_warnings():
        texture = api.texture(
            surface,
            field,
            size=options.size,
            margin=options.margin,
            light_direction=options.light_direction,
            content=options.content,
            udim=UDIM_TOKEN in options.output.name,
            preset=preset,
            **settings,
        )
    texture.save(options.output)
