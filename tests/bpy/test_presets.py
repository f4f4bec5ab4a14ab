"""The preset of a scene, and whether the look has changed since it was applied."""

import pytest
from rosy.rosy_addon.compositor.look import Look
from rosy.rosy_addon.preset_files import store
from rosy.rosy_addon.preset_files.store import Preset, preset_keys, save_preset
from rosy.rosy_addon.scene.look_properties import read_look
from rosy.rosy_addon.ui import preset_library
from scenes import expect_error

LOOK = Look(ink="hatch", gain=1.23456789, guiding_angle=0.1, ink_color="#ABCDEF", seed=7)


@pytest.fixture
def user_folder(tmp_path, monkeypatch):
    monkeypatch.setenv("ROSY_PRESETS", str(tmp_path / "own"))
    return tmp_path / "own"


def test_a_new_scene_has_the_default(scene, user_folder):
    settings = scene.rosy
    assert (settings.preset_name, settings.preset) == ("default", "default")
    assert read_look(settings) == Look() and not preset_library.is_changed(settings)


@pytest.mark.parametrize("name", preset_keys())
def test_properties_hold_every_preset_exactly(scene, user_folder, name):
    scene.rosy.preset = name
    assert (scene.rosy.preset_name, scene.rosy.preset) == (name, name)
    assert read_look(scene.rosy) == store.load_preset(name).look
    assert not preset_library.is_changed(scene.rosy)
    scene.rosy.look.seed += 1
    assert preset_library.is_changed(scene.rosy)


def test_rounding_by_blender_is_no_change(scene, user_folder):
    save_preset(Preset("Mine", "", LOOK), user_folder)
    preset_library.apply_preset(scene.rosy, "mine")
    assert not preset_library.is_changed(scene.rosy)
    scene.rosy.look.gain += 1e-4
    assert preset_library.is_changed(scene.rosy)


def test_the_library_follows_the_files(scene, user_folder, monkeypatch):
    assert preset_library.user_preset_keys() == []
    save_preset(Preset("Mine", "First", LOOK), user_folder)
    assert preset_library.user_preset_keys() == ["mine"]
    scene.rosy.preset = "mine"
    changed = LOOK.with_settings({"seed": 8})
    save_preset(Preset("Mine", "Second", changed), user_folder, replace=True)
    assert preset_library.active_entry(scene.rosy).preset.description == "Second"
    assert preset_library.is_changed(scene.rosy)
    path = user_folder / "mine.json"
    path.write_text(path.read_text().replace("Second", "Edited"))  # in place
    monkeypatch.setattr(preset_library, "REFRESH_SECONDS", 0.0)
    assert preset_library.active_entry(scene.rosy).preset.description == "Edited"
    path.unlink()
    assert preset_library.user_preset_keys() == []
    assert preset_library.active_entry(scene.rosy) is None


def test_a_missing_preset(scene, user_folder):
    """As in a file from another machine: the look stays, and its name is shown."""
    save_preset(Preset("Mine", "", LOOK), user_folder)
    scene.rosy.preset = "mine"
    (user_folder / "mine.json").unlink()
    before = read_look(scene.rosy)
    assert scene.rosy.preset == "mine" and preset_library.is_changed(scene.rosy)
    scene.rosy.preset = "mine"
    assert read_look(scene.rosy) == before
    scene.rosy.preset = "plaid"
    assert read_look(scene.rosy).hue == "noise"
    with pytest.raises(TypeError):
        scene.rosy.preset = "mine"


def test_unreadable_files_do_not_hide_the_others(scene, user_folder):
    user_folder.mkdir()
    (user_folder / "broken.json").write_text("{")
    assert list(preset_library.entries()) == preset_keys()
    (load_error,) = preset_library.load_errors()
    assert "broken.json:1:" in load_error
    expect_error(r"broken\.json:1:", preset_library.apply_preset, scene.rosy, "broken")


def test_presets_are_applied_by_name_and_by_path(scene, user_folder, tmp_path):
    save_preset(Preset("My Ink", "", LOOK), user_folder)
    for name in ("my-ink", "My Ink", str(user_folder / "my-ink.json")):
        preset_library.apply_preset(scene.rosy, name)
        assert scene.rosy.preset_name == "my-ink"
    elsewhere = tmp_path / "elsewhere.json"
    (user_folder / "my-ink.json").rename(elsewhere)
    preset_library.apply_preset(scene.rosy, str(elsewhere))
    assert scene.rosy.preset_name == str(elsewhere) == scene.rosy.preset
