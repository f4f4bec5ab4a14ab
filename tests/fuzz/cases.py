"""The categories of cases: each makes files in a folder and returns a command line."""

from __future__ import annotations

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
from .meshes import WRITERS, Polygons, mesh_bytes, random_mesh
from .options import random_options


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
        SIGINT, as by Ctrl-C, or SIGKILL.
    own_process : bool
        Whether to start Python anew instead of forking, which takes ten times as long.
    """

    arguments: list[str]
    outputs: set[str] = field(default_factory=set)
    environment: dict[str, str] = field(default_factory=dict)
    stdout: str = "file"
    stop_after: float | None = None
    stop_signal: signal.Signals = signal.SIGINT
    own_process: bool = False

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
    """A texture for a UV map that may reach far, overlap, or have no area."""
    mesh = random_mesh(rng, faults=int(rng.random() < 0.3))
    inputs = [_write_mesh(rng, folder, mesh, ".obj")]
    if rng.random() < 0.5:  # few values, so that corners coincide
        data, scale = (folder / inputs[0]).read_bytes(), 10.0 ** rng.uniform(-6, 6)
        rows = [b"vt %.9g %.9g" % (scale * x, scale * y) for x, y in rng.random((9, 2))]
        lines = [
            rows[i % 9] if line[:2] == b"vt" else line for i, line in enumerate(data.split(b"\n"))
        ]
        (folder / inputs[0]).write_bytes(b"\n".join(lines))
    if rng.random() < 0.3:
        inputs.append(_write_field(rng, folder, mesh))
    leave_out = {"size", *({"generate", "degree"} if len(inputs) > 1 else ())}
    words = random_options(rng, "texture", rate=0.12, leave_out=leave_out)
    size = str(
        rng.choice([16, 32, 64, 200, 400, 8, 99999], p=[0.3, 0.3, 0.2, 0.1, 0.08, 0.01, 0.01])
    )
    words += ["--set", "ink=hatch"] * int(rng.random() < 0.5)
    output = "out.<UDIM>.png" if rng.random() < 0.2 else "out.png"
    outputs = {output, *(f"out.{number}.png" for number in range(1001, 2001))}
    return Case(["texture", *inputs, *words, "--size", size, "-o", output], outputs=outputs)


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
            case.stop_after = float(rng.uniform(0.0, 1.0))
            case.stop_signal = (signal.SIGINT, signal.SIGKILL)[rng.integers(2)]
    return case


#: The function of each category, and how often it occurs.
CATEGORIES: dict[str, tuple[Callable[[Generator, Path], Case], int]] = {
    "shapes": (_shape_case, 10),
    "mesh-files": (_mesh_file_case, 10),
    "field-files": (_field_file_case, 10),
    "guides": (_guide_case, 10),
    "options": (_option_case, 10),
    "looks": (_look_case, 10),
    "tones": (_tone_case, 10),
    "textures": (_texture_case, 10),
    "paths": (_path_case, 5),
    "streams": (_stream_case, 2),
}
if find_spec("pyvista"):
    CATEGORIES["simulations"] = (_simulation_case, 2)
