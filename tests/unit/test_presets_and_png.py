"""Looks as files, and pictures as files."""

from __future__ import annotations

import json
import struct
import zlib

import numpy as np
import pytest

from rosy_addon.compositor.colour import to_display
from rosy_addon.compositor.look import Look
from rosy_addon.compositor.png import write_png
from rosy_addon.compositor.presets import FOLDER, load_preset, preset_names


def test_presets_that_come_with_rosy_load():
    assert {"paper", "plaid", "pen-and-ink", "magnitude-map"} <= set(preset_names())
    for name in preset_names():
        preset = load_preset(name)
        assert preset.name and preset.description
        wanted = json.loads((FOLDER / f"{name}.json").read_text())["look"]
        assert {key: getattr(preset.look, key) for key in wanted} == wanted
        assert preset.look == Look(**wanted)


BAD = {
    "{": ":1: expecting",
    '{\n "name": "a",\n "look" {}\n}': ":3: expecting",
    "[1]": "a preset is an object",
    "\0\1": "binary data",
    '{"name": "a", "description": "b"}': "a preset needs a 'look'",
    '{"name": "a", "description": "b", "look": 3}': "'look' is not an object",
    '{"name": "a", "description": "b", "look": {}, "author": "c"}': "has no 'author'",
    '{"name": "a", "description": "b", "look": {"lenght": 3}}': "no setting 'lenght'",
    '{"name": "a", "description": "b", "look": {"length": -3}}': "setting 'length' is -3",
    '{"name": "a", "description": "b", "look": {"length": "long"}}': "setting 'length' is 'long'",
    '{"name": "a", "description": "b", "look": {"gain": NaN}}': "setting 'gain' is nan",
    '{"name": "a", "description": "b", "look": {"noise": "brown"}}': "setting 'noise' is 'brown'",
}


@pytest.mark.parametrize("text", BAD)
def test_what_is_wrong_with_a_preset_is_said(text, tmp_path, error_of):
    path = tmp_path / "mine.json"
    path.write_text(text)
    message = error_of(load_preset, path)
    assert str(path) in message
    assert BAD[text] in message


def test_missing_presets(tmp_path, error_of):
    message = error_of(load_preset, "papier")
    assert "no preset is named 'papier'" in message and "paper" in message
    assert "no such file" in error_of(load_preset, tmp_path / "none.json")


def chunks_of(data: bytes) -> dict[bytes, bytes]:
    """A reader of its own: checks signature and sums, and gives the chunks by name."""
    assert data[:8] == b"\x89PNG\r\n\x1a\n"
    found, place = {}, 8
    while place < len(data):
        (size,) = struct.unpack(">I", data[place : place + 4])
        name, body = data[place + 4 : place + 8], data[place + 8 : place + 8 + size]
        assert struct.unpack(">I", data[place + 8 + size : place + 12 + size])[0] == zlib.crc32(
            name + body
        )
        found[name] = body
        place += 12 + size
    first, *_, last = found
    assert (first, last) == (b"IHDR", b"IEND")
    return found


def test_png_holds_the_picture_as_srgb_from_the_top(tmp_path):
    generator = np.random.default_rng(0)
    rgba = generator.random((5, 7, 4), dtype=np.float32) * 1.2 - 0.1
    write_png(tmp_path / "a.png", rgba)
    chunks = chunks_of((tmp_path / "a.png").read_bytes())
    assert struct.unpack(">IIBBBBB", chunks[b"IHDR"]) == (7, 5, 8, 6, 0, 0, 0)
    assert chunks[b"sRGB"] == b"\0"
    rows = np.frombuffer(zlib.decompress(chunks[b"IDAT"]), np.uint8).reshape(5, 1 + 7 * 4)
    assert not rows[:, 0].any()
    found = rows[::-1, 1:].reshape(5, 7, 4).astype(float) / 255
    assert np.abs(found[..., :3] - to_display(rgba[..., :3])).max() <= 0.5 / 255 + 1e-6
    assert np.abs(found[..., 3] - np.clip(rgba[..., 3], 0, 1)).max() <= 0.5 / 255 + 1e-6


def test_middle_grey_on_screen_is_128(tmp_path):
    linear = np.full((1, 1, 4), 0.21404114, dtype=np.float32)
    write_png(tmp_path / "a.png", linear)
    data = zlib.decompress(chunks_of((tmp_path / "a.png").read_bytes())[b"IDAT"])
    assert data[1:4] == bytes([128] * 3)


def test_unwritable_picture(tmp_path, error_of):
    rgba = np.zeros((2, 2, 4), dtype=np.float32)
    assert "there is no folder" in error_of(write_png, tmp_path / "no" / "a.png", rgba)
    assert "is a folder" in error_of(write_png, tmp_path, rgba)
