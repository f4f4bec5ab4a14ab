"""Options of a mesh and its field, shared by the commands that read mesh files."""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path

import numpy as np

from ..errors import RosyError, counted
from ..field.field_io import READ_SUFFIXES, load_field
from ..field.formats.guide_strokes import read_guide_strokes
from ..field.formats.obj import read_uv
from ..field.generate import GENERATORS, GeneratorSettings, generate
from ..field.mesh_io import READERS, read_mesh
from ..field.rosy_field import RosyField, check_degree
from ..field.surface import Surface, orientation_warning
from .options import float_between, float_tuple, print_note


def add_mesh_options(parser: argparse.ArgumentParser, *, allow_scene: bool = False) -> None:
    """Add MESH, FIELD and the options that generate a field.

    Parameters
    ----------
    parser : argparse.ArgumentParser
    allow_scene : bool
        Whether MESH may be a .blend file, or absent.
    """
    suffixes = list(READERS)
    if allow_scene:
        help_text = f"{', '.join(suffixes)} or .blend; in Blender, by default, the open file"
        parser.add_argument(
            "mesh", nargs="?", type=Path, metavar="MESH|SCENE.blend", help=help_text
        )
    else:
        help_text = f"{', '.join(suffixes[:-1])} or {suffixes[-1]}"
        parser.add_argument("mesh", type=Path, metavar="MESH", help=help_text)
    parser.add_argument(
        "field", type=Path, nargs="?", metavar="FIELD", help=", ".join(READ_SUFFIXES)
    )
    parser.add_argument(
        "--degree",
        type=int,
        metavar="N",
        help="degree of the field, 1 to 12; by default that of the field file, or 4",
    )
    parser.add_argument(
        "--generate",
        choices=list(GENERATORS),
        help="generate a field instead of reading one; by default guided if there are guides, "
        "otherwise form",
    )
    parser.add_argument(
        "--axis",
        type=float_tuple(3, "X,Y,Z"),
        default=(0.0, 0.0, 1.0),
        metavar="X,Y,Z",
        help="direction of the field, for --generate axis (0,0,1)",
    )
    parser.add_argument(
        "--reach",
        type=float_between(0.0, 10.0),
        default=0.0,
        metavar="SHARE",
        help="distance as a fraction of the size of the mesh: how far curvature extends into flat "
        "parts, or how far guides are smoothed; at 0 the field meets the guides exactly",
    )
    parser.add_argument(
        "--sharp-angle",
        type=float_between(0.0, 180.0),
        default=30.0,
        metavar="DEGREES",
        help="smallest angle between the faces of a sharp edge, for --generate features (%(default)g)",
    )
    parser.add_argument(
        "--strokes",
        type=Path,
        metavar="FILE",
        help="strokes on the mesh that a guided field follows: rows x y z, with an empty line "
        "between two strokes",
    )
    parser.add_argument(
        "--guides",
        type=Path,
        metavar="FIELD",
        help="a field file that a guided field follows where its vectors are not zero",
    )
    parser.add_argument(
        "--uv", action="store_true", help="make a guided field follow the UV map of an .obj file"
    )
    parser.add_argument(
        "--field-mesh",
        type=Path,
        metavar="MESH",
        help="mesh file that the field file belongs to, if it is not MESH; the field is transferred by "
        "position",
    )
    parser.add_argument(
        "--undefined", action="store_true", help="treat NaN and infinite vectors as undefined"
    )


def load_mesh_and_field(options: argparse.Namespace) -> tuple[Surface, RosyField]:
    """Read the mesh; read the field, or generate one."""
    if options.degree is not None:
        check_degree(options.degree)
    if options.field is not None and options.generate is not None:
        raise RosyError(f"{options.field}: give either a field file or --generate, not both")
    surface = read_mesh(options.mesh)
    if options.field is not None:
        loaded = load_field(
            options.field,
            surface,
            options.degree,
            nonfinite_policy(options),
            mesh=options.field_mesh,
        )
        print_note(loaded.note)
        return surface, loaded.field
    print_note(orientation_warning(surface))
    degree = 4 if options.degree is None else options.degree
    has_guides = options.strokes is not None or options.guides is not None
    kind = options.generate or ("guided" if has_guides else "form")
    field = generate(surface, _generator_settings(options, surface, kind, degree), degree)
    print_note(_undefined_note(surface, field, kind))
    return surface, field


def _undefined_note(surface: Surface, field: RosyField, kind: str) -> str:
    """Say on how many faces a generated field has no direction; empty if it has one on all faces.

    Faces without area do not count.
    """
    has_area = surface.face_normal.any(axis=1)
    count = int((has_area & ~field.vectors.any(axis=1)).sum())
    if not count:
        return ""
    total = int(has_area.sum())
    where = "any face" if count == total else f"{count:,} of {counted(total, 'face')}"
    return (
        f"{surface.name}: {kind} gives no direction on {where}: choose another kind with --generate, "
        "such as form"
    )


def _generator_settings(
    options: argparse.Namespace, surface: Surface, kind: str, degree: int
) -> GeneratorSettings:
    """Return the settings of the generator, with the guides that the options name."""
    settings = GeneratorSettings(kind, options.axis, options.reach, np.radians(options.sharp_angle))
    if options.strokes is not None:
        settings = replace(settings, strokes=read_guide_strokes(options.strokes))
    if options.guides is not None:
        guides = load_field(options.guides, surface, degree, nonfinite_policy(options)).field
        settings = replace(settings, vectors=guides.vectors)
    if options.uv or kind == "uv":
        settings = replace(settings, uv=load_uv_map(options.mesh))
    return settings


def nonfinite_policy(options: argparse.Namespace) -> str:
    """Return what happens to vectors in field files that are not finite: ``error`` or ``zero``."""
    return "zero" if options.undefined else "error"


def load_uv_map(mesh: Path) -> np.ndarray:
    """Return the UV coordinates of the corners of an .obj file.

    Raises
    ------
    RosyError
        If it is another kind of file, or has no UV map.
    """
    uv = read_uv(mesh) if mesh.suffix.lower() == ".obj" else None
    if uv is None:
        raise RosyError(f"{mesh}: has no UV map, which only .obj files can have")
    return uv
