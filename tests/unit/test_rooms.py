"""Imports run one way, also inside rooms, and the numpy rooms import without Blender."""

from __future__ import annotations

import ast
import subprocess
import sys
from collections.abc import Iterator
from graphlib import TopologicalSorter
from pathlib import Path

import pytest
from conftest import ROOT

PACKAGE = ROOT / "rosy_addon"

#: A room imports only from the layers above it, and from no other room of its layer.
LAYERS = (
    ("core",),
    ("field", "image_io"),
    ("projection",),
    ("annotation",),
    ("compositor", "line_drawing"),
    ("surface_texture", "worker", "preset_files"),
    ("rendering",),
    ("gpu", "scene", "external"),
    ("jobs", "viewport", "api"),
    ("ui",),
    ("cli",),
    ("extras",),
    ("__main__", "__init__"),
)

#: Rooms that may use Blender everywhere. Of the others, only the commands of `extras` import them.
BLENDER_ROOMS = {"scene", "ui", "jobs", "viewport", "cli"}

#: Files of the room `gpu` that draw with Blender, and may import its modules.
BLENDER_GPU_FILES = ("device.py",)

#: What the Python package can use where it is installed.
EXTRA_LIBRARIES = {
    *("distributed", "h5py", "imageio_ffmpeg", "matplotlib", "meshio", "pyvista", "vtkmodules")
}
FILES = sorted(PACKAGE.rglob("*.py"))


def room_of(path: Path) -> str:
    return path.relative_to(PACKAGE).with_suffix("").parts[0]


def imports_of(path: Path) -> tuple[set[str], set[str]]:
    """Imported modules: dotted paths of those in RoSy, and top-level names of all others."""
    package_parts = path.relative_to(PACKAGE).parent.parts
    inside, outside = set(), set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            outside |= {alias.name.split(".")[0] for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.level == 0:
            outside.add(node.module.split(".")[0])
        elif isinstance(node, ast.ImportFrom):
            assert node.level <= len(package_parts) + 1, f"{path} reaches out of the package"
            base = package_parts[: len(package_parts) - node.level + 1]
            names = [node.module] if node.module else [alias.name for alias in node.names]
            inside |= {".".join((*base, name)) for name in names}
    return inside, outside


@pytest.mark.parametrize("path", FILES, ids=lambda path: str(path.relative_to(PACKAGE)))
def test_imports_run_one_way(path):
    inside, outside = imports_of(path)
    room = room_of(path)
    (layer,) = (number for number, rooms in enumerate(LAYERS) if room in rooms)
    above = {each for rooms in LAYERS[:layer] for each in rooms}
    rooms = {name.split(".")[0] for name in inside} - {room}
    assert rooms <= above
    allowed = set(sys.stdlib_module_names) | {"numpy"}
    if room in BLENDER_ROOMS:
        allowed |= {"bpy", "bmesh", "bpy_extras", "mathutils", "gpu", "gpu_extras", "blf"}
    elif room != "extras":
        assert not rooms & BLENDER_ROOMS
    if path.name in BLENDER_GPU_FILES and room == "gpu":
        allowed |= {"gpu", "gpu_extras", "mathutils"}
    if room in ("external", "extras"):
        allowed |= EXTRA_LIBRARIES
    assert outside <= allowed, "only relative imports inside the package, only numpy outside it"


def imported_files(path: Path) -> Iterator[Path]:
    """Yield the files of all modules that a file imports relatively, in functions as well."""
    for node in ast.walk(ast.parse(path.read_text())):
        if not isinstance(node, ast.ImportFrom) or not node.level:
            continue
        source = path.parents[node.level - 1].joinpath(*(node.module or "").split("."))
        for alias in node.names:
            candidates = [
                file
                for module in (source / alias.name, source)
                for file in (module.with_suffix(".py"), module / "__init__.py")
                if file.is_file()
            ]
            assert candidates, f"{path} imports {alias.name}, which does not exist"
            yield candidates[0]


@pytest.mark.slow
@pytest.mark.parametrize("folder", ["rosy_addon", "operators"])
def test_there_are_no_import_cycles(folder):
    """Neither between rooms nor inside a room, nor by an import in a function."""
    files = sorted((ROOT / folder).rglob("*.py"))
    TopologicalSorter({path: set(imported_files(path)) for path in files}).prepare()


@pytest.mark.slow
def test_numpy_rooms_import_without_blender():
    modules = [
        "rosy_addon." + ".".join(path.relative_to(PACKAGE).with_suffix("").parts)
        for path in FILES
        if room_of(path) not in (BLENDER_ROOMS | {"external", "extras", "__main__"}) - {"cli"}
        and path.stem != "__init__"
    ]
    assert len(modules) > 20
    code = "\n".join(
        [
            "import importlib, sys",
            "sys.modules |= dict.fromkeys(['bpy', 'mathutils', 'gpu', 'bmesh'])",  # out of bounds
            *(f"importlib.import_module({name!r})" for name in modules),
            "heavy = {'scipy', 'PIL', 'matplotlib'} & set(sys.modules)",
            "assert not heavy, heavy",
        ]
    )
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
