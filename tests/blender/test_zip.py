"""The zip holds what Blender needs and nothing else."""

import ast
import os
import zipfile

TOP_LEVEL = {
    "LICENSE",
    "__init__.py",
    "blender_manifest.toml",
    "operators",
    "presets",
    "rosy_addon",
}


def test_contents():
    path = os.environ["ROSY_ZIP"]
    with zipfile.ZipFile(path) as zipped:
        names = zipped.namelist()
    assert {name.split("/")[0] for name in names} <= TOP_LEVEL
    assert {name.rsplit(".", 1)[-1] for name in names if "." in name} <= {
        "py",
        "toml",
        "json",
        "glsl",
        "png",
    }
    pictures = {name for name in names if name.endswith(".png")}
    looks = {name for name in names if name.startswith("presets/") and name.endswith(".json")}
    assert pictures == {name.replace(".json", ".png") for name in looks}
    assert os.path.getsize(path) < 1_000_000


#: Modules that the Extensions platform turns down: threads crash Blender.
THREADS = {"threading", "_thread", "multiprocessing", "concurrent", "asyncio", "queue"}


def test_no_threads():
    with zipfile.ZipFile(os.environ["ROSY_ZIP"]) as zipped:
        for name in zipped.namelist():
            if name.endswith(".py"):
                imported = imported_modules(zipped.read(name))
                assert not imported & THREADS, f"{name} imports {imported & THREADS}"


def imported_modules(source):
    """Return the top-level names of all modules that a file imports."""
    found = set()
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            found |= {alias.name.split(".")[0] for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and not node.level:
            found.add(node.module.split(".")[0])
    return found
