"""Blender's Python module with RoSy in it, and an empty file for every test."""

import importlib.util
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]

if importlib.util.find_spec("bpy") is None:
    collect_ignore_glob = ["test_*.py"]
else:
    import bpy

    sys.path.insert(0, str(Path(__file__).resolve().parent))
    bpy.ops.wm.read_factory_settings(use_empty=True)
    # The root of the repository is the package `rosy`, as Blender imports an extension.
    spec = importlib.util.spec_from_file_location(
        "rosy", ROOT / "__init__.py", submodule_search_locations=[str(ROOT)]
    )
    sys.modules["rosy"] = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(sys.modules["rosy"])
    importlib.import_module("rosy.rosy_addon.ui.properties").ensure_registered()
    from objects import add_camera, add_field, add_monkey, add_plane
    from scenes import empty_scene


@pytest.fixture(autouse=True)
def empty_cache():
    """Each test computes all results anew, and no one looks through those of earlier tests."""
    importlib.import_module("rosy.rosy_addon.core.cache").BAKE_CACHE.clear()


@pytest.fixture
def scene():
    """An empty scene, 128 x 128 pixels, view transform Standard."""
    scene = empty_scene(128)
    scene.view_settings.view_transform = "Standard"
    return scene


@pytest.fixture
def camera(scene):
    """A camera at (0, -5, 0.5) that looks at the origin and renders the scene."""
    scene.camera = add_camera("Camera", (0.0, -5.0, 0.5))
    return scene.camera


@pytest.fixture
def monkey(scene):
    """Suzanne with a curvature field of degree 4."""
    return add_field(add_monkey())


@pytest.fixture
def wall(scene, camera):
    """A square across the view, of four faces, with a field of degree 2."""
    return add_field(add_plane(cuts=2), "axis", 2, (1.0, 0.0, 0.2))
