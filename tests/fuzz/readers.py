"""Fuzz the file readers guided by coverage: ``python -m tests.fuzz.readers .ply FOLDER -runs=1e5``.

FOLDER collects the inputs that reached new code; the options after it are those of libFuzzer. The
program ends with a traceback at the first error that is not a `RosyError`, and at the first warning.
It needs the package `atheris`; `make fuzz-readers` installs it.
"""

from __future__ import annotations

import sys
import tempfile
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import atheris
import numpy as np

with atheris.instrument_imports(include=["rosy_addon"]):
    from rosy_addon.core.errors import RosyError
    from rosy_addon.field.field_io import READ_SUFFIXES, load_field
    from rosy_addon.field.formats.plain import read_guide_strokes
    from rosy_addon.field.formats.sings import read_sings
    from rosy_addon.field.mesh_io import READERS
    from rosy_addon.field.surface import Surface, build_surface
    from rosy_addon.image_io.png import read_png
    from rosy_addon.preset_files.store import read_preset

from .field_files import field_bytes, guide_bytes
from .mesh_files import WRITERS, mesh_bytes
from .picture_files import png_bytes
from .preset_files import preset_bytes
from .shapes import random_mesh

#: Number of first inputs that are written to an empty folder.
SEED_COUNT = 60

#: A pyramid, the mesh of all field files.
PYRAMID = build_surface(
    np.array([[1, 1, 0], [-1, 1, 0], [-1, -1, 0], [1, -1, 0], [0, 0, 1.0]]),
    np.array([0, 1, 4, 1, 2, 4, 2, 3, 4, 3, 0, 4, 3, 2, 1, 0]),
    np.array([0, 3, 6, 9, 12, 16]),
)


def main() -> None:
    """Fuzz the reader of the file kind that the first argument names."""
    kind, folder, *options = sys.argv[1:]
    read, seed = _reader(kind), _seed_maker(kind)
    Path(folder).mkdir(parents=True, exist_ok=True)
    if not any(Path(folder).iterdir()):
        for number in range(SEED_COUNT):
            rng = np.random.default_rng(number)
            (Path(folder) / f"seed-{number}").write_bytes(seed(rng))
    warnings.simplefilter("error")
    path = Path(tempfile.mkdtemp(prefix="rosy-readers-")) / f"input{kind}"

    def run(data: bytes) -> None:
        path.write_bytes(data)
        try:
            read(path)
        except RosyError as error:
            if "\n" in str(error):
                raise AssertionError(f"not one line: {error}") from error

    atheris.Setup([sys.argv[0], str(folder), *options], run)
    atheris.Fuzz()


def _reader(kind: str) -> Callable[[Path], Any]:
    """Return the function that reads files of a kind: an extension, or "guides.txt"."""
    if kind in READERS:
        return Surface
    if kind in READ_SUFFIXES:
        return lambda path: load_field(path, PYRAMID)
    return {
        "guides.txt": read_guide_strokes,
        ".sings": read_sings,
        ".png": read_png,
        ".json": read_preset,
    }[kind]


def _seed_maker(kind: str) -> Callable[[np.random.Generator], bytes]:
    """Return a function that makes valid inputs."""
    faces = [(0, 1, 4), (1, 2, 4), (2, 3, 4), (3, 0, 4), (3, 2, 1, 0)]
    pyramid = (PYRAMID.vertices, faces)
    if kind in WRITERS:
        return lambda rng: mesh_bytes(rng, kind, random_mesh(rng, faults=0))
    return {
        "guides.txt": lambda rng: guide_bytes(rng, pyramid),
        ".png": png_bytes,
        ".json": preset_bytes,
    }.get(kind, lambda rng: field_bytes(rng, kind, pyramid))


if __name__ == "__main__":
    main()
