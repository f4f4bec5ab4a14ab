"""Options of the look of a picture, and of the sources of its colors and its tone."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from ..api.pictures import VERTEX_COLOR, picture_look
from ..compositor.look import Look
from ..errors import RosyError
from ..preset_files.store import find_preset_file, preset_keys, read_preset
from ..settings import settings_of, stored_key
from .presets import user_presets_folder
from .view import requested_size


def add_look_options(parser: argparse.ArgumentParser) -> None:
    """Add --preset and --set."""
    parser.add_argument(
        "--preset",
        metavar="NAME",
        help=f"preset of the look: {', '.join(preset_keys())}, one of your own, or a .json file; "
        "`presets` lists them",
    )
    parser.add_argument(
        "--set",
        action="append",
        default=[],
        metavar="NAME=VALUE",
        help=f"one setting of the look, after the preset: {', '.join(settings_of(Look))}",
    )


def add_flow_option(parser: argparse.ArgumentParser) -> None:
    """Add --flow, which is short for a setting of the look."""
    parser.add_argument(
        "--flow",
        dest="set",
        action="append",
        default=[],
        type="flow={}".format,
        metavar="PIXELS",
        help="let streaks drift along the field by this many pixels per picture, as --set flow=PIXELS does",
    )


def add_color_option(parser: argparse.ArgumentParser) -> None:
    """Add --color-values."""
    parser.add_argument(
        "--color-values",
        metavar="NAME",
        help="color the lines by the numbers of a property of the faces or vertices, such as a vertex "
        "property of a .ply file",
    )


def add_tone_options(parser: argparse.ArgumentParser) -> None:
    """Add the sources of the tone that belong to the mesh."""
    parser.add_argument(
        "--tone-attribute",
        metavar="NAME",
        help="take the tone from a vertex property of a .ply file, or from the vertex colors: "
        f"'{VERTEX_COLOR}'",
    )
    parser.add_argument(
        "--tone-image",
        type=Path,
        metavar="IMAGE.png",
        help="take the tone from an image on the UV map of an .obj file",
    )


def requested_preset(options: argparse.Namespace) -> Path | None:
    """Return the file of --preset, or None."""
    return find_preset_file(options.preset, user_presets_folder()) if options.preset else None


def requested_settings(options: argparse.Namespace) -> dict[str, Any]:
    """Return the settings of --set."""
    return dict(_parse_setting(text) for text in options.set)


def requested_look(options: argparse.Namespace, default: Look) -> Look:
    """Return the look of --preset, by default `default`, with the settings of --set."""
    preset = requested_preset(options)
    look = default if preset is None else read_preset(preset).look
    return look.with_settings(requested_settings(options))


def picture_arguments(options: argparse.Namespace) -> dict[str, Any]:
    """Return what the options say about a picture, as arguments of `api.render`.

    Raises
    ------
    RosyError
        If they are not possible.
    """
    sources = {
        option: getattr(options, f"tone_{option}", None)
        for option in ("attribute", "image", "picture")
    }
    given = [f"--tone-{option}" for option, value in sources.items() if value is not None]
    if len(given) > 1:
        raise RosyError(f"give either {given[0]} or {given[1]}, not both")
    preset, settings = requested_preset(options), requested_settings(options)
    # Mistakes are reported before the mesh is read.
    picture_look(str(options.mesh), preset, settings, sources, options.color_values is not None)
    arguments = {
        "view": options.view,
        "size": requested_size(options),
        "orthographic": options.ortho,
        "preset": preset,
        "color_values": options.color_values,
        "tone_values": sources["attribute"],
        "tone_image": sources["image"],
        "workers": options.workers,
    }
    return arguments | settings


def _parse_setting(text: str) -> tuple[str, Any]:
    """Return the name and the value of NAME=VALUE, converted to the type of the setting."""
    name, separator, value = text.partition("=")
    name, settings = stored_key(name), settings_of(Look)
    if not separator:
        raise RosyError(f"--set {text}: expected NAME=VALUE")
    if name not in settings:
        raise RosyError(f"--set {text}: unknown setting '{name}': choose {', '.join(settings)}")
    try:
        return name, settings[name].parse(value)
    except ValueError:
        expected = "a whole number" if isinstance(settings[name].default, int) else "a number"
        raise RosyError(f"--set {text}: expected {expected}") from None
