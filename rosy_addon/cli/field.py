"""The commands `field` and `info`: write, convert and describe field files."""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import Any

import numpy as np

from .. import api
from ..errors import RosyError, counted
from ..field.curvature import MAGNITUDES
from ..field.field_io import WRITE_SUFFIXES
from ..field.formats.sings import SINGULARITY_SUFFIXES, read_sings
from .mesh_field import add_mesh_options, load_mesh_and_field, printed_warnings, read_field
from .options import add_subcommand, check_output, float_between
from .streams import print_line


def add_field_command(subparsers: Any) -> None:
    """Add the command `field`."""
    parser = add_subcommand(subparsers, "field", run_field)
    add_mesh_options(parser)
    parser.add_argument(
        "-o", "--output", required=True, type=Path, metavar="OUT", help=", ".join(WRITE_SUFFIXES)
    )
    parser.add_argument(
        "--to-degree",
        type=int,
        metavar="N",
        help="convert to this degree, a multiple or a divisor of the field's",
    )
    parser.add_argument(
        "--turn",
        type=float_between(-360.0, 360.0),
        default=0.0,
        metavar="DEGREES",
        help="rotate all directions by this angle",
    )
    parser.add_argument(
        "--smooth",
        type=float_between(0.0, 10.0),
        default=0.0,
        metavar="SHARE",
        help="diffuse the field over this fraction of the size of the mesh",
    )
    parser.add_argument(
        "--cancel-pairs",
        type=float_between(0.0, 10.0),
        default=0.0,
        metavar="SHARE",
        help="remove pairs of singularities with opposite indices that are nearer than this fraction of the size "
        "of the mesh",
    )
    parser.add_argument(
        "--magnitude", choices=list(MAGNITUDES), help="replace the lengths of the vectors"
    )


def run_field(options: argparse.Namespace) -> None:
    """Write a field file: generate a field, or convert the format, degree or vectors of one."""
    check_output(options)
    _, field = load_mesh_and_field(options)
    if options.to_degree is not None:
        field = field.to_degree(options.to_degree)
    if options.turn:
        field = field.rotated(np.radians(options.turn))
    if options.smooth:
        field = field.smoothed(options.smooth)
    if options.cancel_pairs:
        field = field.without_pairs(options.cancel_pairs)
    if options.magnitude is not None:
        field = field.with_magnitude(options.magnitude)
    field.save(options.output)


def add_info_command(subparsers: Any) -> None:
    """Add the command `info`."""
    parser = add_subcommand(subparsers, "info", run_info)
    add_mesh_options(parser)
    parser.add_argument("--json", action="store_true", help="print one JSON object")
    parser.add_argument(
        "--against",
        type=Path,
        metavar="FILE",
        help="compare with another field file, or with a file of singularities (.sings)",
    )


def run_info(options: argparse.Namespace) -> None:
    """Describe a mesh and its field, and compare the field with another one."""
    surface, field = load_mesh_and_field(options)
    magnitude = field.magnitude
    facts = {
        "degree": field.degree,
        "vertices": len(surface.vertices),
        "faces": surface.face_count,
        "euler_characteristic": surface.euler_characteristic,
        "magnitude": [float(magnitude.min()), float(magnitude.max())],
        "undefined_faces": int(np.count_nonzero(magnitude == 0)),
        "is_rosy": field.is_rosy,
        "energy": field.energy,
        "singularities": np.stack(field.singularities, axis=1).tolist(),
    }
    if options.against is not None:
        facts["against"] = _compare(options, field)
    print_line(json.dumps(facts) if options.json else _format_info(facts))


def _compare(options: argparse.Namespace, field: api.Field) -> dict[str, Any]:
    """Return the angles to the field in a file, or the differences from a file of singularities."""
    if options.against.suffix.lower() not in SINGULARITY_SUFFIXES:
        with printed_warnings():
            other = read_field(options, options.against, field.surface, field.degree)
        difference = field.difference(other)
        return {
            "mean": np.degrees(difference.mean),
            "rms": np.degrees(difference.rms),
            "max": np.degrees(difference.max),
            "compared": difference.compared,
        }
    degree, other_element, other_index = read_sings(options.against)
    if degree != field.degree:
        raise RosyError(
            f"{options.against}: is for a field of degree {degree}, but this field has degree {field.degree}"
        )
    own_pairs = set(map(tuple, np.stack(field.singularities, axis=1).tolist()))
    other_pairs = set(zip(other_element.tolist(), other_index.tolist(), strict=True))
    return {
        "same": len(own_pairs & other_pairs),
        "only_here": sorted(map(list, own_pairs - other_pairs)),
        "only_there": sorted(map(list, other_pairs - own_pairs)),
    }


def _format_info(facts: dict[str, Any]) -> str:
    """Return the facts as text."""
    singularity_lines = [
        f"  vertex {vertex}: {index:+d}/{facts['degree']}"
        for vertex, index in facts["singularities"]
    ]
    low, high = facts["magnitude"]
    return "\n".join(
        [
            f"degree {facts['degree']}",
            f"{counted(facts['faces'], 'face')}, {counted(facts['vertices'], 'vertex', 'vertices')}, "
            f"Euler characteristic {facts['euler_characteristic']}",
            f"magnitude {low:.4g} to {high:.4g}, undefined on "
            f"{counted(facts['undefined_faces'], 'face')}",
            f"energy {facts['energy']:.6g}",
            *([] if facts["is_rosy"] else ["directions at free angles, not a RoSy"]),
            *_format_comparison(facts.get("against")),
            counted(len(singularity_lines), "singularity", "singularities"),
            *singularity_lines,
        ]
    )


def _format_comparison(against: dict[str, Any] | None) -> list[str]:
    """Return the lines of text that describe a comparison."""
    if against is None:
        return []
    if "same" in against:
        counts = len(against["only_here"]), len(against["only_there"])
        return [
            f"singularities: {against['same']} are the same, {counts[0]} only here, "
            f"{counts[1]} only there"
        ]
    return [
        f"off by {against['mean']:.4g} degrees on average, rms {against['rms']:.4g}, at most "
        f"{against['max']:.4g}, on {100 * against['compared']:.4g} % of the faces"
    ]
