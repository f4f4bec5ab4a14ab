"""The categories of cases: each makes files in a folder and returns a command line."""

from __future__ import annotations

import importlib.util
import os
import pickle
import resource
import signal
import stat
import traceback
import zlib
from collections.abc import Callable
from dataclasses import dataclass, field
from hashlib import sha256
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.random import Generator

from .damage import WORDS, damaged
from .field_files import SUFFIXES as FIELD_SUFFIXES
from .field_files import field_bytes, guide_bytes
from .mesh_files import WRITERS, mesh_bytes
from .options import random_options
from .picture_files import png_bytes
from .preset_files import preset_bytes
from .shapes import Polygons, random_mesh

#: Seconds of processor time in which Blender has to make the scene of a case.
MAKING_LIMIT = 60


class SlowSceneError(Exception):
    """Blender alone takes too long to make a scene."""


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
    expected : dict of str to str
        Hashes of all files that the outputs consist of after a run that was not killed.
    environment : dict of str to str
        Changed variables of the environment.
    stdout : str
        What standard output is: "file", "closed" (a pipe without a reader) or "full" (/dev/full).
    interrupt_after : float, optional
        Seconds after which the run is interrupted as by Ctrl-C.
    kill_after : float, optional
        Seconds after which the run is killed. If files are expected, it is then started again.
    kill_when_writing : bool
        Whether the run is killed when it begins to write a file.
    own_process : bool
        Whether to start Python anew instead of forking, which takes ten times as long.
    """

    arguments: list[str]
    outputs: set[str] = field(default_factory=set)
    expected: dict[str, str] = field(default_factory=dict)
    environment: dict[str, str] = field(default_factory=dict)
    stdout: str = "file"
    interrupt_after: float | None = None
    kill_after: float | None = None
    kill_when_writing: bool = False
    own_process: bool = False

    @property
    def is_stopped(self) -> bool:
        """Whether the run ends at a moment that differs from one run to the next."""
        is_timed = self.interrupt_after is not None or self.kill_after is not None
        return is_timed or self.kill_when_writing

    def may_write(self, name: str) -> bool:
        """Whether the run may write a file."""
        folders = (output for output in self.outputs if output.endswith("/"))
        return name in self.outputs or f"{name}/" in self.outputs or name.startswith(tuple(folders))


class Category(NamedTuple):
    """A kind of cases.

    Attributes
    ----------
    make : callable
        Writes the files of a case to a folder, and returns the case.
    share : int
        How often it occurs, relative to the others.
    """

    make: Callable[[Generator, Path], Case]
    share: int = 10


def hash_file(path: Path) -> str:
    """Return the hash of the contents of a file."""
    return sha256(path.read_bytes()).hexdigest()


def make_case(category: str, seed: int, folder: Path) -> Case:
    """Write the files of a case to an empty folder, and return the case.

    Parameters
    ----------
    category : str
        A key of `CATEGORIES`.
    seed : int
    folder : Path

    Raises
    ------
    SlowSceneError
    """
    rng = np.random.default_rng([zlib.crc32(category.encode()), seed])
    return CATEGORIES[category].make(rng, folder)


#: Commands for mesh files, with the extension of their output.
_OUTPUTS = {"render": ".png", "strokes": "", "field": "", "info": "", "turntable": ".gif"}
_STROKE_OUTPUTS = (".svg", ".svg", ".ply", ".obj", ".csv")
_FIELD_OUTPUTS = (".rosy", ".rawfield", ".txt", ".npy", ".obj", ".sings")


def _write_mesh(rng: Generator, folder: Path, mesh: Polygons, name: str = "mesh") -> str:
    suffix = list(WRITERS)[rng.integers(len(WRITERS))]
    (folder / (name + suffix)).write_bytes(mesh_bytes(rng, suffix, mesh))
    return name + suffix


def _write_field(rng: Generator, folder: Path, mesh: Polygons, name: str = "field") -> str:
    suffix = FIELD_SUFFIXES[rng.choice(5, p=[0.3, 0.3, 0.15, 0.2, 0.05])]
    (folder / (name + suffix)).write_bytes(field_bytes(rng, suffix, mesh))
    return name + suffix


def _command(
    rng: Generator, folder: Path, inputs: list[str], options: list[str] | None = None, **chosen
) -> Case:
    """Return a case of a random command with random options, small pictures, and an output."""
    command = chosen.get("command") or str(
        rng.choice(list(_OUTPUTS), p=[0.36, 0.26, 0.18, 0.17, 0.03])
    )
    # A field file rules out a generator, and has a degree.
    leave_out = {"generate", "degree"} if len(inputs) > 1 and rng.random() < 0.95 else set()
    words = random_options(rng, command, rate=chosen.get("rate", 0.12), leave_out=leave_out)
    case = Case([command, *inputs, *words, *(options or [])])
    sized = _has(words + (options or []), "--size")
    if command in ("render", "strokes", "turntable") and not sized:
        case.arguments += ["--size", f"{rng.integers(8, 90)}x{rng.integers(8, 90)}"]
    if command == "turntable" and not _has(words, "--pictures"):
        case.arguments += ["--pictures", "2"]
    if command == "info":
        case.arguments += ["--json"] * int(rng.random() < 0.5)
        return case
    others = _STROKE_OUTPUTS if command == "strokes" else _FIELD_OUTPUTS
    suffix = _OUTPUTS[command] or str(rng.choice(others))
    output = "out" + suffix
    case.arguments += ["-o", output]
    case.outputs.add(output)
    if rng.random() < 0.1:
        (folder / output).write_bytes(b"the previous contents")
    return case


def _has(words: list[str], option: str) -> bool:
    return any(word.split("=")[0] == option for word in words)


def _shape_case(rng: Generator, folder: Path) -> Case:
    """An odd shape in an undamaged file, with a generated field."""
    mesh = random_mesh(rng)
    return _command(rng, folder, [_write_mesh(rng, folder, mesh)])


def _mesh_file_case(rng: Generator, folder: Path) -> Case:
    """A damaged mesh file."""
    mesh = random_mesh(rng, faults=0)
    name = _write_mesh(rng, folder, mesh)
    path = folder / name
    path.write_bytes(damaged(rng, path.read_bytes()))
    if rng.random() < 0.05:  # another format than the name says
        name = "mesh" + list(WRITERS)[rng.integers(len(WRITERS))]
        path.rename(folder / name)
    command = "info" if rng.random() < 0.5 else None
    return _command(rng, folder, [name], command=command, rate=0.03)


def _field_file_case(rng: Generator, folder: Path) -> Case:
    """A field file, damaged in half of all cases."""
    mesh = random_mesh(rng, faults=int(rng.random() < 0.3))
    name, field_name = _write_mesh(rng, folder, mesh), _write_field(rng, folder, mesh)
    path = folder / field_name
    if rng.random() < 0.5:
        path.write_bytes(damaged(rng, path.read_bytes()))
    options = ["--undefined"] * int(rng.random() < 0.3)
    if rng.random() < 0.1:
        other = random_mesh(rng, faults=0) if rng.random() < 0.3 else mesh
        options += ["--field-mesh", _write_mesh(rng, folder, other, "field_mesh")]
    case = _command(rng, folder, [name, field_name], options, rate=0.08)
    if case.arguments[0] == "info" and rng.random() < 0.4:
        case.arguments += ["--against", _write_field(rng, folder, mesh, "other")]
    return case


def _guide_case(rng: Generator, folder: Path) -> Case:
    """A field guided by strokes, another field or a UV map, or by its singularities."""
    mesh = random_mesh(rng, faults=int(rng.random() < 0.3))
    name, options = _write_mesh(rng, folder, mesh), ["--generate", "guided"]
    if rng.random() < 0.3:
        data = field_bytes(rng, ".sings", mesh)
        (folder / "a.sings").write_bytes(damaged(rng, data) if rng.random() < 0.2 else data)
        options = ["--generate", "prescribed"] * int(rng.random() < 0.7)
        options += ["--singularities", "a.sings"]
        return _command(rng, folder, [name], options, rate=0.06)
    if rng.random() < 0.9:
        data = guide_bytes(rng, mesh)
        (folder / "guides.txt").write_bytes(damaged(rng, data) if rng.random() < 0.4 else data)
        options += ["--strokes", "guides.txt"]
    if rng.random() < 0.2:
        options += ["--guides", _write_field(rng, folder, mesh)]
    if name.endswith(".obj") and rng.random() < 0.4:
        options += ["--uv"]
    return _command(rng, folder, [name], options, rate=0.06)


def _option_case(rng: Generator, folder: Path) -> Case:
    """Many options, some of them without sense, on an undamaged mesh."""
    mesh = random_mesh(rng, faults=0)
    name = _write_mesh(rng, folder, mesh)
    case = _command(rng, folder, [name], rate=0.3)
    kind = rng.random()
    if kind < 0.1:
        position = rng.integers(len(case.arguments) + 1)
        case.arguments.insert(position, WORDS[rng.integers(len(WORDS))].replace("\0", ""))
    elif kind < 0.15:
        del case.arguments[rng.integers(len(case.arguments))]
    return case


def _look_case(rng: Generator, folder: Path) -> Case:
    """A preset file, and settings at the ends of their ranges."""
    mesh = random_mesh(rng, faults=int(rng.random() < 0.1))
    inputs = [_write_mesh(rng, folder, mesh)]
    if rng.random() < 0.4:
        inputs.append(_write_field(rng, folder, mesh))
    options = []
    if rng.random() < 0.6:
        data = preset_bytes(rng)
        (folder / "mine.json").write_bytes(damaged(rng, data) if rng.random() < 0.2 else data)
        options += ["--preset", "mine.json"]
    if rng.random() < 0.05:
        case = Case(["presets", *["--json"] * int(rng.random() < 0.5)])
        if options:
            case.environment["ROSY_PRESETS"] = "."
        return case
    return _command(rng, folder, inputs, options, command="render", rate=0.25)


def _tone_case(rng: Generator, folder: Path) -> Case:
    """A tone from an image, a picture or an attribute, and colors from an attribute."""
    mesh = random_mesh(rng, faults=0)
    kind = ("image", "picture", "attribute")[rng.integers(3)]
    suffix = {"image": ".obj", "picture": "", "attribute": ".ply"}[kind]
    suffix = suffix if suffix and rng.random() < 0.95 else list(WRITERS)[rng.integers(4)]
    name = "mesh" + suffix
    (folder / name).write_bytes(mesh_bytes(rng, suffix, mesh))
    options = [f"--tone-{kind}"]
    if kind == "attribute":
        options.append(("Color", "Color", "red", "x", "", "\x1b[31m", "green")[rng.integers(7)])
    else:
        width, height = (int(side) for side in rng.integers(1, 50, 2))
        fits = kind == "picture" and rng.random() < 0.8
        data = png_bytes(rng, (width, height) if fits else None)
        (folder / "tone.png").write_bytes(damaged(rng, data) if rng.random() < 0.15 else data)
        options += ["tone.png", *([f"--size={width}x{height}"] if fits else [])]
    if rng.random() < 0.3:
        options.append(f"--color-values={('red', 'x', 'quality', '')[rng.integers(4)]}")
    command = "turntable" if kind != "picture" and rng.random() < 0.1 else "render"
    return _command(rng, folder, [name], options, command=command, rate=0.06)


def _texture_case(rng: Generator, folder: Path) -> Case:
    """A texture for a UV map that may reach far, overlap, or have no area."""
    mesh = random_mesh(rng, faults=int(rng.random() < 0.3))
    suffix = ".obj" if rng.random() < 0.95 else list(WRITERS)[rng.integers(4)]
    data = mesh_bytes(rng, suffix, mesh)
    if rng.random() < 0.5:
        scale, offset = 10.0 ** rng.uniform(-6, 6), rng.normal(0, 3, 2) * (rng.random() < 0.5)
        u, v = scale * rng.random(2) * (rng.random(2) < 0.9)
        words = (
            b"vt %.9g %.9g" % (u * x + offset[0], v * y + offset[1]) for x, y in rng.random((9, 2))
        )
        lines = [next(words, line) if line[:2] == b"vt" else line for line in data.split(b"\n")]
        data = b"\n".join(lines)
    (folder / f"mesh{suffix}").write_bytes(data)
    inputs = [f"mesh{suffix}"]
    if rng.random() < 0.3:
        inputs.append(_write_field(rng, folder, mesh))
    size = str(
        rng.choice([16, 32, 64, 200, 400, 8, 99999], p=[0.3, 0.3, 0.2, 0.1, 0.08, 0.01, 0.01])
    )
    leave_out = {"size", *({"generate", "degree"} if len(inputs) > 1 else ())}
    words = random_options(rng, "texture", rate=0.12, leave_out=leave_out)
    if rng.random() < 0.5:
        words += ["--set", "ink=hatch"]
    output = "out.<UDIM>.png" if rng.random() < 0.2 else "out.png"
    outputs = {output, *(f"out.{number}.png" for number in range(1001, 2001))}
    return Case(["texture", *inputs, *words, "--size", size, "-o", output], outputs=outputs)


def _comparison_case(rng: Generator, folder: Path) -> Case:
    """Field files and generated fields side by side, as a table and as a figure."""
    mesh = random_mesh(rng, faults=int(rng.random() < 0.3))
    words = ["compare", _write_mesh(rng, folder, mesh)]
    for number in range(rng.integers(1, 4)):
        source = ("form", "smoothest", "curvature", "features", "uv")[rng.integers(5)]
        if rng.random() < 0.4:
            source = _write_field(rng, folder, mesh, f"field{number}")
        words.append(
            f"{('a', 'b=', '$', '')[rng.integers(4)]}={source}" if rng.random() < 0.3 else source
        )
    words += random_options(rng, "compare", rate=0.12)
    case = Case(words)
    if rng.random() < 0.5:
        output = "out" + (".pdf", ".svg", ".png", ".gif")[rng.choice(4, p=[0.4, 0.3, 0.28, 0.02])]
        case.arguments += ["-o", output, *([] if _has(words, "--dpi") else ["--dpi", "40"])]
        case.outputs.add(output)
    return case


def _path_case(rng: Generator, folder: Path) -> Case:
    """Paths that are not plain files, too long, linked, odd, or the input itself."""
    mesh = random_mesh(rng, faults=0)
    name = _write_mesh(rng, folder, mesh)
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
    mesh = random_mesh(rng, faults=int(rng.random() < 0.2))
    name = _write_mesh(rng, folder, mesh)
    case = Case(["presets"]) if rng.random() < 0.2 else _command(rng, folder, [name], rate=0.02)
    case.own_process = True
    match rng.integers(6):
        case 0:
            case.stdout = "closed"
        case 1:
            case.stdout = "full"
        case 2:
            case.environment |= {"PYTHONIOENCODING": "ascii", "LC_ALL": "C"}
        case 3 | 4:
            case.interrupt_after = float(rng.uniform(0.0, 0.6))
        case 5:
            case.kill_after = float(rng.uniform(0.05, 0.6))
    return case


def _from_scenes(name: str) -> Callable[[Generator, Path], Case]:
    """Return a function that makes a case with a function of the module `scenes`.

    It does so in a fork of this process: Blender starts threads when it works, and later forks, in
    which the cases run, must not come from a process with threads.
    """

    def make(rng: Generator, folder: Path) -> Case:
        from . import scenes

        result = folder.with_suffix(".case")
        pid = os.fork()
        if pid == 0:
            try:
                resource.setrlimit(resource.RLIMIT_CPU, (MAKING_LIMIT, MAKING_LIMIT))
                case = getattr(scenes, name)(rng, folder)
                result.write_bytes(pickle.dumps(case))
            except BaseException:
                traceback.print_exc()
            finally:
                os._exit(0)
        status = os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1])
        if status in (-signal.SIGXCPU, -signal.SIGKILL):
            raise SlowSceneError
        return pickle.loads(result.read_bytes())

    return make


def _kill_case(rng: Generator, folder: Path) -> Case:
    """A run that replaces a file and is killed at a random moment, or while it writes."""
    mesh = random_mesh(rng, faults=0)
    name = _write_mesh(rng, folder, mesh)
    command = str(rng.choice(["render", "strokes", "field", "turntable"], p=[0.4, 0.3, 0.2, 0.1]))
    options = ["--size", "500x500"] if command != "field" else []
    case = _command(rng, folder, [name], options, command=command, rate=0.01)
    for output in case.outputs:
        (folder / output).write_bytes(b"the previous contents")
    case.own_process = True
    if rng.random() < 0.3:
        case.kill_when_writing = True
    else:
        case.kill_after = float(rng.uniform(0.1, 1.5))
    return case


#: All categories by name. Those of Blender files need Python with `bpy`.
CATEGORIES = {
    "shapes": Category(_shape_case),
    "mesh-files": Category(_mesh_file_case),
    "field-files": Category(_field_file_case),
    "guides": Category(_guide_case),
    "options": Category(_option_case),
    "looks": Category(_look_case),
    "tones": Category(_tone_case),
    "textures": Category(_texture_case),
    "comparisons": Category(_comparison_case),
    "paths": Category(_path_case, share=5),
    "streams": Category(_stream_case, share=1),
    "kills": Category(_kill_case, share=1),
}
if importlib.util.find_spec("bpy") is not None:
    # A case with Blender takes as long as twenty others.
    CATEGORIES |= {
        "scenes": Category(_from_scenes("scene_case"), share=3),
        "animations": Category(_from_scenes("animation_case"), share=1),
        "scene-kills": Category(_from_scenes("scene_kill_case"), share=1),
    }
