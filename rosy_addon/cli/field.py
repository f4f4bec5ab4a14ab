"""The commands `field`, `info` and `compare`: write, convert, describe and compare fields."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np

from .. import api
from ..api.figures import LINES, check_figure_path, load_drawing
from ..api.generators import GENERATOR_FUNCTIONS
from ..api.pictures import picture_look
from ..core.errors import RosyError, counted
from ..field.convert import Conversion, convert
from ..field.curvature import MAGNITUDES
from ..field.field_io import DEFAULT_DEGREE, READ_SUFFIXES, WRITE_SUFFIXES
from ..field.formats.sings import SINGULARITY_SUFFIXES, read_sings
from ..field.mesh_arrays import SIMULATION_READERS
from ..field.mesh_io import READERS
from ..field.rosy_field import check_degree
from .mesh_field import add_field_file_options, add_mesh_options, load_mesh_and_field, read_field
from .options import CommandParser, Options, add_subcommand, float_between, int_between
from .streams import print_line

#: Generators that need only the mesh and a degree.
GENERATORS = ("form", "smoothest", "curvature", "features", "uv")


def add_field_command(subparsers: Any) -> None:
    """Add the command `field`."""
    parser = add_subcommand(subparsers, "field", run_field)
    add_mesh_options(parser)
    parser.add_output_option("OUT", ", ".join(WRITE_SUFFIXES))
    parser.add_value(
        "--to-degree", "N", "convert to this degree, a multiple or a divisor of the field's", int
    )
    parser.add_value(
        "--turn",
        "DEGREES",
        "rotate all directions by this angle",
        float_between(-360.0, 360.0),
        default=0.0,
    )
    parser.add_value(
        "--smooth",
        "SHARE",
        "diffuse the field over this fraction of the size of the mesh",
        float_between(0.0, 10.0),
        default=0.0,
    )
    parser.add_value(
        "--cancel-pairs",
        "SHARE",
        "remove pairs of singularities with opposite indices that are nearer than this fraction of the size "
        "of the mesh",
        float_between(0.0, 10.0),
        default=0.0,
    )
    parser.add_argument(
        "--magnitude", choices=list(MAGNITUDES), help="replace the lengths of the vectors"
    )


def run_field(options: Options) -> None:
    """Write a field file: generate a field, or convert the format, degree or vectors of one."""
    options.check_output()
    surface, field = load_mesh_and_field(options)
    conversion = Conversion(
        degree=options.to_degree,
        rotation=np.radians(options.turn),
        smoothing_length=options.smooth,
        pair_distance=options.cancel_pairs,
        magnitude=options.magnitude,
    )
    api.Field.of(surface, convert(surface, field, conversion)).save(options.output)


def add_info_command(subparsers: Any) -> None:
    """Add the command `info`."""
    parser = add_subcommand(subparsers, "info", run_info)
    add_mesh_options(parser)
    parser.add_switch("--json", "print one JSON object")
    parser.add_value(
        "--against",
        "FILE",
        "compare with another field file, or with a file of singularities (.sings)",
        Path,
    )


def run_info(options: Options) -> None:
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


def _compare(options: Options, field: api.Field) -> dict[str, Any]:
    """Compare a field with the file of the option --against, and return the results by name.

    For a field file these are angles in degrees. For a file of singularities (.sings) these are the number of
    equal singularities, and the singularities that only the field or only the file has.
    """
    if options.against.suffix.lower() not in SINGULARITY_SUFFIXES:
        other = read_field(options, options.against, field.surface, field.degree)
        difference = field.difference(other)
        angles = {name: np.degrees(getattr(difference, name)) for name in ("mean", "rms", "max")}
        return {**angles, "compared": difference.compared}
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
    """Return the results of the command `info` as text."""
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
    """Return lines of text for the result of `_compare`; no lines if it is None."""
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


def add_compare_command(subparsers: Any) -> None:
    """Add the command `compare`."""
    parser = add_subcommand(subparsers, "compare", run_compare, api.figure)
    suffixes = [*READERS, *SIMULATION_READERS]
    parser.add_argument("mesh", type=Path, metavar="MESH", help=", ".join(suffixes))
    parser.add_argument(
        "fields",
        nargs="+",
        metavar="[TITLE=]FIELD",
        help=f"a field file ({', '.join(READ_SUFFIXES)}), or what to generate: "
        f"{', '.join(GENERATORS)}. The first one is what the others are compared with",
    )
    parser.add_output_option(
        "OUT.pdf|OUT.svg|OUT.png",
        "draw the fields, their differences and the table; a .pdf has two pages",
        required=False,
    )
    parser.add_argument(
        "--format",
        choices=("text", "json", "latex"),
        default="text",
        help="of the table that is printed (%(default)s)",
    )
    parser.add_degree_option(
        "degree of generated fields, 1 to 12; by default that of the first field file, or 4"
    )
    add_field_file_options(parser)
    parser.add_value(
        "--match-reach",
        "SHARE",
        "largest distance of singularities that match, as a fraction of the size of the mesh (%(default)g)",
        float_between(0.0, 10.0),
        dest="reach",
    )
    _add_layout_options(parser)
    parser.add_direction_options()
    parser.add_workers_option()
    parser.add_look_options()


def _add_layout_options(parser: CommandParser) -> None:
    """Add the options for the layout and the texts of the figure of a comparison."""
    parser.add_argument(
        "--lines", choices=LINES, help="lines that are drawn over differences (%(default)s)"
    )
    add, count, inches = parser.add_value, int_between(1, 100), float_between(0.5, 100.0)
    add("--columns", "N", "panels side by side; by default at most 3", count)
    add("--width", "INCHES", "width of the figure (%(default)g)", inches)
    add("--dpi", "N", "resolution of the pictures (%(default)d)", int_between(10, 2400))
    add("--caption", "TEXT", "text below the fields")
    add("--scale-bar", "UNIT", "draw a scale bar, in this unit of the coordinates")
    add("--color-label", "TEXT", "title of the color bar; by default the name of what is shown")


def run_compare(options: Options) -> None:
    """Compare fields on a mesh: angles, energies and singularities."""
    preset, settings = options.requested_preset(), options.requested_settings()
    if options.output is not None:
        check_figure_path(options.output)
        options.check_output()
        picture_look(str(options.mesh), preset, settings, {})
        load_drawing()
    comparison = api.compare(_load_fields(options), reach=options.reach)
    if options.output is not None:
        _draw(options, comparison)
    write = {"text": comparison.to_text, "json": comparison.to_json, "latex": comparison.to_latex}
    print_line(write[options.format]())


def _draw(options: Options, comparison: api.Comparison) -> None:
    """Draw the figures of a comparison, and write them to a file."""
    rest = ("differences", "table") if comparison.differences else ("table",)
    if options.output.suffix.lower() == ".pdf":
        pages: list[dict[str, Any]] = [{}, {"parts": rest, "caption": ""}]
    else:
        pages = [{"parts": ("fields", *rest)}]
    figures = [
        api.figure(comparison, **options.api_arguments(api.figure, **page)) for page in pages
    ]
    api.save_figures(options.output, figures)


def _load_fields(options: Options) -> dict[str, api.Field]:
    """Read or generate the fields that the options name. Return them by title."""
    if options.degree is not None:
        check_degree(options.degree)
    sources = dict(_titled_source(text) for text in options.fields)
    if len(sources) < len(options.fields):
        raise RosyError(f"{options.mesh}: two fields have the same title: give TITLE=FIELD")
    fields: dict[str, api.Field | None] = dict.fromkeys(sources)
    surface = api.Surface(options.mesh, up=options.up)
    degree = options.degree
    # Files are read before fields are generated, because the first file sets the degree of the latter.
    for title, source in sorted(sources.items(), key=lambda item: item[1] in GENERATORS):
        if source in GENERATORS:
            fields[title] = GENERATOR_FUNCTIONS[source](surface, degree or DEFAULT_DEGREE)
        else:
            field = fields[title] = read_field(options, Path(source), surface, None)
            degree = degree or field.degree
    return fields


def _titled_source(text: str) -> tuple[str, str]:
    """Split an argument of the form [TITLE=]FIELD, and return the title and the source of the field."""
    title, separator, source = text.partition("=")
    if separator and source and not Path(text).exists():
        return title, source
    return (text.capitalize() if text in GENERATORS else Path(text).stem), text
