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
        return replace(self, constants=tuple((name, int(values[name])) for name in self.switches))

    @property
    def _declared(self) -> Source:
        return read_source(f"{self.name}.comp.glsl")

    @property
    def switches(self) -> tuple[str, ...]:
        """Integer uniforms whose values are compiled in."""
        return self._declared.switches

    @property
    def textures(self) -> tuple[str, ...]:
        """Names of the textures that the shader reads. Names that end in ``[]`` are texture arrays."""
        return self._declared.textures

    @property
    def images(self) -> tuple[tuple[str, str], ...]:
        """Names and formats of the images that the shader writes. Names of array images end in ``[]``."""
        return tuple({**self._declared.images, **dict(self.formats)}.items())

    @property
    def uniforms(self) -> Uniforms:
        """Names and GLSL types of the uniforms that are not compiled in."""
        compiled_in = dict(self.constants)
        return tuple(
            uniform for uniform in self._declared.uniforms if uniform[0] not in compiled_in
        )

    @property
    def source(self) -> str:
        """Code of the shader: GLSL without declarations."""
        constants = "".join(f"#define {name} {value}\n" for name, value in self.constants)
        common = read_source("common.glsl")
        return shader_defines() + constants + common.code + self._declared.code


@dataclass(frozen=True)
class RasterPass:
    """A vertex and a fragment shader for the triangles of a mesh.

    Attributes
    ----------
    name : str
        Name of the two source files.
    """

    name: str
    switches = ()

    @property
    def _files(self) -> tuple[str, str]:
        return f"{self.name}.vert.glsl", f"{self.name}.frag.glsl"

    @property
    def textures(self) -> tuple[str, ...]:
        """Names of the textures that the shaders read."""
        return read_source(*self._files).textures

    @property
    def varyings(self) -> Uniforms:
        """Names and GLSL types of the values that the vertex shader passes on to the fragment shader."""
        return read_source(self._files[0]).outputs

    @property
    def output(self) -> str:
        """Name of the output variable of the fragment shader, a vec4."""
        return read_source(self._files[1]).outputs[0][0]

    @property
    def uniforms(self) -> Uniforms:
        """Names and GLSL types of the uniforms of both shaders."""
        return read_source(*self._files).uniforms

    @property
    def vertex_source(self) -> str:
        """Code of the vertex shader: GLSL without declarations."""
        return read_source(self._files[0]).code

    @property
    def fragment_source(self) -> str:
        """Code of the fragment shader: GLSL without declarations."""
        return shader_defines() + read_source("common.glsl", self._files[1]).code


@cache
def all_passes() -> tuple[ComputePass | RasterPass, ...]:
    """Return all shader passes: one for each compute shader, and one for each pair of other shaders."""
    names = sorted(path.name for path in SHADER_FOLDER.glob("*.glsl"))
    kinds = {".comp.glsl": ComputePass, ".vert.glsl": RasterPass}
    return tuple(
        kind(name.removesuffix(end))
        for end, kind in kinds.items()
        for name in names
        if name.endswith(end)
    )
