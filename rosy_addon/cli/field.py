"""The commands `field`, `info` and `compare`: write, convert, describe and compare fields."""

import json
import logging
import os
from collections.abc import Iterator
from contextlib import chdir, contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from .. import api
from ..api.figures import LIMITS, LINES, check_figure_path, load_drawing
from ..api.generators import GENERATOR_FUNCTIONS
from ..core.errors import RosyError, counted
from ..field.convert import Conversion, convert
from ..field.curvature import MAGNITUDES
from ..field.field_io import DEFAULT_DEGREE, READ_SUFFIXES, WRITE_SUFFIXES
from ..field.formats.polygons import Polygons
from ..field.formats.sings import SINGULARITY_SUFFIXES, read_sings
from ..field.joining import coinciding_borders
from ..field.mesh_arrays import SIMULATION_READERS
from ..field.mesh_io import READERS
from ..field.singularities import count_ties
from .mesh_field import add_field_file_options, add_mesh_options, load_mesh_and_field, read_field
from .options import CommandParser, Options, add_subcommand, float_between, int_between
from .streams import print_line

#: Generators that need only the mesh and a degree.
GENERATORS = ("form", "smoothest", "curvature", "features", "uv")


def add_field_command(subparsers: Any) -> None:
    """Add the command `field`."""
    parser = add_subcommand(subparsers, run_field)
    add_mesh_options(parser)
    parser.add_output_option("OUT", ", ".join(WRITE_SUFFIXES))
    text = "convert to this degree, a multiple or a divisor of the field's"
    parser.add_value("--to-degree", "N", text, int)
    text, angle = "rotate all directions by this angle", float_between(-360.0, 360.0)
    parser.add_value("--turn", "DEGREES", text, angle, default=0.0)
    share = float_between(0.0, 10.0)
    text = "diffuse the field over this fraction of the size of the mesh"
    parser.add_value("--smooth", "SHARE", text, share, default=0.0)
    text = "remove singularities that are nearer than this fraction of the size of the mesh and whose indices sum to 0"
    parser.add_value("--cancel-pairs", "SHARE", text, share, default=0.0)
    text = "replace the lengths of the vectors; the curvature is in 1 / unit of the mesh"
    parser.add_argument("--magnitude", choices=list(MAGNITUDES), help=text)


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
    parser = add_subcommand(subparsers, run_info)
    add_mesh_options(parser)
    parser.add_switch("--json", "print one JSON object")
    text = "read singularities as one if they are within this fraction of the size of the mesh"
    parser.add_value("--cluster", "SHARE", text, float_between(0.0, 10.0), default=0.0)
    text = "compare with another field file, or with a file of singularities (.sings)"
    parser.add_value("--against", "FILE", text, Path)


def run_info(options: Options) -> None:
    """Describe a mesh and its field, and compare the field with another one."""
    surface, field = load_mesh_and_field(options)
    magnitude = field.magnitude
    found = field.clusters(options.cluster) if options.cluster else field.singularities
    facts = {
        "degree": field.degree,
        "vertices": len(surface.vertices),
        "faces": surface.face_count,
        "euler_characteristic": surface.euler_characteristic,
        "magnitude": [float(magnitude.min()), float(magnitude.max())],
        "coinciding_vertices": _coinciding_vertices(surface),
        "undefined_faces": int(np.count_nonzero(magnitude == 0)),
        "is_rosy": field.is_rosy,
        "energy": field.energy,
        "ties": count_ties(surface, field),
        "singularities": np.stack(found, axis=1).tolist(),
    }
    if options.against is not None:
        facts["against"] = _compare(options, field)
    print_line(json.dumps(facts) if options.json else _format_info(facts))


def _coinciding_vertices(surface: api.Surface) -> int:
    """Return how many vertices on borders are at the position of others."""
    polygons = Polygons(surface.vertices, surface.corner_vertex, surface.face_start)
    target = coinciding_borders(polygons, None)
    return int(np.count_nonzero(target != np.arange(len(target))))


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
    degree, singularities = facts["degree"], facts["singularities"]
    faces = counted(facts["faces"], "face")
    vertices = counted(facts["vertices"], "vertex", "vertices")
    low, high = facts["magnitude"]
    undefined = counted(facts["undefined_faces"], "face")
    lines = [
        f"degree {degree}",
        f"{faces}, {vertices}, Euler characteristic {facts['euler_characteristic']}",
        f"magnitude {low:.4g} to {high:.4g}, undefined on {undefined}",
        f"energy {facts['energy']:.6g}",
    ]
    if facts["coinciding_vertices"]:
        coinciding = counted(facts["coinciding_vertices"], "vertex", "vertices")
        text = f"{coinciding} on borders coincide with others: --join joins those with equal data"
        lines.insert(2, text)
    if not facts["is_rosy"]:
        lines.append("directions at free angles, not a RoSy")
    if "against" in facts:
        lines.append(_format_comparison(facts["against"]))
    if facts["ties"]:
        edges = counted(facts["ties"], "edge")
        lines.append(
            f"{edges} where the field turns by {180 / degree:.4g} degrees, to either side: "
            "singularities near them are arbitrary; smooth the field (--smooth)"
        )
    lines.append(counted(len(singularities), "singularity", "singularities"))
    lines += [f"  vertex {vertex}: {index:+d}/{degree}" for vertex, index in singularities]
    return "\n".join(lines)


def _format_comparison(against: dict[str, Any]) -> str:
    """Return the differences or equal singularities from `_compare` as a line of text."""
    if "same" in against:
        here, there = len(against["only_here"]), len(against["only_there"])
        same = against["same"]
        return f"singularities: {same} are the same, {here} only here, {there} only there"
    return (
        f"off by {against['mean']:.4g} degrees on average, rms {against['rms']:.4g}, at most "
        f"{against['max']:.4g}, on {100 * against['compared']:.4g} % of the faces"
    )


def add_compare_command(subparsers: Any) -> None:
    """Add the command `compare`."""
    parser = add_subcommand(subparsers, run_compare, api.figure)
    suffixes = [*READERS, *SIMULATION_READERS]
    parser.add_argument("mesh", type=Path, metavar="MESH", help=", ".join(suffixes))
    text = (
        f"a field file ({', '.join(READ_SUFFIXES)}), or what to generate: {', '.join(GENERATORS)}. "
        "The first one is what the others are compared with"
    )
    parser.add_argument("fields", nargs="+", metavar="[TITLE=]FIELD", help=text)
    text = "draw the fields, their differences and the table; a .pdf has two pages"
    parser.add_output_option("OUT.pdf|OUT.svg|OUT.png", text, required=False)
    text, formats = "of the table that is printed (%(default)s)", ("text", "json", "latex")
    parser.add_argument("--format", choices=formats, default="text", help=text)
    text = "degree of generated fields, 1 to 12; by default that of the first field file, or 4"
    parser.add_degree_option(text)
    add_field_file_options(parser)
    text = "largest distance of singularities that match, as a fraction of the size of the mesh (%(default)g)"
    parser.add_value("--match-reach", "SHARE", text, float_between(0.0, 10.0), dest="reach")
    _add_layout_options(parser)
    parser.add_direction_options()
    parser.add_workers_option()
    parser.add_look_options()


def _add_layout_options(parser: CommandParser) -> None:
    """Add the options for the layout and the texts of the figure of a comparison."""
    text = "lines that are drawn over differences (%(default)s)"
    parser.add_argument("--lines", choices=LINES, help=text)
    add, count, inches = parser.add_value, int_between(1, 100), float_between(*LIMITS["width"])
    add("--columns", "N", "panels side by side; by default at most 3", count)
    add("--width", "INCHES", "width of the figure (%(default)g)", inches)
    add("--dpi", "N", "resolution of the pictures (%(default)d)", int_between(*LIMITS["dpi"]))
    add("--caption", "TEXT", "text below the fields")
    add("--scale-bar", "UNIT", "draw a scale bar, in this unit of the coordinates")
    add("--color-label", "TEXT", "title of the color bar; by default the name of what is shown")


def run_compare(options: Options) -> None:
    """Compare fields on a mesh: angles, energies and singularities."""
    if options.output is not None:
        check_figure_path(options.output)
        options.check_output()
        with _no_matplotlibrc():
            load_drawing()
    arguments = options.picture_arguments(api.figure, options.mesh)
    comparison = api.compare(_load_fields(options), reach=options.reach)
    if options.output is not None:
        _draw(options.output, comparison, arguments)
    write = {"text": comparison.to_text, "json": comparison.to_json, "latex": comparison.to_latex}
    print_line(write[options.format]())


@contextmanager
def _no_matplotlibrc() -> Iterator[None]:
    """Context manager: matplotlib finds no ``matplotlibrc`` if it is imported in the block.

    matplotlib would read a ``matplotlibrc`` in the current folder, which may be an untrusted file, a binary file
    or a pipe. Figures do not use its settings. Log messages of matplotlib below errors are dropped.
    """
    logging.getLogger("matplotlib").setLevel(logging.ERROR)
    previous = os.environ.get("MATPLOTLIBRC")
    os.environ["MATPLOTLIBRC"] = os.devnull
    try:
        with chdir(Path(__file__).parent):
            yield
    finally:
        del os.environ["MATPLOTLIBRC"]
        if previous is not None:
            os.environ["MATPLOTLIBRC"] = previous


def _draw(path: Path, comparison: api.Comparison, arguments: dict[str, Any]) -> None:
    """Draw the figures of a comparison with these arguments of `api.figure`, and write them to a file."""
    rest = ("differences", "table") if comparison.differences else ("table",)
    pages: list[dict[str, Any]] = [{"parts": ("fields", *rest)}]
    if path.suffix.lower() == ".pdf":
        pages = [{}, {"parts": rest, "caption": ""}]
    api.save_figures(path, [api.figure(comparison, **(arguments | page)) for page in pages])


def _load_fields(options: Options) -> dict[str, api.Field]:
    """Read or generate the fields that the options name. Return them by title."""
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
    if separator and source and not os.path.exists(text):  # a text may be too long for a path
        return title, source
    return (text.capitalize() if text in GENERATORS else Path(text).stem), text
