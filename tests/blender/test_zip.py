"""The zip as a reviewer of the Extensions platform reads it: CONTRIBUTING.md has the sources."""

import ast
import os
import re
import sys
import tomllib
import zipfile

import pytest

TOP_LEVEL = {"blender_manifest.toml"}
TOP_LEVEL |= {"LICENSE", "__init__.py", "operators", "presets", "rosy_addon"}
#: The folder of the presets.
PRESETS = "presets/"

SUFFIXES = {"py", "toml", "json", "glsl", "png", "txt", "dat", "po"}

#: Modules that come with Blender.
BLENDER_MODULES = {"bpy", "bmesh", "bpy_extras", "mathutils", "gpu", "gpu_extras", "blf", "numpy"}

#: Modules of Python that are turned down: threads crash Blender, and RoSy uses no network, installs
#: nothing and loads no code.
REFUSED_MODULES = {
    *("threading", "_thread", "concurrent", "asyncio", "queue"),
    *("socket", "ssl", "urllib", "http", "ftplib", "smtplib", "webbrowser", "xmlrpc"),
    *("pip", "ensurepip", "venv", "site", "importlib", "runpy", "imp", "pkgutil", "marshal"),
}


def in_worker(*names):
    return {f"worker/{name}.py" for name in names}


#: Modules that reviewers ask about, and the files that may use them: what RoSy starts is Blender or
#: its own helpers in Blender's Python, and pickles and pipes are only between these. Of multiprocessing,
#: only the connections are used: it neither starts nor finds processes.
QUESTIONED_MODULES = {
    "subprocess": in_worker("frame_workers", "start", "lifeline", "helper", "program"),
    "pickle": in_worker("channel", "__main__"),
    "multiprocessing": in_worker("start", "guard", "lifeline", "helper", "channel", "pool"),
    "ctypes": {"core/memory.py"},
}

#: The file that starts helpers. They look for modules where Blender does, so it reads `sys.path`, and
#: sets PYTHONPATH for them.
HELPER_FILE = "worker/start.py"

#: Files that look for others beside themselves, to read or to run them.
FILES_WITH_PATHS = {
    "cli/field.py": "a folder without settings of matplotlib",
    "gpu/passes.py": "shaders",
    "preset_files/store.py": "presets",
    "scene/video.py": "the script that encodes videos",
    "ui/comb_brush.py": "the icon of the tool",
    "ui/singularity_handles.py": "the icon of the tool",
    "ui/translations.py": "translations of the interface",
    HELPER_FILE: "the package, which helpers run",
}

REFUSED_CALLS = {"eval", "exec", "compile", "__import__", "breakpoint", "input"}
REFUSED_ATTRIBUTES = {("os", "system"), ("os", "popen"), ("os", "startfile"), ("sys", "path")}
REFUSED_TEXT = re.compile(
    r"PYTHONPATH|pip install|https?://(?!www\.inkscape|www\.w3|sodipodi)|bl_ext\b"
)

#: Tags of the platform for add-ons.
TAGS = {
    *("3D View", "Add Curve", "Add Mesh", "Animation", "Bake", "Camera", "Compositing"),
    *("Development", "Game Engine", "Geometry Nodes", "Grease Pencil", "Import-Export"),
    *("Lighting", "Material", "Mesh", "Modeling", "Node", "Object", "Paint", "Physics"),
    *("Pipeline", "Render", "Rigging", "Scene", "Sculpt", "Sequencer", "System", "Text Editor"),
    *("Tracking", "UV", "User Interface"),
}


@pytest.fixture(scope="module")
def files():
    with zipfile.ZipFile(os.environ["ROSY_ZIP"]) as zipped:
        return {name: zipped.read(name) for name in zipped.namelist() if not name.endswith("/")}


@pytest.fixture(scope="module")
def sources(files):
    return {
        name.removeprefix("rosy_addon/"): ast.parse(data)
        for name, data in files.items()
        if name.endswith(".py")
    }


def test_contents(files):
    assert {name.split("/")[0] for name in files} <= TOP_LEVEL
    assert {name.rsplit(".", 1)[-1] for name in files if "." in name} <= SUFFIXES
    pictures = {name for name in files if name.endswith(".png")}
    looks = {name for name in files if name.startswith(PRESETS) and name.endswith(".json")}
    assert pictures == {name.replace(".json", ".png") for name in looks}
    assert b"CC0" in files[PRESETS + "LICENSE.txt"]
    assert os.path.getsize(os.environ["ROSY_ZIP"]) < 1_400_000
    assert max(len(data) for name, data in files.items() if not name.endswith(".po")) < 60_000
    outside = ("rosy_addon/extras/", "rosy_addon/external/")
    assert not any(name.startswith(outside) for name in files)
    assert "rosy_addon/__main__.py" not in files


def test_manifest(files):
    """What Blender's own validation, which run.py calls, does not check."""
    manifest = tomllib.loads(files["blender_manifest.toml"].decode())
    assert manifest["website"].startswith("https://")
    assert all(
        text[0].isupper() for text in (manifest["tagline"], *manifest["permissions"].values())
    )
    assert re.fullmatch(r"\d+\.\d+\.\d+", manifest["version"])
    assert set(manifest["permissions"]) == {"files"}
    assert set(manifest["tags"]) <= TAGS
    assert set(manifest["license"]) == {"SPDX:GPL-3.0-or-later", "SPDX:CC0-1.0"}
    assert "blender" not in manifest["name"].lower() + manifest["id"]
    assert not {"blender_version_max", "wheels", "platforms"} & set(manifest)


def test_imports(sources):
    for name, tree in sources.items():
        modules = imported_modules(tree)
        assert modules <= BLENDER_MODULES | set(sys.stdlib_module_names), name
        assert not modules & REFUSED_MODULES, f"{name} imports {modules & REFUSED_MODULES}"
        for module in modules & set(QUESTIONED_MODULES):
            assert name in QUESTIONED_MODULES[module], f"{name} imports {module}"


def test_calls_paths_and_texts(sources):
    for name, tree in sources.items():
        docstrings = docstrings_of(tree)
        for node in ast.walk(tree):
            match node:
                case ast.Call(func=ast.Name(id=called)):
                    assert called not in REFUSED_CALLS, f"{name} calls {called}"
                case ast.Attribute(value=ast.Name(id=owner), attr=attribute):
                    is_refused = (owner, attribute) in REFUSED_ATTRIBUTES
                    is_refused &= name != HELPER_FILE
                    assert not is_refused, f"{name} uses {owner}.{attribute}"
                case ast.Subscript(
                    value=ast.Attribute(attr="modules"), ctx=ast.Store() | ast.Del()
                ):
                    raise AssertionError(f"{name} changes the modules that are loaded")
                case ast.Name(id="__file__") | ast.Attribute(attr="__file__"):
                    assert name in FILES_WITH_PATHS, f"{name} uses __file__"
                case ast.Constant(value=str(text)) if node not in docstrings:
                    is_allowed = name == HELPER_FILE and text == "PYTHONPATH"
                    assert is_allowed or not REFUSED_TEXT.search(text), f"{name}: {text}"


def test_packages_have_only_docstrings(sources):
    """What a package imports at once would be loaded even if it is not used.

    The package `api` is loaded when one of its names is used, and is there for them.
    """
    for name, tree in sources.items():
        if name.endswith("/__init__.py") and name != "api/__init__.py":
            assert len(tree.body) == 1 and ast.get_docstring(tree), name


def docstrings_of(tree):
    """Return the nodes of all docstrings: they may cite pages."""
    return {
        node.body[0].value
        for node in ast.walk(tree)
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef) and ast.get_docstring(node)
    }


def imported_modules(tree):
    """Return the top-level names of all modules that a file imports."""
    found = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            found |= {alias.name.split(".")[0] for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and not node.level:
            found.add(node.module.split(".")[0])
    return found
