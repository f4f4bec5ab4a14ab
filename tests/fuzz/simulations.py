"""Write files of simulations, damaged, and with references to other files that are hostile."""

import contextlib
import io
import json
import os
import re
import struct
from collections.abc import Callable
from pathlib import Path
from typing import Any

import meshio
import numpy as np
import pyvista as pv
import trimesh
from numpy.random import Generator

from ..extras.simulation_files import collection_text, parts_text, write_exodus
from .damage import damaged
from .meshes import random_mesh

#: Files that a reference may name instead of one of the series or mesh.
TARGETS = ("pipe", "zero", "/dev/zero", "loop", "folder", "none.vtu", "/proc/self/mem", "x" * 5000)

_ARRAY = 'type="Float64" Name="v"'


def write_simulation(rng: Generator, folder: Path) -> str:
    """Write a file of a random format with the files that it names, most of them hostile. Return its name."""
    suffix = list(_WRITERS)[rng.integers(len(_WRITERS))]
    path = folder / f"flow{suffix}"
    points, faces = random_mesh(rng, faults=0)
    surface = pv.PolyData.from_irregular_faces(points, faces)
    surface.point_data["v"] = rng.normal(size=points.shape)
    surface.cell_data["c"] = np.arange(len(faces))
    with contextlib.chdir(folder), contextlib.redirect_stderr(io.StringIO()):
        # meshio puts .h5 files into the current folder, and VTK writes the path into the file.
        _WRITERS[suffix](rng, Path(path.name), surface)
    others = sorted({other for other in folder.rglob("*") if other.is_file()} - {path})
    os.mkfifo(folder / "pipe")
    (folder / "zero").symlink_to("/dev/zero")
    (folder / "loop").symlink_to("loop")
    (folder / "folder").mkdir()
    names = [other.name.encode() for other in others]
    data = re.sub(
        rb"Array 0x\w+", b"Array", path.read_bytes()
    )  # an address, which differs in each run
    path.write_bytes(data)
    if rng.random() < 0.4:
        target = (*TARGETS, path.name, *map(os.fsdecode, names))[rng.integers(8 + 1 + len(names))]
        path.write_bytes(_with_reference(rng, suffix, data, target, names))
    if rng.random() < 0.6:
        changed = (path, *others)[rng.integers(1 + len(others))]
        fault = _with_other_length if rng.random() < 0.5 else damaged
        changed.write_bytes(fault(rng, changed.read_bytes()))
    return path.name


def _with_reference(
    rng: Generator, suffix: str, data: bytes, target: str, names: list[bytes]
) -> bytes:
    """Replace the name of a file by another one, or include this one."""
    new = target.encode()
    found = [name for name in names if name in data]
    if found and rng.random() < 0.8:
        return data.replace(found[rng.integers(len(found))], new)
    if suffix == ".inp":
        return data + b"*INCLUDE, INPUT=" + new + b"\n"
    include = b'<xi:include xmlns:xi="http://www.w3.org/2001/XInclude" href="%s"/>' % new
    include = (include, include.replace(b"/>", b' parse="text"/>'))[rng.integers(2)]
    ends = [match.start() for match in re.finditer(rb"</?\w", data)] or [0]
    end = ends[rng.integers(len(ends))]
    return data[:end] + include + data[end:]


def _with_other_length(rng: Generator, data: bytes) -> bytes:
    """Replace a number, as text or as four or eight bytes, by an extreme one."""
    value = int(rng.choice([0, 1, 3, 255, 10**5, 10**9, 2**31 - 1, 2**32 - 1, 2**62, 2**63 - 1]))
    value *= int(rng.choice([1, 1, -1]))
    numbers = list(re.finditer(rb"\b\d+\b", data[:5000]))
    if numbers and rng.random() < 0.6:
        start, end = numbers[rng.integers(len(numbers))].span()
        return data[:start] + str(value).encode() + data[end:]
    size = int(rng.choice([4, 8]))
    start = int(rng.integers(max(len(data) // 4, 1))) * 4
    new = struct.pack("<q", value)[:size]
    return data[:start] + (new if rng.random() < 0.8 else new[::-1]) + data[start + size :]


def _triangles(surface: pv.PolyData) -> meshio.Mesh:
    mesh = surface.triangulate()
    arrays = {"v": np.asarray(mesh.point_data["v"])}
    points = np.asarray(mesh.points, dtype=np.float64)
    return meshio.Mesh(points, [("triangle", mesh.regular_faces)], arrays)


def _save(rng: Generator, path: Path, mesh: Any) -> None:
    mesh.save(path, binary=bool(rng.random() < 0.5))


def _save_grid(rng: Generator, path: Path, surface: pv.PolyData) -> None:
    _save(rng, path, surface.cast_to_unstructured_grid())


def _save_structured(rng: Generator, path: Path, _: pv.PolyData) -> None:
    sizes = tuple(int(size) for size in rng.integers(1, 6, 3))
    image = pv.ImageData(dimensions=sizes)
    image.point_data["v"] = rng.normal(size=(image.n_points, 3))
    casts = {".vts": image.cast_to_structured_grid, ".vtr": image.cast_to_rectilinear_grid}
    _save(rng, path, casts.get(path.suffix, lambda: image)())


def _save_listed(text: str) -> Callable[[Generator, Path, pv.PolyData], None]:
    """Return a function that saves two parts, and a text that names them."""

    def save(rng: Generator, path: Path, surface: pv.PolyData) -> None:
        for name in ("0.vtu", "1.vtu"):
            _save_grid(rng, path.with_name(name), surface)
        path.write_text(text)

    return save


def _save_series(rng: Generator, path: Path, surface: pv.PolyData) -> None:
    times = [0, (1, 1.5, "2", int("9" * 400), 1e999, None, -1)[rng.integers(7)]]
    files = [{"name": f"{number}.vtu", "time": time} for number, time in enumerate(times)]
    _save_listed(json.dumps({"file-series-version": "1.0", "files": files}))(rng, path, surface)


def _save_gltf(_: Generator, path: Path, surface: pv.PolyData) -> None:
    mesh = surface.triangulate()
    trimesh.Trimesh(mesh.points, mesh.regular_faces, process=False).export(path)


def _save_xdmf(rng: Generator, path: Path, surface: pv.PolyData) -> None:
    kind = ("XML", "HDF", "Binary")[rng.integers(3)]
    mesh = _triangles(surface)
    if rng.random() < 0.5:
        meshio.write(path, mesh, data_format=kind)
        return
    with meshio.xdmf.TimeSeriesWriter(path, data_format=kind) as writer:
        writer.write_points_cells(mesh.points, mesh.cells)
        for time in range(2):
            writer.write_data(float(time), point_data=mesh.point_data)


def _save_exodus(rng: Generator, path: Path, _: pv.PolyData) -> None:
    points = rng.normal(size=(8, 3))
    write_exodus(path, points, np.arange(8).reshape(2, 4), [0.0, 1.0], rng.normal(size=(2, 8, 3)))


def _save_gmsh(rng: Generator, path: Path, surface: pv.PolyData) -> None:
    file_format = ("gmsh", "gmsh22")[rng.integers(2)]
    meshio.write(path, _triangles(surface), file_format)


_WRITERS: dict[str, Callable[[Generator, Path, pv.PolyData], None]] = {
    ".vtk": _save,
    ".vtp": _save,
    ".vtu": _save_grid,
    ".vti": _save_structured,
    ".vts": _save_structured,
    ".vtr": _save_structured,
    ".vtm": lambda rng, path, surface: _save(rng, path, pv.MultiBlock([surface, surface])),
    ".pvtu": _save_listed(parts_text(_ARRAY)),
    ".pvtp": _save_listed(parts_text(_ARRAY, "PolyData")),
    ".pvd": _save_listed(collection_text((0, "0.vtu"), (1, "1.vtu"))),
    ".series": _save_series,
    ".xdmf": _save_xdmf,
    ".exo": _save_exodus,
    ".msh": _save_gmsh,
    ".med": lambda _, path, surface: meshio.write(path, _triangles(surface)),
    ".inp": lambda _, path, surface: meshio.write(path, _triangles(surface)),
    ".mesh": lambda _, path, surface: meshio.write(path, _triangles(surface)),
    ".gltf": _save_gltf,
}
