"""Constants that shaders share with numpy are written once: a check without a graphics card."""

import re

import numpy as np
import pytest

from rosy_addon.gpu import defines, passes

SOURCES = {
    path.name: re.sub(r"//[^\n]*", "", path.read_text(encoding="utf-8"))
    for path in sorted(passes.SHADER_FOLDER.glob("*.glsl"))
}
DEFINED = dict(
    line.removeprefix("#define ").split(" ", 1) for line in defines.shader_defines().splitlines()
)


def test_every_constant_is_defined_and_used():
    code = "".join(SOURCES.values())
    used = set(re.findall(r"\b[A-Z][A-Z0-9_]+\b", code))  # names in capitals
    local = set(re.findall(r"#define\s+(\w+)", code))
    assert set(DEFINED) <= used <= local | set(DEFINED)


def test_shaders_read_records_by_named_texels():
    for name, code in SOURCES.items():
        assert not re.search(r"\brecord_texel\(\w+,\s*\d", code), name


@pytest.mark.parametrize(
    "name", [name for name, value in defines.CONSTANTS.items() if isinstance(value, float)]
)
def test_literals_round_to_the_same_number(name):
    text = DEFINED[name].strip("()")
    assert "." in text or "e" in text, "GLSL would read an integer"
    assert np.float32(text) == np.float32(defines.CONSTANTS[name])
