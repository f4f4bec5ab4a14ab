"""Presets and a scene's look: which one it was taken from, and whether it still is the same."""

from __future__ import annotations

import bpy
import pytest
from rosy.rosy_addon.compositor.look import Look
from rosy.rosy_addon.errors import RosyError
from rosy.rosy_addon.presets import store
from rosy.rosy_addon.presets.store import Preset, default_user_folder, preset_keys, save_preset
from rosy.rosy_addon.scene.look_properties import read_look
from rosy.rosy_addon.scene.paths import user_presets_folder
from rosy.rosy_addon.ui import preset_library

LOOK = Look(ink="hatch", gain=1.23456789, guiding_angle=0.1, ink_colour="#ABCDEF", seed=7)


@pytest.fixture
def own(tmp_path, monkeypatch):
    monkeypatch.setenv("ROSY_PRESETS", str(tmp_path / "own"))
    return tmp_path / "own"


def test_without_the_extension_ones_own_are_where_they_are_without_blender(monkeypatch):
    monkeypatch.delenv("ROSY_PRESETS", raising=False)
    assert user_presets_folder() == default_user_folder()


def test_a_new_scene_has_the_default(scene, own):
    settings = scene.rosy
    assert (settings.preset_name, settings.preset) == ("default", "default")
    assert read_look(settings) == Look() and not preset_library.is_changed(settings)


@pytest.mark.parametrize("name", preset_keys())
def test_every_preset_is_held_by_blender_as_it_is(scene, own, name):
    scene.rosy.preset = name
    assert (scene.rosy.preset_name, scene.rosy.preset) == (name, name)
    assert read_look(scene.rosy) == store.load_preset(name).look
    assert not preset_library.is_changed(scene.rosy)
    scene.rosy.look.seed += 1
    assert preset_library.is_changed(scene.rosy)


def test_numbers_and_colours_that_blender_rounds_are_no_change(scene, own):
    save_preset(Preset("Mine", "", LOOK), own)
    preset_library.apply_preset(scene.rosy, "mine")
    assert not preset_library.is_changed(scene.rosy)
    scene.rosy.look.gain += 1e-4
    assert preset_library.is_changed(scene.rosy)


def test_the_shelf_follows_the_files(scene, own):
    assert preset_library.user_preset_keys() == []
    save_preset(Preset("Mine", "First", LOOK), own)
    assert preset_library.user_preset_keys() == ["mine"]
    scene.rosy.preset = "mine"
    changed = LOOK.with_settings({"seed": 8})
    save_preset(Preset("Mine", "Second", changed), own, replace=True)
    assert preset_library.active_entry(scene.rosy).preset.description == "Second"
    assert preset_library.is_changed(scene.rosy)
    (own / "mine.json").unlink()
    assert (
        preset_library.user_preset_keys() == [] and preset_library.active_entry(scene.rosy) is None
    )


def test_a_preset_that_is_not_here(scene, own):
    """As in a file from another machine: the look stays, and its name is shown."""
    save_preset(Preset("Mine", "", LOOK), own)
    scene.rosy.preset = "mine"
    (own / "mine.json").unlink()
    before = read_look(scene.rosy)
    assert scene.rosy.preset == "mine" and preset_library.is_changed(scene.rosy)
    scene.rosy.preset = "mine"
    assert read_look(scene.rosy) == before
    scene.rosy.preset = "plaid"
    assert read_look(scene.rosy).noise == "colour"
    with pytest.raises(TypeError):
        scene.rosy.preset = "mine"


def test_files_that_cannot_be_read_do_not_hide_the_others(scene, own):
    own.mkdir()
    (own / "broken.json").write_text("{")
    assert list(preset_library.entries()) == preset_keys()
    (fault,) = preset_library.load_errors()
    assert "broken.json:1:" in fault
    with pytest.raises(RosyError, match=r"broken\.json:1:"):
        preset_library.apply_preset(scene.rosy, "broken")


def test_applied_by_name_and_by_path(scene, own, tmp_path):
    save_preset(Preset("My Ink", "", LOOK), own)
    for name in ("my-ink", "My Ink", str(own / "my-ink.json")):
        preset_library.apply_preset(scene.rosy, name)
        assert scene.rosy.preset_name == "my-ink"
    elsewhere = tmp_path / "elsewhere.json"
    (own / "my-ink.json").rename(elsewhere)
    preset_library.apply_preset(scene.rosy, str(elsewhere))
    assert scene.rosy.preset_name == str(elsewhere) == scene.rosy.preset


def test_the_name_is_saved_and_copied_with_the_scene(scene, own, tmp_path):
    scene.rosy.preset = "woodcut"
    other = scene.copy()
    assert other.rosy.preset == "woodcut"
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "a.blend"))
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "a.blend"))
    assert bpy.context.scene.rosy.preset == "woodcut"


def test_a_file_that_was_edited_is_read_again(scene, own, monkeypatch):
    save_preset(Preset("Mine", "First", LOOK), own)
    assert preset_library.entries()["mine"].preset.description == "First"
    path = own / "mine.json"
    path.write_text(path.read_text().replace("First", "Edited"))  # in its place in the folder
    monkeypatch.setattr(preset_library, "REFRESH_SECONDS", 0.0)
    assert preset_library.entries()["mine"].preset.description == "Edited"
