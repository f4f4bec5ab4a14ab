"""Links at the paths of outputs: to inputs, to other files, to folders, to nothing, and to themselves."""

import os
from pathlib import Path

import numpy as np
from numpy.random import Generator

from ..unit.awkward import cube
from .meshes import mesh_bytes, random_mesh, with_texture_rows

#: Commands with options, the suffixes of their outputs, and how often they occur.
COMMANDS = {
    "render": ("field.txt --preset mine.json --size 24x24", ".png", 0.1),
    "strokes": ("field.txt --size 40x40", ".svg .ply .obj .csv", 0.15),
    "field": ("field.txt", ".rosy .rawfield .txt .npy .obj .sings .npz .vtp .vtu .ply", 0.2),
    "turntable": ("field.txt --preset mine.json --size 16x16 --pictures 2", ".gif", 0.05),
    "film": ("field.txt field.txt --preset mine.json --size 16x16", ".gif", 0.05),
    "compare": ("A=field.txt form --preset mine.json", ".svg .pdf .png", 0.1),
    "texture": ("field.txt --preset mine.json --size 32", ".png", 0.35),
}

#: Inputs that all commands read if they exist.
ALWAYS_READ = ("mesh.obj", "field.obj", "field.txt")

#: A file that no command may change.
OTHER = "elsewhere/other"


def link_case(rng: Generator, folder: Path) -> tuple[list[str], set[str]]:
    """Write the inputs of a command and the links. Return the arguments, and what may be written."""
    command = str(rng.choice(list(COMMANDS), p=[share for _, _, share in COMMANDS.values()]))
    options, suffixes, _ = COMMANDS[command]
    inputs = [
        name for name in _write_inputs(rng, folder) if name in (*options.split(), *ALWAYS_READ)
    ]
    words = [command, "mesh.obj", *options.split(), "--off-surface", "project", "--degree", "2"]
    (folder / OTHER).parent.mkdir()
    (folder / OTHER).write_bytes(b"the contents of another file")
    if command == "texture" and rng.random() < 0.8:
        _make_tiles(rng, folder, inputs)
        return [*words, "-o", "out.<UDIM>.png"], {f"out.{n}.png" for n in range(1001, 2001)}
    name, kind, outputs = f"out{rng.choice(suffixes.split())}", rng.random(), set()
    if kind < 0.1:
        os.link(folder / _one_of(rng, inputs), folder / name)
    elif kind < 0.3:
        (folder / "folder").symlink_to("elsewhere")
        if rng.random() < 0.5:
            outputs = {f"elsewhere/{name}"}
        else:
            (folder / "elsewhere" / name).symlink_to(f"../{_one_of(rng, inputs)}")
        name = f"folder/{name}"
    else:
        outputs = {_make_link(rng, folder, name, inputs)} & {OTHER, "elsewhere/missing"}
    return [*words, "-o", name], outputs


def _one_of(rng: Generator, names: list[str]) -> str:
    return names[rng.integers(len(names))]


def _write_inputs(rng: Generator, folder: Path) -> list[str]:
    """Write a mesh, a field, sometimes the mesh from which it is transferred, and a preset.

    Return the names of all.
    """
    points, faces = random_mesh(rng, faults=0)
    contents = {"field.txt": b""}
    if rng.random() < 0.3:
        points, faces = np.array(cube()[0]), cube()[1]
        contents["field.obj"] = mesh_bytes(rng, ".obj", (points, faces))
    rows = rng.normal(size=(len(faces), 3)).tolist()
    contents["field.txt"] = b"".join(b"%.3f %.3f %.3f\n" % tuple(row) for row in rows)
    if "field.obj" in contents:  # the same shape, but other faces
        faces = [faces[0][:3], (faces[0][0], *faces[0][2:]), *faces[1:]]
    contents["mesh.obj"] = mesh_bytes(rng, ".obj", (points, faces))
    contents["mine.json"] = b'{"name": "Mine", "description": "", "look": {"length": 20}}'
    for name, data in contents.items():
        (folder / name).write_bytes(data)
    return list(contents)


def _make_link(rng: Generator, folder: Path, name: str, inputs: list[str]) -> str:
    """Make a link, or a link to a link, and return what it leads to."""
    targets = [OTHER, "elsewhere/missing", "elsewhere", "nowhere/missing", name]
    target = first = _one_of(rng, [*targets, OTHER, "elsewhere/missing", *inputs])
    if rng.random() < 0.3:
        first = f"to-{name}"
        (folder / first).symlink_to(target)
    (folder / name).symlink_to(first)
    return target


def _make_tiles(rng: Generator, folder: Path, inputs: list[str]) -> None:
    """Spread the UV map over a few tiles. Make links, folders, pipes and files of their names."""
    mesh = folder / "mesh.obj"
    mesh.write_bytes(with_texture_rows(mesh.read_bytes(), 2 * rng.random((9, 2))))
    for number in (1001, 1002, 1011, 1012):
        name, kind = f"out.{number}.png", rng.random()
        if kind < 0.5:
            _make_link(rng, folder, name, inputs)
        elif kind < 0.55:
            (folder / name).mkdir()
        elif kind < 0.6:
            os.mkfifo(folder / name)
        elif kind < 0.8:
            (folder / name).write_bytes(b"the previous contents")
