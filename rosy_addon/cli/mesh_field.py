"""Options of a mesh and its field, shared by the commands that read mesh files."""

from pathlib import Path

from .. import api
from ..api.generators import GENERATOR_FUNCTIONS
from ..core.errors import RosyError
from ..core.settings import settings_of
from ..field.field_io import DEFAULT_DEGREE, READ_SUFFIXES
from ..field.formats.plain import read_guide_strokes
from ..field.generate import GENERATORS, GeneratorSettings, options_of
from ..field.mesh_arrays import SIMULATION_READERS
from ..field.mesh_io import READERS
from .options import CommandParser, Options, int_between

#: Help of the option --join.
JOIN_TEXT = (
    "join vertices on borders that coincide, as at the seam of a grid; by default only of .stl files and files of "
    "simulations. Also remove faces that have the same corners as others, as on a two-sided sheet"
)

#: The options that name inputs of generated fields, and the kinds of fields that use them.
INPUT_KINDS = {
    "strokes": ["guided"],
    "guides": ["guided", "prescribed"],
    "firmness": ["guided"],
    "edges": ["features", "guided"],
    "singularities": ["prescribed"],
    "uv": ["guided"],
}


def add_mesh_options(parser: CommandParser) -> None:
    """Add the arguments MESH and FIELD, and the options that generate a field."""
    *suffixes, last = READERS
    parser.add_argument("mesh", type=Path, metavar="MESH", help=f"{', '.join(suffixes)} or {last}")
    parser.add_toggle("--join", JOIN_TEXT)
    add_field_options(parser)


def add_field_options(parser: CommandParser) -> None:
    """Add the argument FIELD, and the options that generate a field."""
    text = f"{', '.join(READ_SUFFIXES)}; or two files with a direction of a cross in each row"
    parser.add_argument("field", type=Path, nargs="*", metavar="FIELD", help=text, default=[])
    of_array = ", 1 for an array of vectors" if SIMULATION_READERS else ""
    parser.add_degree_option(
        f"degree of the field, 1 to 12; by default that of the field file{of_array}, or 4"
    )
    add_field_file_options(parser)
    _add_generator_options(parser)
    _add_simulation_options(parser)


def add_field_file_options(parser: CommandParser) -> None:
    """Add the options for reading field files."""
    text = "mesh file that the field belongs to, if it is not MESH; the field is transferred by position"
    parser.add_value("--field-mesh", "MESH", text, Path)
    parser.add_undefined_option()


def _add_generator_options(parser: CommandParser) -> None:
    """Add the options that generate a field."""
    text = (
        "generate a field instead of reading one; by default guided if there are guides, "
        "prescribed if there are singularities, otherwise form"
    )
    parser.add_argument("--generate", choices=list(GENERATORS), help=text)
    for name, setting in settings_of(GeneratorSettings).items():
        if kinds := _kinds_with(name):
            parser.add_setting_option(setting, f"; for --generate {', '.join(kinds)}")
    text = "strokes on the mesh that a guided field follows: rows x y z, with an empty line between two strokes"
    parser.add_value("--strokes", "FILE", text, Path)
    text = (
        "a field file that a guided field follows where its vectors are not zero; a prescribed field "
        "is turned to it as a whole"
    )
    parser.add_value("--guides", "FIELD", text, Path)
    text = (
        "let the lengths of --guides, from 0 to 1, say how firmly a guided field follows them, as for "
        "guides that are combed in Blender"
    )
    parser.add_switch("--firmness", text)
    text = (
        "edges that a field of --generate features or guided follows: a .sharp file of QuadWild, or a .feature "
        "file of TriCrossField"
    )
    parser.add_value("--edges", "FILE", text, Path)
    text = "singular vertices and their indices, for --generate prescribed"
    parser.add_value("--singularities", "FILE.sings", text, Path)
    parser.add_switch("--uv", "make a guided field follow the UV map of an .obj file")


def _add_simulation_options(parser: CommandParser) -> None:
    """Add the options for files of simulations, if this program can read such files."""
    parser.set_defaults(array=None, step=None)
    if not SIMULATION_READERS:
        return
    suffixes = ", ".join(SIMULATION_READERS)
    parser.epilog = f"MESH may also be the file of a simulation: {suffixes}."
    text = (
        "array of the file of a simulation that is the field, by default the only one of vectors or "
        "tensors; or the vectors NAME_x, NAME_y, NAME_z of a .ply file"
    )
    parser.add_value("--array", "NAME", text)
    text = "step of the file of a simulation, from 1; by default the last one"
    parser.add_value("--step", "N", text, int_between(1, 10**9))


def load_mesh_and_field(options: Options) -> tuple[api.Surface, api.Field]:
    """Read the mesh. Read the field from a file, or generate it.

    If the mesh is in a file of a simulation, the field is one of the arrays of this file, unless the options
    name a field file or a generator.
    """
    if options.field and options.generate is not None:
        raise RosyError(f"{options.field[0]}: give either a field file or --generate, not both")
    mesh, suffix = options.mesh, options.mesh.suffix.lower()
    is_simulation = suffix in SIMULATION_READERS
    names = ("field", "generate", "strokes", "guides", "singularities", "edges")
    has_source = options.uv or any(getattr(options, name) not in (None, []) for name in names)
    if options.array is not None and not (is_simulation or suffix == ".ply"):
        raise RosyError(f"{mesh}: --array applies only to .ply files and files of simulations")
    if options.step is not None and not is_simulation:
        raise RosyError(f"{mesh}: --step applies only to files of simulations, such as .vtu")
    if options.array is not None and has_source:
        raise RosyError(f"{mesh}: give either --array, or a field file or --generate")
    is_array = (is_simulation and not has_source) or options.array is not None
    kind = None if options.field or is_array else _generated_kind(options)
    _check_generator_options(options, kind)
    up, join = getattr(options, "up", None), getattr(options, "join", None)
    surface = api.Surface(mesh, up=up, step=options.step, join=join)
    if options.field:
        field = read_field(options, options.field, surface, options.degree)
    elif kind is None:
        policies = {"nonfinite": options.nonfinite, "off_surface": options.off_surface}
        field = api.from_array(surface, options.array, options.degree, **policies)
    else:
        field = _generate_field(options, surface, kind)
    return surface, field


def read_field(
    options: Options, path: Path | list[Path], surface: api.Surface, degree: int | None
) -> api.Field:
    """Read one or several field files, with the options that `add_field_file_options` adds."""
    policies = {"nonfinite": options.nonfinite, "off_surface": options.off_surface}
    return api.read_field(path, surface, degree, **policies, mesh=options.field_mesh)


def _kinds_with(setting: str) -> list[str]:
    """Return the kinds of fields whose generator uses a setting of `GeneratorSettings`, given its name."""
    return [kind for kind in GENERATORS if setting in options_of(kind)]


def _generated_kind(options: Options) -> str:
    """Return the kind of field to generate: of the option --generate, or the one that the inputs call for."""
    if options.generate is not None:
        return options.generate
    if options.singularities is not None:
        return "prescribed"
    if options.strokes is not None or options.guides is not None:
        return "guided"
    return "form" if options.edges is None else "features"


def _check_generator_options(options: Options, kind: str | None) -> None:
    """Raise an error if an option is given that has no effect on a field of this kind.

    `kind` is None for a field that is read and not generated.
    """
    for name in (*INPUT_KINDS, *settings_of(GeneratorSettings)):
        kinds = INPUT_KINDS.get(name) or _kinds_with(name)
        if getattr(options, name, None) not in (None, False) and kind not in kinds:
            option = f"--{name.replace('_', '-')}"
            raise RosyError(
                f"{options.mesh}: {option} applies only to --generate {', '.join(kinds)}"
            )


def _generate_field(options: Options, surface: api.Surface, kind: str) -> api.Field:
    """Generate a field of a kind with the inputs that the options name."""
    names = {"degree", *options_of(kind)}
    arguments = {name: value for name, value in vars(options).items() if name in names}
    if options.degree is None and kind != "prescribed":
        arguments["degree"] = DEFAULT_DEGREE
    if kind == "prescribed":
        if options.singularities is None:
            raise RosyError(f"{options.mesh}: give the singularities: --singularities FILE.sings")
        arguments["singularities"] = options.singularities
    if options.edges is not None:
        arguments["edges"] = options.edges
    if kind == "guided":
        arguments |= {"uv": options.uv, "vectors_have_firmness": options.firmness}
        if options.strokes is not None:
            arguments["strokes"] = read_guide_strokes(options.strokes)
    if options.guides is not None:
        arguments["vectors"] = read_field(options, options.guides, surface, arguments["degree"])
    return GENERATOR_FUNCTIONS[kind](surface, **arguments)
