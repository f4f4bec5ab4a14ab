"""Constants that shaders share with numpy are written once: a check without a graphics card."""

from __future__ import annotations

import re

import numpy as np
import pytest

from rosy_addon.gpu import defines, mesh_buffers, passes

SOURCES = {
    path.name: re.sub(r"//[^\n]*", "", path.read_text(encoding="utf-8"))
    for path in sorted(passes.SHADER_FOLDER.glob("*.glsl"))
}
DEFINED = dict(
    line.removeprefix("#define ").split(" ", 1) for line in defines.shader_defines().splitlines()
)

#: Values that shaders also use for other purposes.
COMMON = {0.0, 0.001, 0.25, 0.5, 1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 13.0, 16.0, 64.0}


def constants_of(code):
    """Return the names in capitals, of at least two characters."""
    return set(re.findall(r"\b[A-Z][A-Z0-9_]+\b", code))


def literals_of(code):
    """Return the values of all numbers in a source."""
    numbers = re.findall(r"(?<![\w.])(?:0x[0-9A-Fa-f]+|\d+\.?\d*(?:e[+-]?\d+)?)u?\b", code)
    return {
        float(int(text.rstrip("u"), 16) if text.startswith("0x") else text.rstrip("u"))
        for text in numbers
    }


def test_every_constant_is_defined_and_used():
    code = "".join(SOURCES.values())
    local = set(re.findall(r"#define\s+(\w+)", code))
    assert set(DEFINED) <= constants_of(code) <= local | set(DEFINED)


@pytest.mark.parametrize("name", SOURCES)
def test_shaders_have_no_literal_where_there_is_a_define(name):
    shared = {
        *(value for values in defines.CONSTANTS.values() for value in np.ravel(values).tolist()),
        *defines.UNSIGNED_CONSTANTS.values(),
    }
    assert not literals_of(SOURCES[name]) & ({float(value) for value in shared} - COMMON)


def test_shaders_read_records_by_named_texels():
    for name, code in SOURCES.items():
        assert not re.search(r"\brecord_texel\(\w+,\s*\d", code), name
    last = mesh_buffers.record_texels(0) - 1
    assert mesh_buffers.NORMAL_TEXEL == mesh_buffers.POSITION_TEXEL + 3
    assert mesh_buffers.VALUE_TEXEL == mesh_buffers.NORMAL_TEXEL + 3
    assert last == mesh_buffers.VALUE_TEXEL + 2


@pytest.mark.parametrize(
    "name", [name for name, value in defines.CONSTANTS.items() if isinstance(value, float)]
)
def test_literals_round_to_the_same_number(name):
    text = DEFINED[name].strip("()")
    assert "." in text or "e" in text, "GLSL would read an integer"
    assert np.float32(text) == np.float32(defines.CONSTANTS[name])
