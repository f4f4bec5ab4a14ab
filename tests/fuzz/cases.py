"""The categories of cases: each makes files in a folder and returns a command line."""

import os
import signal
import stat
import zlib
from collections.abc import Callable
from dataclasses import dataclass, field
from importlib.util import find_spec
from pathlib import Path

import numpy as np
from numpy.random import Generator

from .damage import damaged, random_word
from .files import FIELD_SUFFIXES, field_bytes, guide_bytes, png_bytes, preset_bytes
from .links import link_case
from .meshes import WRITERS, Polygons, closed_mesh, mesh_bytes, random_mesh, with_texture_rows
from .names import hostile_stem, hostile_text
from .options import random_options
from .signals import write_command
from .singular import singularities_changed, singularity_bytes
from .uv_maps import OUTPUTS as UV_OUTPUTS
from .uv_maps import make_tiles, tile_fault, tile_names, uv_mesh_bytes


@dataclass
class Case:
    """One run of the command line.

    Attributes
    ----------
    arguments : list of str
        Without the name of the program. Paths are relative to the folder of the case.
    outputs : set of str
        Names of files that the run may write, and of folders, which end in a slash. All others have
        to stay unchanged.
    environment : dict of str to str
        Changed variables of the environment.
    stdout : str
        What standard output is: "file", "closed" (a pipe without a reader) or "full" (/dev/full).
    stop_after : float, optional
        Seconds after which the run gets a signal.
    stop_signal : Signals
    stops_group : bool
        Whether the signal goes to the process group, as from a terminal, or to the first process alone.
    own_process : bool
        Whether to start Python anew instead of forking, which takes ten times as long.
    fault : callable, optional
        Takes the folder after a run with the status 0, and returns what is wrong with what was written, or an
        empty text.
    """

    arguments: list[str]
    outputs: set[str] = field(default_factory=set)
    environment: dict[str, str] = field(default_factory=dict)
    stdout: str = "file"
    stop_after: float | None = None
    stop_signal: signal.Signals = signal.SIGINT
    stops_group: bool = False
    own_process: bool = False
    fault: Callable[[Path], str] | None = None

    def may_write(self, name: str) -> bool:
        """Whether the run may write a file."""
        folders = tuple(output for output in self.outputs if output.endswith("/"))
        return name in self.outputs or f"{name}/" in self.outputs or name.startswith(folders)


def make_case(category: str, seed: int, folder: Path) -> Case:
    """Write the files of a case of a category to an empty folder, and return the case."""
    rng = np.random.default_rng([zlib.crc32(category.encode()), seed])
    make, _ = CATEGORIES[category]
    return make(rng, folder)


#: Commands for mesh files, with the extensions of their output.
_OUTPUTS = {
    "render": (".png",),
    "strokes": (".svg", ".svg", ".ply", ".obj", ".csv"),
    "field": tuple(
        [".rosy", ".rawfield", ".txt", ".npy", ".obj", ".sings", ".npz", ".vtp", ".vtu", ".ply"]
    ),
    "turntable": (".gif",),
}

#: Extensions of files from which the singularities of a field on faces can be read again.
SINGULAR_SUFFIXES = (".rosy", ".rawfield", ".txt", ".npy", ".npz", ".sings")


def _write(rng: Generator, folder: Path, name: str, data: bytes, damage: float = 0.0) -> str:
    """Write a file, damaged with a probability, and return its name."""
    (folder / name).write_bytes(damaged(rng, data) if rng.random() < damage else data)
    return name


def _write_mesh(
    rng: Generator, folder: Path, mesh: Polygons, suffix: str = "", damage: float = 0.0
) -> str:
    suffix = suffix if suffix and rng.random() < 0.95 else list(WRITERS)[rng.integers(4)]
    return _write(rng, folder, f"mesh{suffix}", mesh_bytes(rng, suffix, mesh), damage)


def _write_field(
    rng: Generator, folder: Path, mesh: Polygons, name: str = "field", damage: float = 0.0
) -> str:
    suffix = FIELD_SUFFIXES[rng.choice(5, p=[0.3, 0.3, 0.15, 0.2, 0.05])]
    return _write(rng, folder, name + suffix, field_bytes(rng, suffix, mesh), damage)


def _command(
    rng: Generator, folder: Path, inputs: list[str], options: list[str] | None = None, **chosen
) -> Case:
    """Return a case of a random command with random options, small pictures, and an output."""
    commands = ["render", "strokes", "field", "info", "turntable"]
    command = chosen.get("command") or str(rng.choice(commands, p=[0.36, 0.26, 0.18, 0.17, 0.03]))
    # A field file rules out a generator, and has a degree.
    leave_out = {"generate", "degree"} if len(inputs) > 1 and rng.random() < 0.95 else set()
    words = random_options(rng, command, rate=chosen.get("rate", 0.12), leave_out=leave_out)
    case = Case([command, *inputs, *words, *(options or [])])
    if command not in ("field", "info") and not _has(case.arguments, "--size"):
        case.arguments += ["--size", f"{rng.integers(8, 90)}x{rng.integers(8, 90)}"]
    if command == "turntable" and not _has(words, "--pictures"):
        case.arguments += ["--pictures", "2"]
    if command == "info":
        case.arguments += ["--json"] * int(rng.random() < 0.5)
        return case
    output = f"out{rng.choice(_OUTPUTS[command])}"
    case.arguments += ["-o", output]
    case.outputs.add(output)
    if rng.random() < 0.1:
        (folder / output).write_bytes(b"the previous contents")
    return case


def _has(words: list[str], option: str) -> bool:
    return any(word.split("=")[0] == option for word in words)


def _shape_case(rng: Generator, folder: Path) -> Case:
    """An odd shape in an undamaged file, with a generated field."""
    return _command(rng, folder, [_write_mesh(rng, folder, random_mesh(rng))])


def _mesh_file_case(rng: Generator, folder: Path) -> Case:
    """A damaged mesh file."""
    name = _write_mesh(rng, folder, random_mesh(rng, faults=0), damage=1.0)
    if rng.random() < 0.05:  # another format than the name says
        name = (folder / name).rename(folder / f"mesh{list(WRITERS)[rng.integers(4)]}").name
    command = "info" if rng.random() < 0.5 else None
    return _command(rng, folder, [name], command=command, rate=0.03)


def _field_file_case(rng: Generator, folder: Path) -> Case:
    """A field file, damaged in half of all cases."""
    mesh = random_mesh(rng, faults=int(rng.random() < 0.3))
    names = [_write_mesh(rng, folder, mesh), _write_field(rng, folder, mesh, damage=0.5)]
    options = ["--undefined"] * int(rng.random() < 0.3)
    case = _command(rng, folder, names, options, rate=0.08)
    if case.arguments[0] == "info" and rng.random() < 0.4:
        case.arguments += ["--against", _write_field(rng, folder, mesh, "other")]
    return case


def _guide_case(rng: Generator, folder: Path) -> Case:
    """A field guided by strokes, another field or a UV map, or by its singularities."""
    mesh = random_mesh(rng, faults=int(rng.random() < 0.3))
    name, options = _write_mesh(rng, folder, mesh), ["--generate", "guided"]
    if rng.random() < 0.3:
        data = field_bytes(rng, ".sings", mesh)
        options = ["--generate", "prescribed"] * int(rng.random() < 0.7)
        options += ["--singularities", _write(rng, folder, "a.sings", data, 0.2)]
        return _command(rng, folder, [name], options, rate=0.06)
    if rng.random() < 0.9:
        data = guide_bytes(rng, mesh)
        options += ["--strokes", _write(rng, folder, "guides.txt", data, 0.4)]
    if rng.random() < 0.2:
        options += ["--guides", _write_field(rng, folder, mesh)]
    if name.endswith(".obj") and rng.random() < 0.4:
        options += ["--uv"]
    return _command(rng, folder, [name], options, rate=0.06)


def _prescribed_case(rng: Generator, folder: Path) -> Case:
    """Given singularities on a mesh that is closed, open, in parts or not manifold."""
    is_closed = rng.random() < 0.6
    mesh = closed_mesh(rng) if is_closed else random_mesh(rng, faults=int(rng.random() < 0.4))
    name = _write_mesh(rng, folder, mesh, str(rng.choice([".obj", ".off", ".ply"])))
    given = _write(rng, folder, "a.sings", singularity_bytes(rng, mesh))
    output = f"out{rng.choice(SINGULAR_SUFFIXES)}"
    arguments = ["field", name, "--generate", "prescribed", "--singularities", given, "-o", output]
    add_missing = bool(rng.random() < 0.6)
    arguments += ["--add-missing"] * add_missing
    if rng.random() < 0.3:
        degree = int((folder / given).read_bytes().split()[0])
        guides = _write(rng, folder, "guides.rosy", field_bytes(rng, ".rosy", mesh, degree))
        arguments += ["--guides", guides, "--undefined", "--off-surface=project"]
        arguments.append(f"--reach={rng.choice([0.0, 0.01, 0.1, 1.0])}")

    def fault(folder: Path) -> str:
        files = (folder / file for file in (name, given, output))
        return singularities_changed(*files, add_missing=add_missing)

    return Case(arguments, {output}, fault=fault)


def _option_case(rng: Generator, folder: Path) -> Case:
    """Many options, some of them without sense, on an undamaged mesh."""
    name = _write_mesh(rng, folder, random_mesh(rng, faults=0))
    case = _command(rng, folder, [name], rate=0.3)
    kind = rng.random()
    if kind < 0.1:
        position = rng.integers(len(case.arguments) + 1)
        case.arguments.insert(position, random_word(rng).replace("\0", ""))
    elif kind < 0.15:
        del case.arguments[rng.integers(len(case.arguments))]
    return case


def _look_case(rng: Generator, folder: Path) -> Case:
    """A preset file, and settings at the ends of their ranges."""
    mesh = random_mesh(rng, faults=int(rng.random() < 0.1))
    inputs, options = [_write_mesh(rng, folder, mesh)], []
    if rng.random() < 0.4:
        inputs.append(_write_field(rng, folder, mesh))
    if rng.random() < 0.6:
        options += ["--preset", _write(rng, folder, "mine.json", preset_bytes(rng), 0.2)]
    if rng.random() < 0.05:
        return Case(["presets", "--json"], environment={"ROSY_PRESETS": "."} if options else {})
    return _command(rng, folder, inputs, options, command="render", rate=0.25)


def _tone_case(rng: Generator, folder: Path) -> Case:
    """A tone from an image, a picture or an attribute, and colors from an attribute."""
    kind = ("image", "picture", "attribute")[rng.integers(3)]
    suffix = {"image": ".obj", "picture": "", "attribute": ".ply"}[kind]
    name, options = _write_mesh(rng, folder, random_mesh(rng, faults=0), suffix), [f"--tone-{kind}"]
    if kind == "attribute":
        options.append(("Color", "Color", "red", "x", "", "\x1b[31m", "green")[rng.integers(7)])
    else:
        width, height = (int(side) for side in rng.integers(1, 50, 2))
        fits = kind == "picture" and rng.random() < 0.8
        data = png_bytes(rng, (width, height) if fits else None)
        options.append(_write(rng, folder, "tone.png", data, 0.15))
        options += [f"--size={width}x{height}"] if fits else []
    if rng.random() < 0.3:
        options.append(f"--color-values={('red', 'x', 'quality', '')[rng.integers(4)]}")
    return _command(rng, folder, [name], options, command="render", rate=0.06)


def _texture_case(rng: Generator, folder: Path) -> Case:
    """A texture for a UV map that may have tiles, reach far, overlap, or have no area."""
    is_closed = rng.random() < 0.4
    mesh = closed_mesh(rng) if is_closed else random_mesh(rng, faults=int(rng.random() < 0.3))
    tiles: set[int] = set()
    if rng.random() < 0.6:
        data, tiles = uv_mesh_bytes(rng, mesh)
    else:
        data = mesh_bytes(rng, ".obj", mesh)
        if rng.random() < 0.5:  # few values, so that corners coincide
            scale = 10.0 ** rng.uniform(-6, 6)
            data = with_texture_rows(data, scale * rng.random((9, 2)))
    inputs = [_write(rng, folder, "mesh.obj", data)]
    if rng.random() < 0.3:
        inputs.append(_write_field(rng, folder, mesh))
    leave_out = {"size", *({"generate", "degree"} if len(inputs) > 1 else ())}
    words = random_options(rng, "texture", rate=0.12, leave_out=leave_out)
    sizes = [16, 32, 64, 200, 400, 8, 99999]
    size = int(rng.choice(sizes, p=[0.4, 0.35, 0.18, 0.03, 0.02, 0.01, 0.01]))
    words += ["--set", "ink=hatch"] * int(rng.random() < 0.5)
    output = str(rng.choice(UV_OUTPUTS))
    make_tiles(rng, folder, output, tiles)

    def fault(folder: Path) -> str:
        return tile_fault(folder, output, size, tiles, is_exact=is_closed)

    arguments = ["texture", *inputs, *words, "--size", str(size), "-o", output]
    return Case(arguments, tile_names(output), fault=fault)


def _simulation_case(rng: Generator, folder: Path) -> Case:
    """A file of a simulation, damaged or with references to pipes, devices and itself."""
    from .simulations import write_simulation

    name = write_simulation(rng, folder)
    command = "info" if rng.random() < 0.8 else None
    options = ["--step", str(rng.integers(4))] * int(rng.random() < 0.1)
    return _command(rng, folder, [name], options, command=command, rate=0.02)


def _path_case(rng: Generator, folder: Path) -> Case:
    """Paths that are not plain files, too long, linked, odd, or the input itself."""
    name = _write_mesh(rng, folder, random_mesh(rng, faults=0))
    case = _command(rng, folder, [name], rate=0.03)
    as_output = bool(case.outputs) and rng.random() < 0.7
    position = len(case.arguments) - 1 if as_output else 1
    suffix = Path(case.arguments[position]).suffix
    writable = [f"link{suffix}", f"folder/../new{suffix}", f"a b{suffix}", f"\x1b[31m{suffix}"]
    writable += [f"é\u202e{suffix}", f"-x{suffix}", f"{'x' * 250}{suffix}"]
    others = [f"{kind}{suffix}" for kind in ("folder", "pipe", "loop", "device", "a" * 300)]
    others += ["", ".", "-", name, f"missing/out{suffix}", f"{name}/out{suffix}", "a/" * 3000]
    (folder / f"folder{suffix}").mkdir()
    (folder / "folder").mkdir()
    os.mkfifo(folder / f"pipe{suffix}")
    (folder / f"link{suffix}").symlink_to(f"target{suffix}")
    (folder / f"loop{suffix}").symlink_to(f"loop{suffix}")
    device = folder / f"device{suffix}"
    if os.geteuid() == 0:  # never a device of the machine if this process might replace it
        os.mknod(device, stat.S_IFCHR | 0o666, os.makedev(1, 3))
    else:
        device.symlink_to("/dev/null")
    paths = writable if rng.random() < 0.5 else others
    path = paths[rng.integers(len(paths))]
    case.arguments[position] = path
    if as_output:
        case.outputs = {Path(path).name, f"target{suffix}"} if path in writable else set()
        if path.startswith("-"):
            case.arguments[-2:] = [f"-o{path}"]
    return case


def _link_case(rng: Generator, folder: Path) -> Case:
    """Links at the path of the output, at the folder of the output, or at the paths of tiles."""
    return Case(*link_case(rng, folder))


def _stream_case(rng: Generator, folder: Path) -> Case:
    """Closed, full and ASCII streams, interrupts and kills, in processes of their own."""
    name = _write_mesh(rng, folder, random_mesh(rng, faults=0))
    case = Case(["presets"]) if rng.random() < 0.2 else _command(rng, folder, [name], rate=0.02)
    for output in case.outputs:
        (folder / output).write_bytes(b"the previous contents")
    case.own_process = True
    match rng.integers(6):
        case 0:
            case.stdout = "closed"
        case 1:
            case.stdout = "full"
        case 2:
            case.environment |= {"PYTHONIOENCODING": "ascii", "LC_ALL": "C"}
        case _:
            _stop(rng, case, 1.0)
    return case


def _stop(rng: Generator, case: Case, seconds: float) -> None:
    """Let a random signal stop a case within some seconds."""
    case.own_process, case.stop_after = True, float(rng.uniform(0.0, seconds))
    signals = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGKILL)
    case.stop_signal, case.stops_group = signals[rng.integers(4)], bool(rng.random() < 0.5)


def _signal_case(rng: Generator, folder: Path) -> Case:
    """A signal to a command that starts other processes, at any moment."""
    arguments, outputs, seconds = write_command(rng, folder)
    case = Case(arguments, outputs)
    _stop(rng, case, seconds)
    return case


def _name_case(rng: Generator, folder: Path) -> Case:
    """Titles, labels and names of files with hostile characters, in figures and other files."""
    points, faces = random_mesh(rng, faults=0)
    mesh, suffix = (points, faces[:60]), list(WRITERS)[rng.integers(4)]
    mesh_name, field_name = (hostile_stem(rng) + ending for ending in (suffix, ".rosy"))
    (folder / mesh_name).write_bytes(mesh_bytes(rng, suffix, mesh))
    (folder / field_name).write_bytes(field_bytes(rng, ".rosy", mesh))
    if rng.random() < 0.2:
        case = _command(rng, folder, [mesh_name, field_name], rate=0.0)
        if case.outputs:
            case.arguments[-1] = hostile_stem(rng) + Path(case.outputs.pop()).suffix
            case.outputs = {case.arguments[-1]}
        return case
    kinds = ["form", "form", "form", "curvature", "curvature", "smoothest", field_name]
    sources = rng.choice(kinds, rng.integers(1, 4))
    fields = [
        f"{hostile_text(rng)}={name}" if rng.random() < 0.8 else str(name) for name in sources
    ]
    leave_out = {"caption", "scale_bar", "format", "dpi"}
    words = random_options(rng, "compare", rate=0.05, leave_out=leave_out)
    for option in ("--caption", "--scale-bar", "--color-label"):
        words += [f"{option}={hostile_text(rng)}"] if rng.random() < 0.3 else []
    words += ["--set=supersampling=1", f"--dpi={rng.integers(15, 50)}"]
    words += [f"--format={('text', 'json', 'latex')[rng.integers(3)]}"]
    output = f"{hostile_stem(rng)}.{('pdf', 'svg', 'png')[rng.integers(3)]}"
    case = Case(["compare", *words, "-o", output, mesh_name, *fields], outputs={output})
    if rng.random() < 0.03:  # matplotlib is then imported in the folder
        (folder / "matplotlibrc").write_bytes(damaged(rng, b"font.size: 99\ntext.usetex: True\n"))
        case.own_process = True
    return case


#: The function of each category, and how often it occurs.
CATEGORIES: dict[str, tuple[Callable[[Generator, Path], Case], int]] = {
    "shapes": (_shape_case, 10),
    "mesh-files": (_mesh_file_case, 10),
    "field-files": (_field_file_case, 10),
    "guides": (_guide_case, 10),
    "prescribed": (_prescribed_case, 10),
    "options": (_option_case, 10),
    "looks": (_look_case, 10),
    "tones": (_tone_case, 10),
    "textures": (_texture_case, 10),
    "paths": (_path_case, 5),
    "links": (_link_case, 5),
    "streams": (_stream_case, 2),
    "signals": (_signal_case, 1),
}
if find_spec("matplotlib"):
    CATEGORIES["names"] = (_name_case, 5)
if find_spec("pyvista"):
    CATEGORIES["simulations"] = (_simulation_case, 2)
