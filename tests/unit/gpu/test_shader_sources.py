"""The sources of shaders and their declarations, as far as they can be checked without a graphics card."""

from __future__ import annotations

import re

import numpy as np
import pytest

from rosy_addon.gpu import passes
from rosy_addon.gpu.device import UNIFORM_WORDS, _pack_uniforms, _std140_order

PASSES = passes.all_passes()
each_pass = pytest.mark.parametrize("shader", PASSES, ids=lambda shader: shader.name)


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
    return code_of_files(*(f"{shader.name}.{kind}.glsl" for kind in kinds))


def code_of_files(*files):
    return re.sub(r"//[^\n]*|/\*.*?\*/", "", passes.read_source(*files).code, flags=re.S)


def names_in(code):
    """Return the names in a source, except those after a dot, which are members."""
    return set(re.findall(r"(?<![.\w])[A-Za-z_]\w*", code))


def names_of(shader):
    """Return the uniforms of a pass, and its textures and images with the mark of arrays."""
    images = shader.images if isinstance(shader, passes.ComputePass) else ()
    textures = {*shader.declared.textures, *(name for name, _ in images)}
    return {name for name, _ in shader.uniforms}, textures


def listed_names(shader):
    uniforms, textures = names_of(shader)
    return uniforms | {name.removesuffix("[]") for name in textures}


@each_pass
def test_sources_use_all_names_of_their_pass_and_no_others(shader):
    """A pass that uses a uniform, texture or image of another pass has to declare it, too."""
    code, listed = code_of(shader), listed_names(shader)
    own = {"vertex_data"}  # the attribute of vertices
    if isinstance(shader, passes.RasterPass):
        results = {name for name, _ in shader.vertex.outputs + shader.fragment.outputs}
        assert results <= names_in(code)
        own |= results
    assert listed <= names_in(code), f"not used: {sorted(listed - names_in(code))}"
    # Parameters and variables that are declared in the source may have any name.
    kinds = r"(?:float|int|uint|bool|[iu]?vec[234])"
    declared = set(re.findall(rf"\b{kinds}\s+([A-Za-z_]\w*)", code))
    declared |= names_in(" ".join(re.findall(rf"\b{kinds}\s+[^;()]*;", code)))
    known = set().union(*map(listed_names, PASSES))
    used = names_in(code) & known - declared - listed - own
    assert not used, f"not declared: {sorted(used)}"


@each_pass
def test_declarations_and_members(shader):
    """All declarations are read. With Vulkan, a member called length is the length of an array."""
    code = code_of(shader)
    assert not re.findall(r"^\s*(?:uniform|in|out|layout|#include|#pragma)\b.*", code, flags=re.M)
    assert not re.search(r"\.length\b", code)
    for name in names_of(shader)[1]:
        access = rf"(?:texelFetch|imageStore)\({name.removesuffix('[]')},\s*(ivec[23])\("
        assert set(re.findall(access, code)) <= {"ivec3" if name.endswith("[]") else "ivec2"}


def test_common_code_uses_no_uniforms():
    """The common code is part of every pass: it gets uniforms only as parameters of functions."""
    known = {name for shader in PASSES for name, _ in shader.uniforms}
    known |= {name.removesuffix("[]") for shader in PASSES for name in shader.declared.textures}
    assert not names_in(code_of_files("common.glsl")) & known


@each_pass
def test_no_variable_has_the_name_of_a_uniform(shader):
    """In Blender uniforms are macros without scope: no variable or member may have their names."""
    code = code_of(shader)
    kinds = "float|int|bool|vec[234]|ivec[234]|mat[34]"
    declared = set(re.findall(rf"\b(?:{kinds})\s+(\w+)", code))
    declared |= set(re.findall(rf"\b(?:{kinds})\s[^;(]*?,\s*(\w+)\s*[=;,]", code))
    declared |= set(re.findall(r"(?<=[A-Za-z_\])])\.([A-Za-z_]\w*)", code))
    assert not declared & {name for name, _ in shader.uniforms}
