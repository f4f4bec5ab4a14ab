"""Presets of the user's own, through the buttons' operators in the installed extension."""

from __future__ import annotations

import json
from pathlib import Path

import bpy
import pytest
from conftest import EXTENSION, contents, error_of


def folder():
    return Path(bpy.utils.extension_path_user(EXTENSION, path="presets"))


@pytest.fixture(autouse=True)
def empty_shelf(scene):
    """No preset of the user's own, before and after."""
    for path in folder().glob("*"):
        path.unlink()
    yield
    for path in folder().glob("*"):
        path.unlink()


def look():
    return bpy.context.scene.rosy.look


def save(name="My Ink", sentence="Long lines", **more):
    return bpy.ops.rosy.preset_save(name=name, sentence=sentence, **more)


def test_saved_in_the_folder_of_the_extension(scene):
    look().length, look().ink = 90, "hatch"
    assert save() == {"FINISHED"}
    stored = json.loads((folder() / "my-ink.json").read_text())
    assert stored == {
        "name": "My Ink",
        "description": "Long lines",
        "look": {"length": 90, "ink": "hatch"},
    }
    picture = bpy.data.images.load(str(folder() / "my-ink.png"))
    assert tuple(picture.size) == (256, 256)
    bpy.data.images.remove(picture)
    assert scene.rosy.preset == "my-ink"
    assert bpy.ops.rosy.preset_apply(preset="default") == {"FINISHED"}
    assert (look().length, look().ink) == (40, "soft")
    assert bpy.ops.rosy.preset_apply(preset="my-ink") == {"FINISHED"}
    assert (look().length, look().ink) == (90, "hatch")


def test_saved_without_a_trace_in_the_file(suzanne):
    before = contents()
    save()
    assert contents() == before


def test_replaced_only_if_asked(scene):
    save()
    look().length = 7
    assert "already" in error_of(save)
    assert json.loads((folder() / "my-ink.json").read_text())["look"] == {}
    assert save(replace=True) == {"FINISHED"}
    assert json.loads((folder() / "my-ink.json").read_text())["look"] == {"length": 7}
    assert "already" in error_of(save)


@pytest.mark.parametrize(
    ("name", "said"),
    [("Plaid", "a preset of RoSy"), ("..", "letter or a digit"), ("", "letter or a digit")],
)
def test_names_that_are_refused(scene, name, said):
    message = error_of(save, name)
    assert said in message and "Traceback" not in message
    assert not list(folder().glob("*")) and scene.rosy.preset == "default"


def test_renamed_and_deleted(scene):
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


def test_passed_on(scene, tmp_path):
    look().length = 90
    save()
    path = tmp_path / "passed on.json"
    assert bpy.ops.rosy.preset_export(filepath=str(path), preset="my-ink") == {"FINISHED"}
    assert path.read_bytes() == (folder() / "my-ink.json").read_bytes()
    drawn = (folder() / "my-ink.png").read_bytes()
    assert "already" in error_of(bpy.ops.rosy.preset_import, filepath=str(path))
    bpy.ops.rosy.preset_remove()
    assert bpy.ops.rosy.preset_import(filepath=str(path)) == {"FINISHED"}
    assert (folder() / "my-ink.json").read_bytes() == path.read_bytes()
    assert (folder() / "my-ink.png").read_bytes() == drawn
    bpy.ops.rosy.preset_apply(preset="my-ink")
    assert look().length == 90


def test_files_of_strangers_are_refused(scene, tmp_path):
    path = tmp_path / "a.json"
    for text, said in (
        ("[" * 50_000, "a.json"),
        ('{"name": "../../a", "description": "", "look": {"length": "x"}}', "'length'"),
        ('{"name": "a", "description": "", "look": {"sparkle": 1}}', "update RoSy"),
    ):
        path.write_text(text)
        message = error_of(bpy.ops.rosy.preset_import, filepath=str(path))
        assert said in message and "Traceback" not in message
    assert "no such file" in error_of(bpy.ops.rosy.preset_import, filepath=str(tmp_path / "b.json"))
    assert not list(folder().glob("*"))
    path.write_text('{"name": "../../a b", "description": "", "look": {}}')
    assert bpy.ops.rosy.preset_import(filepath=str(path)) == {"FINISHED"}
    assert (folder() / "a-b.json").is_file()


def test_a_scene_starts_from_ones_own(scene):
    wished = bpy.context.preferences.addons[EXTENSION].preferences
    look().length = 90
    save()
    bpy.ops.wm.read_homefile(use_empty=True)
    wished.preset = "my-ink"
    try:
        bpy.ops.mesh.primitive_cube_add()
        bpy.ops.rosy.field_generate(kind="axis", degree=4)
        assert (look().length, bpy.context.scene.rosy.preset) == (90, "my-ink")
    finally:
        wished.preset = ""


def test_the_command_line_knows_ones_own(with_field, tmp_path):
    from test_command import command

    look().length = 90
    save()
    path = tmp_path / "suzanne.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(path))
    status, said = command("presets")
    assert status == 0 and "my-ink" in said and str(folder()) in said
    words = ("--size", "64x48", "--out", tmp_path / "out")
    status, said = command("bake", "--preset", "my-ink", *words, scene=path)
    assert status == 0, said
