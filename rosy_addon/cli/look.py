"""Options of the look of a picture, and of the source of its tone."""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from ..color import LUMINANCE_WEIGHTS, luminance, to_linear
from ..compositor.look import Look
from ..errors import RosyError
from ..field.formats.ply import read_vertex_values
from ..field.surface import Surface
from ..image_io.png import read_png
from ..presets.store import load_preset, preset_keys
from ..projection.surface_tone import SurfaceTone
from ..rendering.mesh_view import check_light
from ..settings import settings_of
from .mesh_field import load_uv_map
from .presets import user_presets_folder

#: Samples per pixel along each axis in pictures of mesh files, unless the preset has more.
FILE_SUPERSAMPLING = 2

#: Name of the color attribute of vertices, as in Blender.
VERTEX_COLOR = "Color"


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


def requested_look(options: argparse.Namespace, default: Look) -> Look:
    """Return the look of --preset, by default `default`, with the settings of --set."""
    return _with_options(_preset_look(options, default), options)


def _preset_look(options: argparse.Namespace, default: Look) -> Look:
    """Return the look of --preset, by default `default`."""
    return load_preset(options.preset, user_presets_folder()).look if options.preset else default


def _with_options(look: Look, options: argparse.Namespace) -> Look:
    """Return a look with the settings of --set."""
    return look.with_settings(dict(_parse_setting(text) for text in options.set))


def _parse_setting(text: str) -> tuple[str, Any]:
    """Return the name and the value of NAME=VALUE, converted to the type of the setting."""
    name, separator, value = text.partition("=")
    settings = settings_of(Look)
    if not separator:
        raise RosyError(f"--set {text}: expected NAME=VALUE")
    if name not in settings:
        raise RosyError(f"--set {text}: unknown setting '{name}': choose {', '.join(settings)}")
    try:
        return name, settings[name].parse(value)
    except ValueError:
        expected = "a whole number" if isinstance(settings[name].default, int) else "a number"
        raise RosyError(f"--set {text}: expected {expected}") from None


def mesh_file_look(options: argparse.Namespace) -> Look:
    """Return the look for a mesh file, with the tone source that the options name.

    Raises
    ------
    RosyError
        If there are two tone sources, or the look uses the lights of a scene.
    """
    look = _preset_look(options, Look())
    if look.supersampling == Look().supersampling:
        # Nothing smooths the edges of the picture later.
        look = replace(look, supersampling=FILE_SUPERSAMPLING)
    look = _with_options(look, options)
    check_light(look.light, str(options.mesh))
    sources = [
        source
        for source in ("attribute", "image", "picture")
        if getattr(options, f"tone_{source}", None) is not None
    ]
    if len(sources) > 1:
        raise RosyError(f"give either --tone-{sources[0]} or --tone-{sources[1]}, not both")
    return replace(look, tone=sources[0]) if sources else look


def load_tone_map(options: argparse.Namespace, surface: Surface) -> SurfaceTone | None:
    """Return the tone on the mesh that the options name, or None."""
    if options.tone_attribute is not None:
        values = _load_vertex_tone(options.mesh, options.tone_attribute)
        return SurfaceTone(values[surface.corner_vertex, None].astype(np.float32))
    if options.tone_image is not None:
        uv = load_uv_map(options.mesh)
        return SurfaceTone(uv.astype(np.float32), luminance(read_png(options.tone_image)))
    return None


def _load_vertex_tone(mesh: Path, name: str) -> np.ndarray:
    """Return (V,) values of the vertices of a .ply file: a property, or the luminance of the color."""
    if mesh.suffix.lower() != ".ply":
        raise RosyError(f"{mesh}: has no vertex properties, which only .ply files have")
    values = read_vertex_values(mesh)
    rgb = [values.get(channel) for channel in ("red", "green", "blue")]
    if name == VERTEX_COLOR and all(channel is not None for channel in rgb):
        return to_linear(np.stack(rgb, axis=1)) @ LUMINANCE_WEIGHTS
    if name not in values:
        available = ", ".join(f"'{key}'" for key in values) or "positions"
        raise RosyError(f"{mesh}: there is no vertex property '{name}', only {available}")
    if not np.isfinite(values[name]).all():
        raise RosyError(f"{mesh}: the vertex property '{name}' has values that are not finite")
    return values[name]
