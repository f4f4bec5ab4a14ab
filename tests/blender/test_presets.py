"""Presets of the user, with the operators of the installed extension."""

import json
from pathlib import Path

import bpy
import pytest
from conftest import error_of
from extension import EXTENSION, preferences
from test_commands import command


def folder():
    return Path(bpy.utils.extension_path_user(EXTENSION, path="presets"))


@pytest.fixture(autouse=True)
def no_user_presets(scene):
    """Delete all presets of the user, before and after each test."""
    for path in folder().glob("*"):
        path.unlink()
    yield
    for path in folder().glob("*"):
        path.unlink()


def look():
    return bpy.context.scene.rosy.look


def save(name="My Ink", sentence="Long lines", **options):
    return bpy.ops.rosy.preset_save(name=name, sentence=sentence, **options)


def test_presets_are_saved_in_the_folder_of_the_extension(scene):
    look().length, look().ink = 90, "hatch"
    assert save() == {"FINISHED"}
    stored = json.loads((folder() / "my-ink.json").read_text())
    look_of_file = {"length": 90, "ink": "hatch"}
    assert stored == {"name": "My Ink", "description": "Long lines", "look": look_of_file}
    picture = bpy.data.images.load(str(folder() / "my-ink.png"))
    assert tuple(picture.size) == (256, 256)
    bpy.data.images.remove(picture)
    assert scene.rosy.preset == "my-ink"
    assert bpy.ops.rosy.preset_apply(preset="default") == {"FINISHED"}
    assert look().ink == "soft"
    assert bpy.ops.rosy.preset_apply(preset="my-ink") == {"FINISHED"}
    assert (look().length, look().ink) == (90, "hatch")
    look().length = 7
    assert "already" in error_of(save)
    assert save(replace=True) == {"FINISHED"}
    assert json.loads((folder() / "my-ink.json").read_text())["look"]["length"] == 7


def test_rename_and_delete(scene):
    assert not bpy.ops.rosy.preset_rename.poll() and not bpy.ops.rosy.preset_remove.poll()
    save()
    assert bpy.ops.rosy.preset_rename(name="Your Ink", sentence="Longer") == {"FINISHED"}
    assert scene.rosy.preset == "your-ink"
    names = sorted(path.name for path in folder().iterdir())
    assert names == ["your-ink.json", "your-ink.png"]
    assert "your presets" in error_of(bpy.ops.rosy.preset_remove, preset="plaid")
    assert "your presets" in error_of(bpy.ops.rosy.preset_rename, preset="plaid", name="Mine")
    assert "a preset of RoSy" in error_of(bpy.ops.rosy.preset_rename, name="Plaid")
    look().length = 77
    assert bpy.ops.rosy.preset_remove() == {"FINISHED"}
    assert not list(folder().iterdir())
    assert look().length == 77
    assert "You have no presets" in error_of(bpy.ops.rosy.preset_remove)


def test_export_and_import(scene, tmp_path):
    look().length = 90
    save()
    path = tmp_path / "passed on.json"
    assert bpy.ops.rosy.preset_export(filepath=str(path), preset="my-ink") == {"FINISHED"}
    assert path.read_bytes() == (folder() / "my-ink.json").read_bytes()
    preview = (folder() / "my-ink.png").read_bytes()
    assert "already" in error_of(bpy.ops.rosy.preset_import, filepath=str(path))
    bpy.ops.rosy.preset_remove()
    assert bpy.ops.rosy.preset_import(filepath=str(path)) == {"FINISHED"}
    assert (folder() / "my-ink.json").read_bytes() == path.read_bytes()
    assert (folder() / "my-ink.png").read_bytes() == preview
    bpy.ops.rosy.preset_apply(preset="my-ink")
    assert look().length == 90


def test_a_scene_starts_from_the_preferred_preset(scene):
    look().length = 90
    save()
    bpy.ops.wm.read_homefile(use_empty=True)
    preferences().preset = "my-ink"
    try:
        bpy.ops.mesh.primitive_cube_add()
        bpy.ops.rosy.field_generate(kind="axis", degree=4)
        assert (look().length, bpy.context.scene.rosy.preset) == (90, "my-ink")
    finally:
        preferences().preset = ""


def test_user_presets_on_the_command_line(scene):
    save()
    status, output = command("presets")
    assert status == 0 and "my-ink" in output and str(folder()) in output
