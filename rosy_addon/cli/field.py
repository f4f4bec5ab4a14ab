"""The commands `field` and `info`: write, convert and describe field files."""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import RosyError, counted
from ..field.analysis import angle_errors, dirichlet_energy, error_statistics
from ..field.convert import Conversion, convert
from ..field.curvature import MAGNITUDES
from ..field.field_io import WRITE_SUFFIXES, load_field, write_field
from ..field.formats.sings import SINGULARITY_SUFFIXES, read_sings
from ..field.rosy_field import RosyField
from ..field.singularities import euler_characteristic, find_singularities
from ..field.surface import Surface
from .mesh_field import add_mesh_options, load_mesh_and_field, nonfinite_policy
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
        "--magnitude", choices=list(MAGNITUDES), help="replace the lengths of the vectors"
    )


def run_field(options: argparse.Namespace) -> None:
    """Write a field file: generate a field, or convert the format, degree or vectors of one."""
    check_output(options)
    surface, field = load_mesh_and_field(options)
    angle = np.radians(options.turn)
    conversion = Conversion(options.to_degree, angle, options.smooth, options.magnitude)
    field = convert(surface, field, conversion)
    write_field(options.output, field, surface)


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
    vertex, index = find_singularities(surface, field)
    magnitude = field.magnitude
    facts = {
        "degree": field.degree,
        "vertices": len(surface.vertices),
        "faces": surface.face_count,
        "euler_characteristic": euler_characteristic(surface),
        "magnitude": [float(magnitude.min()), float(magnitude.max())],
        "undefined_faces": int(np.count_nonzero(magnitude == 0)),
        "is_rosy": field.direction_ratios is None,
        "energy": dirichlet_energy(surface, field),
        "singularities": np.stack([vertex, index], axis=1).tolist(),
    }
    if options.against is not None:
        facts["against"] = _compare(options, surface, field, vertex, index)
    print_line(json.dumps(facts) if options.json else _format_info(facts))


def _compare(
    options: argparse.Namespace,
    surface: Surface,
    field: RosyField,
    vertex: np.ndarray,
    index: np.ndarray,
) -> dict[str, Any]:
    """Return the angles to the field in a file, or the differences from a file of singularities."""
    if options.against.suffix.lower() not in SINGULARITY_SUFFIXES:
        policy = nonfinite_policy(options)
        other_field = load_field(options.against, surface, field.degree, policy).field
        return error_statistics(surface, angle_errors(surface, field, other_field))
    degree, other_element, other_index = read_sings(options.against)
    if degree != field.degree:
        raise RosyError(
            f"{options.against}: is for a field of degree {degree}, but this field has degree {field.degree}"
        )
    own_pairs = set(zip(vertex.tolist(), index.tolist(), strict=True))
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
