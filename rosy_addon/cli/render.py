"""The commands `render` and `turntable`: pictures and videos of a mesh file."""

from __future__ import annotations

import argparse
import contextlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from ..cache import Cache
from ..color import luminance
from ..errors import RosyError
from ..image_io.png import read_png, write_png
from ..progress import run_to_completion
from ..rendering.band_workers import BandWorkers
from ..rendering.cpu import CpuRenderer
from ..rendering.mesh_view import mesh_instance, mesh_view
from ..rendering.view_input import ViewInput
from ..turntable_video import (
    NO_ENCODER,
    Encoder,
    check_video_path,
    turntable_task,
    turntable_views,
)
from .look import (
    add_look_options,
    add_tone_options,
    load_tone_map,
    mesh_file_look,
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
from .view import (
    DEFAULT_SIZE,
    DEFAULT_VIDEO_SIZE,
    add_view_options,
    requested_size,
    up_axis,
)


def add_render_command(subparsers: Any) -> None:
    """Add the command `render`."""
    parser = add_subcommand(subparsers, "render", run_render)
    add_mesh_options(parser)
    parser.add_argument("-o", "--output", required=True, type=Path, metavar="OUT.png")
    add_view_options(parser, DEFAULT_SIZE)
    add_workers_option(parser)
    add_look_options(parser)
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
    look = mesh_file_look(options)
    surface, field = load_mesh_and_field(options)
    size = requested_size(options)
    instance = mesh_instance(surface, field, up_axis(options), load_tone_map(options, surface))
    reference_luminance = None
    if options.tone_picture is not None:
        reference_luminance = luminance(read_png(options.tone_picture))
    view = mesh_view(
        instance,
        look,
        options.view,
        size,
        perspective=not options.ortho,
        reference_luminance=reference_luminance,
        reference_name=str(options.tone_picture),
    )
    # Only the pixels are kept, not the layers of the picture.
    with BandWorkers(options.workers) as pool:
        rgba = run_to_completion(CpuRenderer(workers=pool).render_task(view)).rgba
    write_png(options.output, rgba)


def add_turntable_command(subparsers: Any) -> None:
    """Add the command `turntable`."""
    parser = add_subcommand(subparsers, "turntable", run_turntable)
    add_mesh_options(parser)
    parser.add_argument("-o", "--output", required=True, type=Path, metavar="OUT.mp4|OUT.gif")
    parser.add_argument(
        "--pictures",
        type=int_between(1, 10_000),
        default=72,
        metavar="N",
        help="pictures in a full turn (%(default)d)",
    )
    parser.add_argument(
        "--rate",
        type=float_between(0.1, 1000.0),
        default=24.0,
        metavar="N",
        help="pictures per second (%(default)g)",
    )
    add_view_options(parser, DEFAULT_VIDEO_SIZE)
    add_workers_option(parser)
    add_look_options(parser)
    add_tone_options(parser)


def run_turntable(options: argparse.Namespace) -> None:
    """Draw the field of a mesh file from all sides, as a video."""
    check_output(options)
    check_video_path(options.output)
    if options.pictures < 2 or not options.rate > 0:
        raise RosyError("a turntable needs 2 or more --pictures, and a --rate above 0")
    encode = _video_encoder(options)
    look = mesh_file_look(options)
    surface, field = load_mesh_and_field(options)
    instance = mesh_instance(surface, field, up_axis(options), load_tone_map(options, surface))
    count, size = options.pictures, requested_size(options)
    views = turntable_views(
        instance, look, count, size, options.view, perspective=not options.ortho
    )
    views = _log_views(views, count)
    with BandWorkers(options.workers) as pool:
        renderer = CpuRenderer(Cache(), keep_gbuffers=False, workers=pool)
        task = turntable_task(renderer, views, count, options.output, options.rate, encode)
        run_to_completion(task)


def _video_encoder(options: argparse.Namespace) -> Encoder | None:
    """Return ffmpeg's or Blender's encoder for an .mp4, or None."""
    if options.output.suffix.lower() != ".mp4":
        return None
    find_encoder = options.extras.find_encoder
    encode = None if find_encoder is None else find_encoder()
    if encode is None:
        with contextlib.suppress(ImportError):
            from ..scene.video import encode_video_task as encode
    if encode is None:
        raise RosyError(f"{options.output}: {NO_ENCODER}")
    return encode


def _log_views(views: Iterator[ViewInput], count: int) -> Iterator[ViewInput]:
    """Yield the same views, and print a line before each is drawn."""
    for number, view in enumerate(views, 1):
        print_line(f"picture {number} of {count}")
        yield view
