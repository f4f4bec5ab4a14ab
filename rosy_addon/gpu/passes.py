"""The shader passes, with the inputs, outputs and uniforms of each.

The sources are the GLSL files in the folder `glsl`. Their declarations are read here and removed from the
code, because each device writes declarations in its own form. There are two extensions to GLSL: a line
``#include "NAME"`` is replaced by another source file, and ``#pragma constant(NAME, NAME)`` lists switches:
integer uniforms whose values are compiled in as constants.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

from .defines import shader_defines

SHADER_FOLDER = Path(__file__).with_name("glsl")

#: Width and height of a work group, in pixels.
WORKGROUP_SIZE = (8, 8)

#: Names and GLSL types of the uniforms, or of the varyings, of a shader.
Uniforms = tuple[tuple[str, str], ...]

_INCLUDE = re.compile(r'^#include "(\S+)"\n', re.M)
_CONSTANTS = re.compile(r"^#pragma constant\(([\w, ]+)\)\n", re.M)
_DECLARATION = re.compile(
    r"^(?:layout\((\w+)\) )?(uniform|in|out) (?:writeonly )?(\w+) ([\w, ]+);\n", re.M
)


class Source(NamedTuple):
    """The code of source files, and the declarations in them.

    Attributes
    ----------
    code : str
        GLSL without declarations.
    textures : tuple of str
        Names of the textures that are read. Names that end in ``[]`` are texture arrays.
    images : dict of str to str
        Formats of the images that are written, by name. Names of array images end in ``[]``, too.
    uniforms : tuple of (str, str)
        Names and GLSL types.
    outputs : tuple of (str, str)
        Names and GLSL types of the outputs of a vertex or fragment shader.
    switches : tuple of str
        Names of the integer uniforms whose values are compiled in.
    """

    code: str
    textures: tuple[str, ...]
    images: dict[str, str]
    uniforms: Uniforms
    outputs: Uniforms
    switches: tuple[str, ...]


@cache
def read_source(*files: str) -> Source:
    """Return the code and the declarations of source files, joined in this order."""
    text = "".join(map(_with_includes, files))
    # By name, because several files may declare the same texture or uniform.
    textures: dict[str, str] = {}
    images: dict[str, str] = {}
    uniforms: dict[str, str] = {}
    outputs: dict[str, str] = {}
    for texel_format, storage, kind, names in _DECLARATION.findall(text):
        array = "[]" * kind.endswith("Array")
        for name in names.split(", "):
            if storage == "out":
                outputs[name] = kind
            elif kind.startswith("sampler2D"):
                textures[name + array] = kind
            elif kind.startswith("image2D"):
                images[name + array] = texel_format.upper()
            elif storage == "uniform":
                uniforms[name] = kind
    return Source(
        _DECLARATION.sub("", _CONSTANTS.sub("", text)),
        tuple(textures),
        images,
        tuple(uniforms.items()),
        tuple(outputs.items()),
        tuple(name for names in _CONSTANTS.findall(text) for name in names.split(", ")),
    )


def _with_includes(file: str) -> str:
    text = (SHADER_FOLDER / file).read_text(encoding="utf-8")
    return _INCLUDE.sub(lambda include: _with_includes(include[1]), text)


@dataclass(frozen=True)
class ComputePass:
    """A compute shader over the pixels of an image.

    Attributes
    ----------
    name : str
        Name of the source file.
    formats : tuple of (str, str)
        Names and formats of images whose format differs from their declarations.
    constants : tuple of (str, int)
        Names and values of the uniforms that are compiled in; see `variant`.
    """

    name: str
    formats: tuple[tuple[str, str], ...] = ()
    constants: tuple[tuple[str, int], ...] = ()

    def variant(self, values: Mapping[str, Any]) -> ComputePass:
        """Return the shader with its switches compiled in as constants, given the values of all uniforms.

        The compiler then removes the code that is switched off. Otherwise the registers of that code
        would let fewer threads run at once.
        """
        switches = self.declared.switches
        return replace(self, constants=tuple((name, int(values[name])) for name in switches))

    @property
    def declared(self) -> Source:
        """The code of the shader, and the declarations in it."""
        return read_source(f"{self.name}.comp.glsl")

    @property
    def images(self) -> tuple[tuple[str, str], ...]:
        """Names and formats of the images that the shader writes. Names of array images end in ``[]``."""
        return tuple({**self.declared.images, **dict(self.formats)}.items())

    @property
    def uniforms(self) -> Uniforms:
        """Names and GLSL types of the uniforms that are not compiled in."""
        compiled_in = dict(self.constants)
        return tuple(entry for entry in self.declared.uniforms if entry[0] not in compiled_in)

    @property
    def source(self) -> str:
        """Code of the shader: GLSL without declarations."""
        constants = "".join(f"#define {name} {value}\n" for name, value in self.constants)
        common = read_source("common.glsl")
        return shader_defines() + constants + common.code + self.declared.code


@dataclass(frozen=True)
class RasterPass:
    """A vertex and a fragment shader for the triangles of a mesh.

    Attributes
    ----------
    name : str
        Name of the two source files.
    """

    name: str

    @property
    def vertex(self) -> Source:
        """The vertex shader. Its outputs are the inputs of the fragment shader."""
        return read_source(f"{self.name}.vert.glsl")

    @property
    def fragment(self) -> Source:
        """The fragment shader, without the definitions of constants. Its only output is a vec4."""
        return read_source("common.glsl", f"{self.name}.frag.glsl")

    @property
    def declared(self) -> Source:
        """The code of both shaders, and the declarations in it."""
        return read_source(f"{self.name}.vert.glsl", f"{self.name}.frag.glsl")

    @property
    def uniforms(self) -> Uniforms:
        """Names and GLSL types of the uniforms of both shaders."""
        return self.declared.uniforms


@cache
def all_passes() -> tuple[ComputePass | RasterPass, ...]:
    """Return all shader passes: one for each compute shader, one for each vertex and fragment shader pair."""
    kinds = {".comp.glsl": ComputePass, ".vert.glsl": RasterPass}
    return tuple(
        kind(path.name.removesuffix(end))
        for end, kind in kinds.items()
        for path in sorted(SHADER_FOLDER.glob(f"*{end}"))
    )
