"""Imports run one way, also inside rooms, and the numpy rooms import without Blender."""

import ast
import subprocess
import sys
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


#: What the Python package can use where it is installed.
EXTRA_LIBRARIES = {
    *("distributed", "h5py", "imageio_ffmpeg", "matplotlib", "meshio", "pyvista", "vtkmodules")
}
FILES = sorted(PACKAGE.rglob("*.py"))


def room_of(path: Path) -> str:
    return path.relative_to(PACKAGE).with_suffix("").parts[0]


def imports_of(path: Path) -> tuple[set[Path], set[str]]:
    """Imported modules, in functions as well: files of RoSy, and top-level names of all others."""
    inside, outside = set(), set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            outside |= {alias.name.split(".")[0] for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and not node.level:
            outside.add(node.module.split(".")[0])
        elif isinstance(node, ast.ImportFrom):
            source = path.parents[node.level - 1].joinpath(*(node.module or "").split("."))
            inside |= {file_of(source, alias.name) for alias in node.names}
    return inside, outside


def file_of(source: Path, name: str) -> Path:
    """The file of a module, or of a name in it."""
    for module in (source / name, source):
        for file in (module.with_suffix(".py"), module / "__init__.py"):
            if file.is_file():
                return file
    raise AssertionError(f"{source} has no {name}")


@pytest.mark.parametrize("path", FILES, ids=lambda path: str(path.relative_to(PACKAGE)))
def test_imports_run_one_way(path):
    inside, outside = imports_of(path)
    room = room_of(path)
    (layer,) = (number for number, rooms in enumerate(LAYERS) if room in rooms)
    above = {each for rooms in LAYERS[:layer] for each in rooms}
    rooms = {room_of(file) for file in inside} - {room}
    assert rooms <= above
    allowed = set(sys.stdlib_module_names) | {"numpy"}
    if room in BLENDER_ROOMS:
        allowed |= {"bpy", "bmesh", "bpy_extras", "mathutils", "gpu", "gpu_extras", "blf"}
    elif room != "extras":
        assert not rooms & BLENDER_ROOMS
    if path == PACKAGE / "gpu" / "device.py":  # draws with Blender
        allowed |= {"gpu", "gpu_extras", "mathutils"}
    if room in ("external", "extras"):
        allowed |= EXTRA_LIBRARIES
    assert outside <= allowed, "only relative imports inside the package, only numpy outside it"


@pytest.mark.slow
@pytest.mark.parametrize("folder", ["rosy_addon", "operators"])
def test_there_are_no_import_cycles(folder):
    """Neither between rooms nor inside a room, nor by an import in a function."""
    files = sorted((ROOT / folder).rglob("*.py"))
    TopologicalSorter({path: imports_of(path)[0] for path in files}).prepare()


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
