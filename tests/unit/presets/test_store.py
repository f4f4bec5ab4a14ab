"""Presets of a user's own: kept, passed on, and read from strangers."""

from __future__ import annotations

import json
import os
import sys
from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest
from conftest import mainly
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from PIL import Image

from rosy_addon.cli import main
from rosy_addon.compositor.look import Look
from rosy_addon.errors import RosyError
from rosy_addon.image_io.png import to_srgb_uint8
from rosy_addon.presets import store
from rosy_addon.presets.preview import PREVIEW_SIZE, draw_preview
from rosy_addon.presets.store import (
    MAX_DESCRIPTION_LENGTH,
    MAX_FILE_BYTES,
    MAX_NAME_LENGTH,
    SHIPPED_FOLDER,
    Preset,
    changed_settings,
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
from rosy_addon.settings import Choice, Color, Switch


def value_of(entry):
    """Any value that a setting may have."""
    setting = entry.metadata["setting"]
    if isinstance(setting, Color):
        return st.integers(0, 0xFFFFFF).map("#{:06x}".format) | st.just("#AbCdEf")
    if isinstance(setting, Choice):
        return st.sampled_from(list(setting.options))
    if isinstance(setting, Switch):
        return st.booleans()
    if setting.is_integer:
        return st.integers(setting.low, setting.high)
    return st.floats(setting.low, setting.high)


LOOKS = st.fixed_dictionaries(
    {}, optional={entry.name: value_of(entry) for entry in fields(Look)}
).map(lambda values: Look(**values))
LINES = st.text(st.characters().filter(str.isprintable))
NAMES = LINES.filter(lambda name: any(sign.isalnum() for sign in name)).map(
    lambda name: name[:MAX_NAME_LENGTH] if key(name[:MAX_NAME_LENGTH]) else "a"
)


def key(name):
    try:
        return preset_key(name)
    except RosyError:
        return None


@pytest.fixture
def own(tmp_path):
    return tmp_path / "own"


@pytest.fixture
def undrawn(monkeypatch):
    """For tests of files alone: pictures of presets are small and black."""
    monkeypatch.setattr(store, "draw_preview", lambda look: np.zeros((4, 4, 4), dtype=np.float32))


MINE = Preset("My Ink", "Long lines", Look(ink="hatch", length=90, ink_colour="#102030"))


# --- files -----------------------------------------------------------------------------------


@settings(max_examples=150, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(name=NAMES, description=LINES.map(lambda line: line[:MAX_DESCRIPTION_LENGTH]), look=LOOKS)
def test_a_preset_is_read_as_it_was_written(tmp_path, name, description, look):
    path = tmp_path / "a.json"
    write_preset(path, Preset(name, description, look))
    assert read_preset(path) == Preset(name, description, look)
    stored = json.loads(path.read_text(encoding="utf-8"))["look"]
    assert stored == {
        entry.name: getattr(look, entry.name)
        for entry in fields(Look)
        if getattr(look, entry.name) != entry.default
    }


def test_files_are_readable_by_people(tmp_path):
    write_preset(tmp_path / "a.json", MINE._replace(name="Schrägstrich Ø"))
    assert (tmp_path / "a.json").read_text(encoding="utf-8").splitlines() == [
        "{",
        '  "name": "Schrägstrich Ø",',
        '  "description": "Long lines",',
        '  "look": {',
        '    "length": 90,',
        '    "ink": "hatch",',
        '    "ink_colour": "#102030"',
        "  }",
        "}",
    ]


def test_editors_that_begin_files_with_a_mark(tmp_path):
    write_preset(tmp_path / "a.json", MINE)
    (tmp_path / "b.json").write_bytes(b"\xef\xbb\xbf" + (tmp_path / "a.json").read_bytes())
    assert read_preset(tmp_path / "b.json") == MINE


def test_a_look_without_changes_has_no_settings():
    assert changed_settings(Look()) == {}
    assert changed_settings(Look(gain=2.5, seed=3)) == {"seed": 3}


#: Whether Python's reader of JSON gives up before the file ends; later ones may or may not.
SHALLOW = sys.version_info < (3, 14)

HEAD = '{"name": "a", "description": "b", "look": {'
HOSTILE = {
    "huge": (b" " * MAX_FILE_BYTES + b"{}", "larger than the limit of 65,536 bytes"),
    "deep list": (b"[" * 60_000, "nested too deeply" if SHALLOW else ""),
    "deep object": (b'{"a":' * 12_000, "nested too deeply" if SHALLOW else ""),
    "deep value": (
        (HEAD + '"gain": ' + "[" * 900 + "]" * 900 + "}}").encode(),
        "expected a number",
    ),
    "long number": ((HEAD + '"seed": ' + "9" * 5000 + "}}").encode(), "number that is too long"),
    "large number": ((HEAD + '"seed": ' + "9" * 3000 + "}}").encode(), "setting 'seed' is 999"),
    "NaN": ((HEAD + '"gain": NaN}}').encode(), "setting 'gain' is nan"),
    "infinite": ((HEAD + '"gain": 1e999}}').encode(), "setting 'gain' is inf"),
    "minus infinite": ((HEAD + '"gain": -Infinity}}').encode(), "setting 'gain' is -inf"),
    "list": (
        (HEAD + '"noise": ["grey"]}}').encode(),
        "setting 'noise' is ['grey'], expected one of",
    ),
    "object": ((HEAD + '"noise": {}}}').encode(), "setting 'noise' is {}, expected one of"),
    "null": ((HEAD + '"gain": null}}').encode(), "setting 'gain' is None, expected a number"),
    "bool": (
        (HEAD + '"length": true}}').encode(),
        "setting 'length' is True, expected a whole number",
    ),
    "half": (
        (HEAD + '"length": 1.5}}').encode(),
        "setting 'length' is 1.5, expected a whole number",
    ),
    "number": (
        (HEAD + '"view_plane": 1}}').encode(),
        "setting 'view_plane' is 1, expected true or",
    ),
    "colour": ((HEAD + '"ink_colour": "#12345g"}}').encode(), "'#12345g', expected a color"),
    "colour, line": ((HEAD + '"ink_colour": "#123456\\n"}}').encode(), "expected a color"),
    "twice": ((HEAD + '"gain": 1, "gain": 2}}').encode(), "'gain' appears twice"),
    "name twice": (b'{"name": "a", "name": "b"}', "'name' appears twice"),
    "newer": ((HEAD + '"sparkle": 1}}').encode(), "unknown setting 'sparkle': check its spelling"),
    "newer, long": ((HEAD + f'"{"x" * 60_000}": 1' + "}}").encode(), "unknown setting 'xxx"),
    "long text": ((HEAD + f'"noise": "{"x" * 60_000}"' + "}}").encode(), "setting 'noise' is 'xxx"),
    "lines in a key": ((HEAD + '"a\\nb": 1}}').encode(), "unknown setting 'a\\nb'"),
    "UTF-16": ('{"name": "a"}'.encode("utf-16"), "binary data"),
    "Latin-1": ('{"name": "Schräg"}'.encode("latin-1"), "not UTF-8"),
    "empty": (b"", ":1: expecting value"),
    "cut off": (b'{"name": "a", "descr', ":1: unterminated string"),
    "name, number": (
        b'{"name": 3, "description": "b", "look": {}}',
        "the name of the preset must be text, not 3",
    ),
    "name, list": (
        b'{"name": [], "description": "", "look": {}}',
        "the name of the preset must be text, not []",
    ),
    "name, empty": (b'{"name": "", "description": "b", "look": {}}', "a letter or a digit"),
    "name, dots": (b'{"name": "../..", "description": "b", "look": {}}', "a letter or a digit"),
    "name, long": (
        b'{"name": "' + b"a" * 49 + b'", "description": "b", "look": {}}',
        "has 49 characters, more than 48",
    ),
    "name, lines": (
        b'{"name": "a\\nb", "description": "", "look": {}}',
        "must be one line of text",
    ),
    "name, escape": (b'{"name": "a\\u001b[31m", "description": "", "look": {}}', "'a\\x1b[31m'"),
    "name, backward": (b'{"name": "a\\u202eb", "description": "", "look": {}}', "'a\\u202eb'"),
    "name, half a sign": (b'{"name": "a\\ud800", "description": "", "look": {}}', "'a\\ud800'"),
    "sentence, long": (
        b'{"name": "a", "description": "' + b"a" * 201 + b'", "look": {}}',
        "the description of the preset has 201 characters, more than 200",
    ),
    "picture": (
        b'{"name": "a", "description": "b", "look": {}, "picture": "iVBORw0KGgo="}',
        "unknown entry 'picture'",
    ),
}


@pytest.mark.parametrize("case", HOSTILE)
def test_files_of_strangers(case, tmp_path, error_of):
    data, wanted = HOSTILE[case]
    path = tmp_path / "a.json"
    path.write_bytes(data)
    message = error_of(read_preset, path)
    assert message.startswith(str(path)) and wanted in message
    assert len(message) < len(str(path)) + 200
    assert message.isprintable()


ANYTHING = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(), inner, max_size=3),
    max_leaves=5,
)


@pytest.mark.slow
@settings(max_examples=300, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    st.fixed_dictionaries(
        {
            "name": ANYTHING | NAMES,
            "description": ANYTHING | st.just(""),
            "look": ANYTHING
            | st.dictionaries(
                st.sampled_from([f.name for f in fields(Look)]), ANYTHING, max_size=2
            ),
        }
    )
)
def test_whatever_is_in_a_file_it_is_a_preset_or_refused(tmp_path, data):
    path = tmp_path / "a.json"
    path.write_text(json.dumps(data))
    try:
        preset = read_preset(path)
    except RosyError as refused:
        assert "\n" not in str(refused)
        return
    write_preset(path, preset)
    assert read_preset(path) == preset


def test_no_more_is_read_than_a_preset_can_be(tmp_path, error_of):
    """A file without end does not fill the memory."""
    if not Path("/dev/zero").exists():
        pytest.skip("there is no file without end")
    link = tmp_path / "a.json"
    link.symlink_to("/dev/zero")
    assert "binary" in error_of(read_preset, link)


# --- names -----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "wanted"),
    [
        ("My Ink", "my-ink"),
        ("  Ink / pen:  2 ", "ink-pen-2"),
        ("../../etc/passwd", "etc-passwd"),
        ("C:\\Windows\\ink", "c-windows-ink"),
        (".hidden", "hidden"),
        ("a.json", "a-json"),
        ("Чернила №5", "чернила-5"),
        ("e\u0301tude", "étude"),
        ("CON", "con-preset"),
        ("lpt1", "lpt1-preset"),
        ("~", None),
        ("", None),
    ],
)
def test_what_presets_are_called_by(name, wanted):
    assert key(name) == wanted


@given(NAMES)
def test_what_a_preset_is_called_by_is_the_name_of_a_file_anywhere(name):
    found = preset_key(name)
    assert Path(found).name == found and not set(found) & set('<>:"/\\|?* .\0')
    assert len(found.encode()) <= 240
    assert preset_key(found) == found


# --- one's own -------------------------------------------------------------------------------


@pytest.mark.slow
def test_saved_and_found_again(own):
    assert save_preset(MINE, own) == "my-ink"
    assert load_preset("my-ink", own) == load_preset("My Ink", own) == MINE
    assert preset_keys(own) == [*preset_keys(), "my-ink"]
    assert sorted(path.name for path in own.iterdir()) == ["my-ink.json", "my-ink.png"]
    with Image.open(own / "my-ink.png") as picture:
        assert picture.size == (PREVIEW_SIZE, PREVIEW_SIZE)
        np.testing.assert_array_equal(
            np.asarray(picture)[::-1], to_srgb_uint8(draw_preview(MINE.look)), strict=True
        )


def test_nothing_is_replaced_unless_asked(own, undrawn, error_of):
    save_preset(MINE, own)
    other = MINE._replace(name="my INK", look=Look(length=7))
    assert "preset 'my-ink' already exists" in error_of(save_preset, other, own)
    assert load_preset("my-ink", own) == MINE
    assert save_preset(other, own, replace=True) == "my-ink"
    assert load_preset("my-ink", own) == other


@pytest.mark.parametrize("replace", [False, True])
@pytest.mark.parametrize("name", ["Plaid", "pLAID!", "Print at 300 dpi", "print 300 dpi"])
def test_those_of_rosy_cannot_be_replaced(own, undrawn, error_of, replace, name):
    message = error_of(save_preset, MINE._replace(name=name), own, replace=replace)
    assert f"'{name}' is the name of a preset of RoSy" in message
    assert not own.exists()


@pytest.mark.parametrize("key", preset_keys())
def test_found_by_the_name_that_users_see(key, own):
    preset = load_preset(key)
    assert load_preset(preset.name, own) == load_preset(preset.name.upper(), own) == preset


@pytest.mark.parametrize("name", ["../../outside", "/outside", "..\\outside", "out\0side"])
def test_nothing_is_written_outside_the_folder(own, undrawn, tmp_path, name):
    try:
        save_preset(MINE._replace(name=name), own)
    except RosyError as refused:
        assert "must be one line of text" in str(refused)
    inside = {path for path in tmp_path.rglob("*") if path.is_file()}
    assert {path.parent for path in inside} <= {own}


def test_renamed(own, undrawn, error_of):
    save_preset(MINE, own)
    save_preset(MINE._replace(name="Other"), own)
    assert rename_preset("my-ink", "Your Ink", "Longer lines", own) == "your-ink"
    assert load_preset("your-ink", own) == Preset("Your Ink", "Longer lines", MINE.look)
    names = {"other.json", "other.png", "your-ink.json", "your-ink.png"}
    assert {path.name for path in own.iterdir()} == names
    assert rename_preset("your-ink", "YOUR ink!", "", own) == "your-ink"
    assert load_preset("your-ink", own).name == "YOUR ink!"
    for refused in (("your-ink", "Other"), ("your-ink", "Plaid"), ("plaid", "My Plaid")):
        error_of(rename_preset, *refused, "", own)
    assert "must be one line" in error_of(rename_preset, "your-ink", "a\nb", "", own)
    assert {path.name for path in own.iterdir()} == names


@pytest.mark.parametrize("name", ["plaid", "../my-ink", "/etc/passwd", "nobody", "my-ink.json", ""])
def test_only_ones_own_are_deleted(own, undrawn, error_of, name):
    save_preset(MINE, own)
    assert "not one of your presets" in error_of(remove_preset, name, own / "..")
    assert "not one of your presets" in error_of(remove_preset, name, own)
    assert (own / "my-ink.json").exists() and (SHIPPED_FOLDER / "plaid.json").exists()


def test_deleted(own, undrawn):
    save_preset(MINE, own)
    remove_preset("my-ink", own)
    assert list(own.iterdir()) == [] and preset_keys(own) == preset_keys()


def test_own_ones_go_first(own, tmp_path):
    """A preset that a later RoSy brings along does not take the place of one's own."""
    own.mkdir()
    write_preset(own / "plaid.json", MINE)
    assert load_preset("plaid", own) == MINE and load_preset("plaid") != MINE
    assert preset_keys(own).count("plaid") == 1


@pytest.mark.skipif(os.name == "nt" or os.geteuid() == 0, reason="root may write anywhere")
def test_a_folder_that_cannot_be_written(own, undrawn, error_of):
    own.mkdir(mode=0o500)
    assert "permission denied" in error_of(save_preset, MINE, own)


def test_a_folder_that_cannot_be_made(tmp_path, undrawn, error_of):
    (tmp_path / "own").write_text("a file")
    assert str(tmp_path / "own") in error_of(save_preset, MINE, tmp_path / "own")


@pytest.mark.parametrize("platform", ["linux", "darwin", "win32"])
def test_where_ones_own_are_without_blender(platform, monkeypatch, tmp_path):
    monkeypatch.setattr(sys, "platform", platform)
    for name in ("ROSY_PRESETS", "XDG_DATA_HOME", "APPDATA"):
        monkeypatch.delenv(name, raising=False)
    found = store.default_user_folder()
    assert found.is_relative_to(Path.home()) and found.parts[-2:] == ("rosy", "presets")
    monkeypatch.setenv("ROSY_PRESETS", str(tmp_path))
    assert store.default_user_folder() == tmp_path


# --- pictures --------------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize("name", mainly(preset_keys()[::4], preset_keys()))
def test_pictures_of_presets_are_of_their_looks(name):
    """If a look or how it is drawn has changed: `python -m tools.gallery preset-pictures`."""
    path = preset_files()[name]
    with Image.open(preview_path(path)) as picture:
        assert picture.size == (PREVIEW_SIZE, PREVIEW_SIZE)
        shown = np.asarray(picture.convert("RGB"), dtype=np.float64)[::-1]
    assert preview_path(path).stat().st_size < 80_000
    assert shown.std() > 15, "blank"
    drawn = to_srgb_uint8(draw_preview(read_preset(path).look))[..., :3]
    assert np.corrcoef(shown.ravel(), drawn.ravel())[0, 1] > 0.85


@pytest.mark.slow
@pytest.mark.parametrize(
    "look",
    [
        Look(method="brute", length=8000),
        Look(method="members", length=8000, step=0.05, noise="colour"),
        Look(grain=256.0, high_pass=1024.0, length=8000, supersampling=4),
        Look(anchor="surface", ink="hatch", clear_paper=True, layers=12, grain=0.5),
        Look(light="scene", hue="families", display="flat", magnitude="both"),
    ],
    ids=["brute", "members", "large", "ink", "others"],
)
def test_every_look_has_a_picture(look):
    picture = draw_preview(look)
    assert picture.shape == (PREVIEW_SIZE, PREVIEW_SIZE, 4) and picture.dtype == np.float32
    assert np.isfinite(picture).all() and (picture[..., 3] == 1).all()
    inside = picture[
        PREVIEW_SIZE // 4 : -PREVIEW_SIZE // 4, PREVIEW_SIZE // 4 : -PREVIEW_SIZE // 4, :3
    ]
    assert inside.std() > 0.03
    np.testing.assert_array_equal(picture, draw_preview(look))


@pytest.mark.slow
def test_pictures_tell_looks_apart():
    plain, long = draw_preview(Look()), draw_preview(Look(length=120))
    assert np.abs(plain - long).mean() > 0.01
    ink = Look(ink="hatch", paper_colour="#ff0000")
    corner = draw_preview(ink)[0, 0]
    np.testing.assert_allclose(corner, [1, 0, 0, 1], atol=1e-6)
    assert (draw_preview(replace(ink, clear_paper=True))[0, 0] == corner).all()


# --- the command line ------------------------------------------------------------------------


@pytest.fixture
def kept(own, undrawn, monkeypatch):
    monkeypatch.setenv("ROSY_PRESETS", str(own))
    save_preset(MINE, own)
    return own


def test_listed(kept, capsys):
    (kept / "broken.json").write_text("{")
    assert main(["presets", "--json"]) == 0
    said = capsys.readouterr()
    listed = {each["preset"]: each for each in json.loads(said.out)}
    assert list(listed) == [*preset_keys(), "my-ink"]
    assert listed["my-ink"] == {
        "preset": "my-ink",
        "name": "My Ink",
        "description": "Long lines",
        "own": True,
    }
    assert not listed["plaid"]["own"]
    (line,) = said.err.splitlines()
    assert "broken.json:1: expecting" in line
    assert main(["presets"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert any(line.startswith("plaid ") and "Broad bands" in line for line in lines)
    assert any(line.startswith("my-ink ") and line.endswith("Long lines  (own)") for line in lines)
    assert str(kept) in lines[-1]


def test_drawn_with_by_name_and_by_path(kept, tmp_path):
    mesh = tmp_path / "a.off"
    mesh.write_text("OFF\n4 4 0\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n3 0 2 1\n3 0 1 3\n3 1 2 3\n3 2 0 3\n")
    made = {}
    for preset in ("my-ink", "My Ink", kept / "my-ink.json", "default"):
        out = tmp_path / "a.png"
        words = ["--generate", "axis", "--size", "48x48", "--preset", str(preset)]
        assert main(["render", str(mesh), "-o", str(out), *words]) == 0
        made[str(preset)] = out.read_bytes()
    default = made.pop("default")
    assert len(set(made.values())) == 1 and default not in made.values()
