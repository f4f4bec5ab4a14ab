"""Tests of the built extension, inside a full Blender. Elsewhere nothing here is collected."""

import importlib.util
import math
import os
import subprocess
import sys
from pathlib import Path

import pytest

#: Set by run.py, which has installed the zip into an otherwise empty Blender.
if "ROSY_BLENDER_LANE" not in os.environ or importlib.util.find_spec("bpy") is None:
    collect_ignore_glob = ["test_*.py"]
else:
    import bpy

    sys.path.insert(0, str(Path(__file__).parents[1]))
    from harness.blender_data import contents, member_vectors, pixels, render_image  # noqa: F401


@pytest.fixture
def scene():
    """An empty scene with a camera that looks at the origin from (0, -6, 2)."""
    bpy.ops.wm.read_homefile(use_empty=True)
    scene = bpy.context.scene
    scene.render.resolution_x, scene.render.resolution_y = 160, 120
    scene.render.resolution_percentage = 100
    scene.view_settings.view_transform = "Standard"
    add_camera("Camera", (0.0, -6.0, 2.0), (math.radians(71.57), 0.0, 0.0))
    scene.camera = bpy.data.objects["Camera"]
    return scene


def add_camera(name, location, rotation):
    """Add a camera object to the current scene."""
    camera = bpy.data.objects.new(name, bpy.data.cameras.new(name))
    camera.location, camera.rotation_euler = location, rotation
    bpy.context.scene.collection.objects.link(camera)
    return camera


def add_suzanne(levels):
    """Add Suzanne with a subdivision modifier, active and selected."""
    bpy.ops.mesh.primitive_monkey_add()
    modifier = bpy.context.object.modifiers.new("Subdivision", "SUBSURF")
    modifier.levels = modifier.render_levels = levels
    return bpy.context.object


@pytest.fixture
def suzanne(scene):
    """Suzanne with a subdivision modifier, active and selected."""
    return add_suzanne(1)


@pytest.fixture
def with_field(suzanne):
    """Suzanne with a field of degree 4."""
    assert bpy.ops.rosy.field_generate(kind="curvature", degree=4) == {"FINISHED"}
    return suzanne


@pytest.fixture
def baked(with_field):
    """Suzanne with a field, baked from the scene's camera."""
    assert bpy.ops.rosy.bake() == {"FINISHED"}
    return with_field


def baked_images():
    """Return the images of baked pictures."""
    return [image for image in bpy.data.images if image.name.lower().startswith("rosy")]


def run_blender(*arguments):
    """Run another Blender without a window, and return its exit status and its output."""
    command, streams = [bpy.app.binary_path, "-b", *arguments], {"capture_output": True}
    process = subprocess.run(command, text=True, timeout=120, check=False, **streams)
    return process.returncode, process.stdout + process.stderr


def error_of(operator, *arguments, **settings):
    """Return the text of the error that an operator reports."""
    with pytest.raises(RuntimeError) as caught:
        operator(*arguments, **settings)
    return str(caught.value).strip()
