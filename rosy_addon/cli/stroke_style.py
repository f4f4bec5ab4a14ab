"""Options of the command `strokes` for the style of the strokes and the pen."""

from __future__ import annotations

import argparse
from dataclasses import replace
from functools import partial
from typing import Any

from ..line_drawing.style import StrokeStyle
from ..line_drawing.svg import Pen
from ..settings import Choice, Number, Setting, Switch, settings_of
from .options import float_between

#: Placeholders of numbers in the help, by their units.
METAVARS = {"pixels": "PX", "length": "UNITS", "spacings": "SPACINGS", "": "AMOUNT"}


def add_style_options(parser: argparse.ArgumentParser) -> None:
    """Add an option for each setting of `StrokeStyle` except the unit. Those not given are not set.

    The unit follows from the option: `--spacing` is in pixels, `--distance` in units of the mesh.
    """
    for name, setting in settings_of(StrokeStyle).items():
        if name != "unit":
            _add_setting_option(parser, setting)


def _add_setting_option(parser: argparse.ArgumentParser, setting: Setting) -> None:
    """Add the option of a setting, with its range or choices, help text and default."""
    option = f"--{setting.name.replace('_', '-')}"
    add = partial(parser.add_argument, option, default=argparse.SUPPRESS)
    text = setting.text[0].lower() + setting.text[1:]
    match setting:
        case Switch():
            add(action=argparse.BooleanOptionalAction, help=text)
        case Choice(options=options, default=default):
            add(choices=tuple(options), help=f"{text} ({default})")
        case Number(low=low, high=high, unit=unit, default=default):
            help_text = f"{text} ({default:g})"
            add(type=float_between(low, high), metavar=METAVARS[unit], help=help_text)
        case _:
            raise TypeError(f"setting '{setting.name}' has no option")


def stroke_style_of(options: argparse.Namespace, base: StrokeStyle) -> StrokeStyle:
    """Return the style with the fields that the options override."""
    overrides = style_overrides(options)
    if "spacing" in overrides or "distance" in overrides:
        overrides["unit"] = "world" if "distance" in overrides else "pixels"
    return replace(base, **overrides)


def style_overrides(options: argparse.Namespace) -> dict[str, Any]:
    """Return the settings of `StrokeStyle` that the options override."""
    values = vars(options)
    return {name: values[name] for name in settings_of(StrokeStyle) if name in values}


def add_pen_options(parser: argparse.ArgumentParser) -> None:
    """Add options for the fields of `Pen`. Those not given are not set."""
    add = partial(parser.add_argument, default=argparse.SUPPRESS)
    add(
        "--width",
        type=float_between(0.01, 1e3),
        metavar="PX",
        help=f"width of the strokes ({Pen.width:g})",
    )
    add(
        "--plotter",
        action=argparse.BooleanOptionalAction,
        help="lines of constant width, without paper, in an order that keeps the pen travel short",
    )
    add(
        "--mm",
        dest="millimetres",
        type=float_between(1.0, 1e5),
        metavar="WIDTH",
        help="width of the page in millimeters",
    )
    add(
        "--colours",
        "--colors",
        metavar="C,C,...",
        help="SVG colors of the layers (#000000)",
    )
    add("--paper", action=argparse.BooleanOptionalAction, help="white paper behind the strokes")


def pen_of(options: argparse.Namespace, base: Pen) -> Pen:
    """Return the pen with the fields that the options override."""
    values = vars(options)
    overrides = {
        name: values[name] for name in ("width", "millimetres", "plotter") if name in values
    }
    if "colours" in values:
        overrides |= {"colours": values["colours"].split(","), "outline": None}
    if values.get("plotter"):
        overrides["paper"] = None
    elif "paper" in values:
        overrides["paper"] = Pen.paper if values["paper"] else None
    return replace(base, **overrides)
