"""What docs/reliability.md and SECURITY.md promise about all files: whole, the same everywhere, and never code."""

import io
import pickle
import shutil
import sys

import numpy as np
import pytest
from command_helpers import python, refusal, write_obj
from shapes import grid_of_quads

from rosy_addon.extras.command_line import main

#: The outputs of each command, for which no other program is needed.
WRITTEN = {
    "field": ("a.rosy", "a.rawfield", "a.npy", "a.npz", "a.obj", "a.ply", "a.vtp", "a.vtu"),
    "strokes": ("b.svg", "b.ply", "b.obj", "b.csv"),
    "render": ("c.png",),
    "texture": ("d.png",),
    "turntable": ("e.gif",),
}

#: Options that make files of a few kilobytes.
OPTIONS = {
    "field": "--generate uv",
    "strokes": "--generate uv --size 100x100",
    "render": "--generate uv --size 80x80",
    "texture": "--generate uv --size 64",
    "turntable": "--generate uv --size 64x64 --pictures 2",
}

#: Runs commands while no file may get larger than 2,000 bytes, and prints their statuses.
LIMITED = """
import resource, sys
from rosy_addon.extras.command_line import main
resource.setrlimit(resource.RLIMIT_FSIZE, (2000, 2000))
for line in sys.argv[1:]:
    print(main(line.split()), flush=True)
"""


def write_grid(path) -> None:
    """Write a grid of 14 x 14 quads with a UV map."""
    quads, _ = grid_of_quads(14, 14, False, False)
    u, v = np.divmod(np.arange(225), 15)
    write_obj(path, np.stack([u, v, 0.1 * u * v], axis=1), quads, np.stack([u, v], axis=1) / 14)


def command_lines(folder):
    """Return the words of a command for each output in a folder, by the name of the output."""
    return {
        name: f"{command} {folder}/grid.obj {OPTIONS[command]} -o {folder}/{name}"
        for command, names in WRITTEN.items()
        for name in names
    }


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="the limit is a limit of Linux")
def test_a_full_disk_leaves_all_files_as_they_were(tmp_path):
    write_grid(tmp_path / "grid.obj")
    lines = command_lines(tmp_path)
    for name in lines:
        (tmp_path / name).write_text("old")
    done = python("-c", LIMITED, *lines.values())
    statuses = [line for line in done.stdout.splitlines() if line.isdecimal()]
    assert statuses == ["2"] * len(lines), done.stderr
    errors = [line for line in done.stderr.splitlines() if "file too large" in line]
    assert len(errors) == len(lines) and "Traceback" not in done.stderr
    for name, error in zip(lines, errors, strict=True):
        assert f"{name}: cannot be written: file too large" in error
        assert (tmp_path / name).read_text() == "old"
    assert len(list(tmp_path.iterdir())) == 1 + len(lines)


@pytest.mark.slow
def test_files_have_the_same_bytes_in_every_folder(tmp_path, monkeypatch):
    folders = tmp_path / "one", tmp_path / "a longer name" / "two"
    contents = []
    for folder in folders:
        folder.mkdir(parents=True)
        write_grid(folder / "grid.obj")
        monkeypatch.chdir(folder)
        for line in command_lines(".").values():
            assert main(line.split()) == 0
        contents.append({path.name: path.read_bytes() for path in folder.iterdir()})
        shutil.rmtree(folder)
    assert contents[0] == contents[1]


class Hostile:
    """An object whose pickle makes a file when it is read."""

    def __init__(self, path) -> None:
        self.path = path

    def __reduce__(self):
        return open, (str(self.path), "w")


@pytest.mark.parametrize("suffix", [".npy", ".npz"])
def test_arrays_are_read_without_pickles(suffix, sphere, tmp_path):
    rows, data = np.empty(1, dtype=object), io.BytesIO()
    rows[0] = Hostile(tmp_path / "ran")
    if suffix == ".npy":
        np.save(data, rows, allow_pickle=True)
    else:
        np.savez(data, Q=rows)
    path = tmp_path / f"field{suffix}"
    path.write_bytes(data.getvalue())
    assert refusal("info", sphere, path).startswith(f"rosy: {path}")
    path.write_bytes(pickle.dumps(rows[0]))
    refusal("info", sphere, path)
    assert not (tmp_path / "ran").exists()
    np.load(io.BytesIO(data.getvalue()), allow_pickle=True)["Q" if suffix == ".npz" else ...]
    assert (tmp_path / "ran").exists()
