"""Helpers shared by the commands: value types for argparse, and notes to the user."""

from __future__ import annotations

import argparse
import os
import re
from collections.abc import Callable
from typing import Any

import numpy as np

from ..errors import RosyError
from ..file_io import check_writable
from .streams import print_error


def check_output(options: argparse.Namespace, suffix: str = "") -> None:
    """Check the option -o, before long work computes its contents.

    Parameters
    ----------
    options : argparse.Namespace
    suffix : str
        The extension that the name of the file must have; by default any.

    Raises
    ------
    RosyError
        If the name has another extension, the file cannot be written, or another option names it as
        an input.
    """
    check_writable(options.output)
    if suffix and options.output.suffix.lower() != suffix:
        raise RosyError(f"{options.output}: the name of the file must end in {suffix}")
    if not os.path.exists(options.output):
        return
    for name, value in vars(options).items():
        for path in value if isinstance(value, list) else [value]:
            is_path = name != "output" and isinstance(path, (str, os.PathLike))
            if is_path and os.path.exists(path) and os.path.samefile(path, options.output):
                raise RosyError(f"{options.output}: is also an input: choose another output file")


def parse_size(text: str) -> tuple[int, int]:
    """Return the width and height from a text such as 640x480."""
    match = re.fullmatch(r"(\d+)x(\d+)", text)
    if match is None:
        raise argparse.ArgumentTypeError(f"{text!r} is not a size such as 640x480")
    return int(match[1]), int(match[2])


def float_tuple(count: int, metavar: str) -> Callable[[str], tuple[float, ...]]:
    """Return a parser for numbers that are separated by commas."""

    def parse(text: str) -> tuple[float, ...]:
        try:
            values = tuple(map(float, text.split(",")))
        except ValueError:
            values = ()
        if len(values) != count:
            raise argparse.ArgumentTypeError(f"{text!r} is not {metavar}")
        return values

    return parse


def float_between(low: float, high: float) -> Callable[[str], float]:
    """Return a parser for a number in a closed interval."""

    def parse(text: str) -> float:
        try:
            value = float(text)
        except ValueError:
            value = np.nan
        if not low <= value <= high:
            raise argparse.ArgumentTypeError(f"{text!r} is not a number from {low:g} to {high:g}")
        return value

    return parse


def int_between(low: int, high: int) -> Callable[[str], int]:
    """Return a parser for a whole number in a closed interval."""

    def parse(text: str) -> int:
        if not re.fullmatch(r"[+-]?\d{1,18}", text) or not low <= int(text) <= high:
            raise argparse.ArgumentTypeError(f"{text!r} is not a whole number from {low} to {high}")
        return int(text)

    return parse


def add_object_option(parser: argparse.ArgumentParser, help_text: str) -> None:
    """Add --object with one name or more. It may be repeated; ``--object=-x`` is the name -x."""
    parser.add_argument("--object", nargs="+", action="extend", metavar="NAME", help=help_text)


def add_workers_option(parser: argparse.ArgumentParser) -> None:
    """Add --workers."""
    parser.add_argument(
        "--workers",
        type=int_between(0, 256),
        default=0,
        metavar="N",
        help="number of processes that draw a large picture together; 0 is one for each core "
        "(%(default)d). The picture is the same for any number",
    )


def add_subcommand(
    subparsers: Any, name: str, function: Callable[[argparse.Namespace], None]
) -> argparse.ArgumentParser:
    """Add a command. The first line of the function's docstring becomes its help."""
    text = function.__doc__.splitlines()[0]
    parser = subparsers.add_parser(name, help=text, description=text)
    parser.set_defaults(run=function)
    return parser


def print_note(text: str) -> None:
    """Print a note to the error stream, unless it is empty."""
    if text:
        print_error(text)
