"""Shipped presets, and the errors of preset files."""

from __future__ import annotations

import json

import pytest

from rosy_addon.compositor.look import Look
from rosy_addon.preset_files.store import SHIPPED_FOLDER, load_preset, preset_keys


def test_shipped_presets_load():
    assert {"paper", "plaid", "pen-and-ink", "magnitude-map"} <= set(preset_keys())
    for name in preset_keys():
        preset = load_preset(name)
        assert preset.name and preset.description
        stored = json.loads((SHIPPED_FOLDER / f"{name}.json").read_text())["look"]
        assert {key: getattr(preset.look, key) for key in stored} == stored
        assert preset.look == Look(**stored)


BAD = {
    "{": ":1: expecting",
    '{\n "name": "a",\n "look" {}\n}': ":3: expecting",
    "[1]": "a preset must be a JSON object",
    "\0\1": "binary data",
    '{"name": "a", "description": "b"}': "the preset has no 'look'",
    '{"name": "a", "description": "b", "look": 3}': "'look' must be a JSON object",
    '{"name": "a", "description": "b", "look": {}, "author": "c"}': "unknown entry 'author'",
    '{"name": "a", "description": "b", "look": {"lenght": 3}}': "unknown setting 'lenght'",
    '{"name": "a", "description": "b", "look": {"length": -3}}': "setting 'length' is -3",
    '{"name": "a", "description": "b", "look": {"length": "long"}}': "setting 'length' is 'long'",
    '{"name": "a", "description": "b", "look": {"gain": NaN}}': "setting 'gain' is nan",
    '{"name": "a", "description": "b", "look": {"hue": "brown"}}': "setting 'hue' is 'brown'",
}


@pytest.mark.parametrize("text", BAD)
def test_errors_of_preset_files(text, tmp_path, error_of):
    path = tmp_path / "mine.json"
    path.write_text(text)
    message = error_of(load_preset, path)
    assert str(path) in message
    assert BAD[text] in message


def test_missing_presets(tmp_path, error_of):
    message = error_of(load_preset, "papier")
    assert "there is no preset 'papier'" in message and "paper" in message
    assert "no such file" in error_of(load_preset, tmp_path / "none.json")
