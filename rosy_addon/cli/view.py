"""Options of the view of a mesh file: direction, upward axis, size of the picture."""

from __future__ import annotations

import argparse

from ..api.pictures import DEFAULT_SIZE, DEFAULT_VIEW
from ..projection.camera import check_size
from ..projection.up_axis import UP_AXIS_MATRIX
from .options import float_tuple, parse_size


def add_view_options(parser: argparse.ArgumentParser, size: tuple[int, int] | None) -> None:
    """Add the options of the view. `size` is the default of --size."""
    add_direction_options(parser)
    parser.add_argument(
        "--size", type=parse_size, default=size, metavar="WxH", help="size in pixels"
    )
    parser.add_argument(
        "--ortho", action="store_true", help="orthographic projection instead of perspective"
    )


def add_direction_options(parser: argparse.ArgumentParser) -> None:
    """Add --view and --up."""
    parser.add_argument(
        "--view",
        type=float_tuple(2, "AZ,EL"),
        default=DEFAULT_VIEW,
        metavar="AZ,EL",
        help="azimuth and elevation in degrees: 0,0 is from the front, 90,0 from the right, 0,90 from "
        "above",
    )
    parser.add_argument(
        "--up",
        choices=list(UP_AXIS_MATRIX),
        help="upward axis of the file; by default y for .obj and .off, otherwise z",
    )


def requested_size(options: argparse.Namespace) -> tuple[int, int]:
    """Return the size of the picture in pixels."""
    return check_size(*(options.size or DEFAULT_SIZE))
