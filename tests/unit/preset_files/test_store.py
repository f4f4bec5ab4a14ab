"""Presets of the user: saved, renamed, shared, and read from untrusted files."""

import json
import sys
from pathlib import Path

import numpy as np
import pytest
from command_helpers import write_cube
from conftest import mainly
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from PIL import Image

from rosy_addon.cli.parser import main
from rosy_addon.compositor.look import Look
from rosy_addon.core.errors import RosyError
from rosy_addon.core.settings import settings_of
from rosy_addon.image_io.png import to_srgb_uint8
from rosy_addon.preset_files import store
from rosy_addon.preset_files.preview import PREVIEW_SIZE, draw_preview
from rosy_addon.preset_files.store import (
    MAX_DESCRIPTION_LENGTH,
    MAX_FILE_BYTES,
    MAX_NAME_LENGTH,
    SHIPPED_FOLDER,
    Preset,
    load_preset,
    preset_files,
    preset_key,
    preset_keys,
    preview_path,
    read_preset,
    remove_preset,
    rename_preset,
    save_preset,
    write_preset,
)
from tests.fuzz.options import setting_value


def random_look(seed):
    """Return a look with random values of some settings."""
    random = np.random.default_rng(seed)
    settings = [each for each in settings_of(Look).values() if random.random() < 0.5]
    values = {setting.name: setting_value(random, setting) for setting in settings}
    return Look().with_settings({"paper_color": "#AbCdEf80"} | values)


LOOKS = st.integers(0, 2**32 - 1).map(random_look)
LINES = st.text(st.characters().filter(str.isprintable))
NAMES = LINES.filter(lambda name: any(character.isalnum() for character in name)).map(
    lambda name: name[:MAX_NAME_LENGTH] if key(name[:MAX_NAME_LENGTH]) else "a"
)


def key(name):
    try:
        return preset_key(name)
    except RosyError:
        return None


@pytest.fixture
def user_folder(tmp_path):
    return tmp_path / "own"


@pytest.fixture
def blank_previews(monkeypatch):
    """Replace previews by small black pictures, for tests of the files alone."""
    monkeypatch.setattr(store, "draw_preview", lambda look: np.zeros((4, 4, 4), dtype=np.float32))


MINE = Preset("My Ink", "Long lines", Look(ink="hatch", length=90, ink_color="#102030"))


# --- files -----------------------------------------------------------------------------------


@pytest.mark.slow
@settings(max_examples=60, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(name=NAMES, description=LINES.map(lambda line: line[:MAX_DESCRIPTION_LENGTH]), look=LOOKS)
def test_a_preset_is_read_as_it_was_written(tmp_path, name, description, look):
    path = tmp_path / "a.json"
    write_preset(path, Preset(name, description, look))
    assert read_preset(path) == Preset(name, description, look)
    stored = json.loads(path.read_text(encoding="utf-8"))["look"]
    values = vars(look).items()
    changed = {name: value for name, value in values if value != getattr(Look(), name)}
    assert stored == json.loads(json.dumps(changed))


def test_shipped_presets_have_the_settings_of_their_files():
    assert {"paper", "plaid", "pen-and-ink"} <= set(preset_keys())
    for name in preset_keys():
        stored = json.loads((SHIPPED_FOLDER / f"{name}.json").read_text())["look"]
        assert load_preset(name).look == Look(**stored) and load_preset(name).description


def test_missing_presets(tmp_path, error_of):
    message = error_of(load_preset, "papier")
    assert "there is no preset 'papier'" in message and "paper" in message
    assert "no such file" in error_of(load_preset, tmp_path / "none.json")


def test_files_are_readable_by_people(tmp_path):
    write_preset(tmp_path / "a.json", MINE._replace(name="Schrägstrich Ø"))
    look = {"length": 90, "ink": "hatch", "ink_color": "#102030"}
    stored = {"name": "Schrägstrich Ø", "description": "Long lines", "look": look}
    text = (tmp_path / "a.json").read_text(encoding="utf-8")
    assert text == json.dumps(stored, indent=2, ensure_ascii=False) + "\n"


def test_a_byte_order_mark_is_ignored(tmp_path):
    write_preset(tmp_path / "a.json", MINE)
    (tmp_path / "b.json").write_bytes(b"\xef\xbb\xbf" + (tmp_path / "a.json").read_bytes())
    assert read_preset(tmp_path / "b.json") == MINE


#: Whether Python's JSON reader refuses deep nesting. Later versions may reach the end of the file.
SHALLOW = sys.version_info < (3, 14)

HEAD = '{"name": "a", "description": "b", "look": {'

#: Settings of a look, and the error.
SETTINGS = {
    '"gain": ' + "[" * 900 + "]" * 900: "expected a number",
    '"seed": ' + "9" * 5000: "number that is too long",
    '"seed": ' + "9" * 3000: "setting 'seed' is 999",
    '"gain": NaN': "setting 'gain' is nan",
    f'"hue": "{"x" * 60_000}"': "setting 'hue' is 'xxx",
    '"gain": 1, "gain": 2': "'gain' appears twice",
    '"sparkle": 1': "unknown setting 'sparkle': check its spelling",
    f'"{"x" * 60_000}": 1': "unknown setting 'xxx",
    '"a\\nb": 1': "unknown setting 'a\\nb'",
}

#: Names of presets, as JSON, and the error.
BAD_NAMES = {
    "3": "the name of the preset must be text, not 3",
    '""': "a letter or a digit",
    '"../.."': "a letter or a digit",
    f'"{"a" * 49}"': "has 49 characters, more than 48",
    '"a\\nb"': "must be one line of text",
    '"a\\u001b[31m"': "'a\\x1b[31m'",
    '"a\\u202eb"': "'a\\u202eb'",
    '"a\\ud800"': "'a\\ud800'",
}

#: Contents of files, and the error.
HOSTILE = {
    **{f"{HEAD}{text}}}}}".encode(): error for text, error in SETTINGS.items()},
    **{
        f'{{"name": {name}, "description": "b", "look": {{}}}}'.encode(): error
        for name, error in BAD_NAMES.items()
    },
    b" " * MAX_FILE_BYTES + b"{}": "larger than the limit of 65,536 bytes",
    b"[" * 60_000: "nested too deeply" if SHALLOW else "",
    b'{"a":' * 12_000: "nested too deeply" if SHALLOW else "",
    b"[1]": "a preset must be a JSON object",
    b'{"name": "a", "description": "b"}': "the preset has no 'look'",
    b'{"name": "a", "description": "b", "look": 3}': "'look' must be a JSON object",
    b'{"name": "a", "name": "b"}': "'name' appears twice",
    '{"name": "a"}'.encode("utf-16"): "binary data",
    '{"name": "Schr\u00e4g"}'.encode("latin-1"): "not UTF-8",
    b"": ":1: expecting value",
    b'{"name": "a", "descr': ":1: unterminated string",
    b'{\n "name": "a",\n "look" {}\n}': ":3: expecting",
    f'{{"name": "a", "description": "{"a" * 201}", "look": {{}}}}'.encode(): "201 characters, more",
    HEAD.encode() + b'}, "picture": "iVBORw0KGgo="}': "unknown entry 'picture'",
}


@pytest.mark.parametrize(("data", "expected"), HOSTILE.items(), ids=range(len(HOSTILE)))
def test_hostile_files(data, expected, tmp_path, error_of):
    path = tmp_path / "a.json"
    path.write_bytes(data)
    message = error_of(read_preset, path)
    assert message.startswith(str(path)) and expected in message
    assert len(message) < len(str(path)) + 200 and message.isprintable()


def test_an_endless_file_is_refused(tmp_path, error_of):
    """It does not fill the memory."""
    if not Path("/dev/zero").exists():
        pytest.skip("there is no /dev/zero")
    link = tmp_path / "a.json"
    link.symlink_to("/dev/zero")
    assert "not a regular file" in error_of(read_preset, link)


# --- names -----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        *(("  Ink / pen:  2 ", "ink-pen-2"), ("Чернила №5", "чернила-5"), ("e\u0301tude", "étude")),
        *(("../../etc/passwd", "etc-passwd"), ("C:\\Windows\\ink", "c-windows-ink")),
        *(("a.json", "a-json"), ("CON", "con-preset"), ("lpt1", "lpt1-preset")),
        *(("~", None), ("", None)),
    ],
)
def test_keys_of_names(name, expected):
    assert key(name) == expected


@given(NAMES)
def test_keys_are_valid_file_names_everywhere(name):
    stem = preset_key(name)
    assert Path(stem).name == stem and not set(stem) & set('<>:"/\\|?* .\0')
    assert len(stem.encode()) <= 240 and preset_key(stem) == stem


# --- presets of the user ---------------------------------------------------------------------


@pytest.mark.slow
def test_a_saved_preset_is_found(user_folder):
    assert save_preset(MINE, user_folder) == "my-ink"
    assert load_preset("my-ink", user_folder) == load_preset("My Ink", user_folder) == MINE
    assert preset_keys(user_folder) == [*preset_keys(), "my-ink"]
    assert sorted(path.name for path in user_folder.iterdir()) == ["my-ink.json", "my-ink.png"]
    with Image.open(user_folder / "my-ink.png") as picture:
        pixels = np.asarray(picture)[::-1]
    np.testing.assert_array_equal(pixels, to_srgb_uint8(draw_preview(MINE.look)), strict=True)


def test_presets_are_replaced_only_on_request(user_folder, blank_previews, error_of):
    save_preset(MINE, user_folder)
    other = MINE._replace(name="my INK", look=Look(length=7))
    assert "preset 'my-ink' already exists" in error_of(save_preset, other, user_folder)
    assert load_preset("my-ink", user_folder) == MINE
    assert save_preset(other, user_folder, replace=True) == "my-ink"
    assert load_preset("my-ink", user_folder) == other


@pytest.mark.parametrize("replace", [False, True])
@pytest.mark.parametrize("name", ["pLAID!", "Print at 300 dpi", "print 300 dpi"])
def test_shipped_presets_cannot_be_replaced(user_folder, blank_previews, error_of, replace, name):
    message = error_of(save_preset, MINE._replace(name=name), user_folder, replace=replace)
    assert f"'{name}' is the name of a preset of RoSy" in message and not user_folder.exists()


@pytest.mark.parametrize("key", preset_keys())
def test_presets_are_found_by_their_names(key, user_folder):
    preset = load_preset(key)
    for name in (key.title(), preset.name, preset.name.upper()):
        assert load_preset(name, user_folder) == preset


def test_rename(user_folder, blank_previews, error_of):
    save_preset(MINE, user_folder)
    save_preset(MINE._replace(name="Other"), user_folder)
    assert rename_preset("my-ink", "Your Ink", "Longer lines", user_folder) == "your-ink"
    assert load_preset("your-ink", user_folder) == Preset("Your Ink", "Longer lines", MINE.look)
    names = {"other.json", "other.png", "your-ink.json", "your-ink.png"}
    assert {path.name for path in user_folder.iterdir()} == names
    assert rename_preset("your-ink", "YOUR ink!", "", user_folder) == "your-ink"
    assert load_preset("your-ink", user_folder).name == "YOUR ink!"
    for arguments in (("your-ink", "Other"), ("your-ink", "Plaid"), ("plaid", "My Plaid")):
        error_of(rename_preset, *arguments, "", user_folder)
    assert "must be one line" in error_of(rename_preset, "your-ink", "a\nb", "", user_folder)
    assert {path.name for path in user_folder.iterdir()} == names


@pytest.mark.parametrize("name", ["plaid", "../my-ink", "/etc/passwd", "nobody", "my-ink.json", ""])
def test_only_user_presets_are_deleted(user_folder, blank_previews, error_of, name):
    save_preset(MINE, user_folder)
    assert "not one of your presets" in error_of(remove_preset, name, user_folder / "..")
    assert "not one of your presets" in error_of(remove_preset, name, user_folder)
    assert (user_folder / "my-ink.json").exists() and (SHIPPED_FOLDER / "plaid.json").exists()
    remove_preset("my-ink", user_folder)
    assert list(user_folder.iterdir()) == [] and preset_keys(user_folder) == preset_keys()


def test_user_presets_precede_shipped_ones(user_folder, tmp_path):
    """A preset that a later version of RoSy ships does not replace the user's."""
    user_folder.mkdir()
    write_preset(user_folder / "plaid.json", MINE)
    assert load_preset("plaid", user_folder) == MINE and load_preset("plaid") != MINE
    assert preset_keys(user_folder).count("plaid") == 1


def test_a_folder_that_cannot_be_created(tmp_path, blank_previews, error_of):
    (tmp_path / "own").write_text("a file")
    assert str(tmp_path / "own") in error_of(save_preset, MINE, tmp_path / "own")


@pytest.mark.parametrize("platform", ["linux", "darwin", "win32"])
def test_user_folder_outside_blender(platform, monkeypatch, tmp_path):
    monkeypatch.setattr(sys, "platform", platform)
    variables = "ROSY_PRESETS", "XDG_DATA_HOME", "APPDATA"
    for name in variables:
        monkeypatch.delenv(name, raising=False)
    folder = store.default_user_folder()
    assert folder.is_relative_to(Path.home()) and folder.parts[-2:] == ("rosy", "presets")
    for name in variables:
        monkeypatch.setenv(name, "")
    assert store.default_user_folder() == folder
    monkeypatch.setenv("ROSY_PRESETS", str(tmp_path))
    assert store.default_user_folder() == tmp_path


# --- previews --------------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize("name", mainly(preset_keys()[::4], preset_keys()))
def test_shipped_previews_show_their_looks(name):
    """After a change of a look or of its drawing, run `python -m tools.gallery preset-pictures`."""
    path = preset_files()[name]
    with Image.open(preview_path(path)) as picture:
        assert picture.size == (PREVIEW_SIZE, PREVIEW_SIZE)
        stored = np.asarray(picture.convert("RGB"), dtype=np.float64)[::-1]
    assert preview_path(path).stat().st_size < 80_000
    assert stored.std() > 15, "blank"
    drawn = to_srgb_uint8(draw_preview(read_preset(path).look))[..., :3]
    assert np.corrcoef(stored.ravel(), drawn.ravel())[0, 1] > 0.85


@pytest.mark.slow
@pytest.mark.parametrize(
    "look",
    [
        Look(method="brute", length=8000),
        Look(light="scene", display="flat", hue="values", tone="attribute"),
        *map(random_look, range(4)),
    ],
)
def test_every_look_has_a_preview(look):
    picture = draw_preview(look)
    assert picture.shape == (PREVIEW_SIZE, PREVIEW_SIZE, 4) and picture.dtype == np.float32
    assert np.isfinite(picture).all() and (picture[..., 3] == 1).all()


# --- the command line ------------------------------------------------------------------------


@pytest.fixture
def saved_folder(user_folder, blank_previews, monkeypatch):
    monkeypatch.setenv("ROSY_PRESETS", str(user_folder))
    save_preset(MINE, user_folder)
    return user_folder


def test_list_presets(saved_folder, capsys):
    (saved_folder / "broken.json").write_text("{")
    assert main(["presets", "--json"]) == 0
    output = capsys.readouterr()
    listed = {each["preset"]: each for each in json.loads(output.out)}
    assert list(listed) == [*preset_keys(), "my-ink"]
    expected = {"preset": "my-ink", "name": "My Ink", "description": "Long lines", "own": True}
    assert listed["my-ink"] == expected and not listed["plaid"]["own"]
    (line,) = output.err.splitlines()
    assert "broken.json:1: expecting" in line and main(["presets"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert any(line.startswith("plaid ") and "Broad bands" in line for line in lines)
    assert any(line.startswith("my-ink ") and line.endswith("Long lines  (own)") for line in lines)
    assert str(saved_folder) in lines[-1]


def test_render_with_a_preset_by_name_and_by_path(saved_folder, tmp_path):
    """The default preset is no preset."""
    mesh, out, pictures = write_cube(tmp_path / "a.obj"), tmp_path / "a.png", []
    for preset in ("my-ink", "My Ink", saved_folder / "my-ink.json", "default", None):
        options = ["--generate", "axis", "--size", "48x48"]
        options += [] if preset is None else ["--preset", str(preset)]
        assert main(["render", str(mesh), "-o", str(out), *options]) == 0
        pictures.append(out.read_bytes())
    ink, *others, default, plain = pictures
    assert others == [ink, ink] and default == plain != ink
