"""The sources of shaders and their declarations, as far as they can be checked without a graphics card."""

import re

import numpy as np
import pytest

from rosy_addon.gpu import defines, passes
from rosy_addon.gpu.device import UNIFORM_WORDS, _pack_uniforms, _std140_order

PASSES = passes.all_passes()
each_pass = pytest.mark.parametrize("shader", PASSES, ids=lambda shader: shader.name)

#: Files without comments, and the constants that they share with numpy.
SOURCES = {
    path.name: re.sub(r"//[^\n]*", "", path.read_text(encoding="utf-8"))
    for path in sorted(passes.SHADER_FOLDER.glob("*.glsl"))
}
DEFINED = dict(
    line.removeprefix("#define ").split(" ", 1) for line in defines.shader_defines().splitlines()
)


@each_pass
def test_uniforms_are_aligned_as_in_std140(shader):
    """Each is at a multiple of its own size, without gaps, in whole rows of 16 bytes."""
    values = {
        name: tuple(range(100 * index, 100 * index + UNIFORM_WORDS[kind]))
        for index, (name, kind) in enumerate(shader.uniforms)
    }
    packed = _pack_uniforms(shader.uniforms, values)
    aligned = _std140_order(shader.uniforms)
    assert sorted(aligned) == sorted(shader.uniforms)
    offset = 0
    for name, kind in aligned:
        size = UNIFORM_WORDS[kind]
        assert offset % size == 0
        words = packed[offset : offset + size]
        words = words.view(np.int32) if kind in ("int", "ivec2") else words
        np.testing.assert_array_equal(words, values[name])
        offset += size
    assert len(packed) % 4 == 0 and 0 <= len(packed) - offset < 4


def code_of(shader):
    """Return the source of a pass without comments, and without the file that is common to all."""
    kinds = ("comp",) if isinstance(shader, passes.ComputePass) else ("vert", "frag")
    source = passes.read_source(*(f"{shader.name}.{kind}.glsl" for kind in kinds))
    return re.sub(r"//[^\n]*|/\*.*?\*/", "", source.code, flags=re.S)


def names_in(code):
    """Return the names in a source, except those after a dot, which are members."""
    return set(re.findall(r"(?<![.\w])[A-Za-z_]\w*", code))


@each_pass
def test_sources_use_all_names_of_their_pass(shader):
    """Names that are not declared are found by the compiler."""
    listed = {name for name, _ in shader.uniforms} | set(shader.declared.textures)
    if isinstance(shader, passes.RasterPass):
        listed |= {name for name, _ in shader.vertex.outputs + shader.fragment.outputs}
    else:
        listed |= {name for name, _ in shader.images}
    unused = {name.removesuffix("[]") for name in listed} - names_in(code_of(shader))
    assert not unused, f"not used: {sorted(unused)}"


@each_pass
def test_declarations_and_members(shader):
    """All declarations are read. With Vulkan, a member called length is the length of an array."""
    code = code_of(shader)
    assert not re.findall(r"^\s*(?:uniform|in|out|layout|#include|#pragma)\b.*", code, flags=re.M)
    assert not re.search(r"\.length\b", code)


@each_pass
def test_no_variable_has_the_name_of_a_uniform(shader):
    """In Blender uniforms are macros without scope: no variable or member may have their names."""
    code = code_of(shader)
    kinds = "float|int|bool|vec[234]|ivec[234]|mat[34]"
    declared = set(re.findall(rf"\b(?:{kinds})\s+(\w+)", code))
    declared |= set(re.findall(rf"\b(?:{kinds})\s[^;(]*?,\s*(\w+)\s*[=;,]", code))
    declared |= set(re.findall(r"(?<=[A-Za-z_\])])\.([A-Za-z_]\w*)", code))
    assert not declared & {name for name, _ in shader.uniforms}


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
