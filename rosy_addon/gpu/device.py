"""Blender's `gpu` module as the few things that drawing a picture takes.

Another device (`Device`) may stand in for it where there is no Blender.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Protocol

import numpy as np

from ..errors import DeviceError
from .passes import GROUP, Compute, Constants, Drawing

Values = Mapping[str, Any]

#: What the block of a shader's constants is called in it.
BLOCK = "rosy_constants"

#: Words of 32 bits that a constant takes.
SIZES = {"vec4": 4, "vec2": 2, "ivec2": 2, "float": 1, "int": 1}


class Device(Protocol):
    """What a picture is drawn with. Textures and batches are handles that only it looks into.

    Attributes
    ----------
    largest : int
        Texels that a side of a texture may have.
    """

    largest: int

    def texture(
        self, width: int, height: int, kind: str, layers: int = 0, data: np.ndarray | None = None
    ) -> Any:
        """A texture of ``RGBA32F`` or ``RGBA16F``, an array if it has layers.

        `data` are (height, width, 4) float32 values for it.
        """

    def depth(self, width: int, height: int) -> Any:
        """A texture for depths."""

    def clear(self, texture: Any) -> None:
        """Set a texture to zero."""

    def batch(self, corners: np.ndarray) -> Any:
        """Triangles given by their (3 T, 4) float32 corners."""

    def compute(
        self,
        shader: Compute,
        size: Sequence[int],
        textures: Values,
        images: Values,
        constants: Values,
    ) -> None:
        """Run a shader for so many pixels across and up, and layers."""

    def draw(
        self,
        shader: Drawing,
        batches: Sequence[tuple[Any, Values]],
        target: tuple[Any, Any],
        constants: Values,
    ) -> None:
        """Draw batches, each with constants of its own, into a colour and a depth texture."""

    def draw_over(
        self,
        shader: Drawing,
        batches: Sequence[tuple[Any, Values]],
        textures: Values,
        constants: Values,
    ) -> None:
        """Draw batches into the view that is being drawn, where nothing is in front."""

    def viewport(self) -> tuple[int, int, int, int]:
        """Left, bottom, width and height of that view in what it is drawn into."""

    def read(self, texture: Any, width: int, height: int) -> np.ndarray:
        """(height, width, 4) float32: what is in a texture."""


class BlenderDevice:
    """The context that Blender draws with."""

    def __init__(self) -> None:
        import gpu

        if not _is_usable(gpu):
            raise DeviceError(
                "Blender has no graphics context here: it has one with a window, and from 5.1 on "
                "without"
            )
        self._gpu = gpu
        self._shaders: dict[str, Any] = {}
        self.largest: int = gpu.capabilities.max_texture_size_get()

    def texture(
        self, width: int, height: int, kind: str, layers: int = 0, data: np.ndarray | None = None
    ) -> Any:
        """As `Device.texture`."""
        more = {}
        if data is not None:
            flat = np.ascontiguousarray(data, dtype=np.float32).reshape(-1)
            more["data"] = self._gpu.types.Buffer("FLOAT", len(flat), flat)
        return self._gpu.types.GPUTexture((width, height), layers=layers, format=kind, **more)

    def depth(self, width: int, height: int) -> Any:
        """As `Device.depth`."""
        return self._gpu.types.GPUTexture((width, height), format="DEPTH_COMPONENT32F")

    def clear(self, texture: Any) -> None:
        """As `Device.clear`."""
        texture.clear(format="FLOAT", value=(0.0, 0.0, 0.0, 0.0))

    def batch(self, corners: np.ndarray) -> Any:
        """As `Device.batch`."""
        layout = self._gpu.types.GPUVertFormat()
        layout.attr_add(id="corner", comp_type="F32", len=4, fetch_mode="FLOAT")
        buffer = self._gpu.types.GPUVertBuf(layout, len(corners))
        buffer.attr_fill("corner", np.ascontiguousarray(corners, dtype=np.float32))
        return self._gpu.types.GPUBatch(type="TRIS", buf=buffer)

    def compute(
        self,
        shader: Compute,
        size: Sequence[int],
        textures: Values,
        images: Values,
        constants: Values,
    ) -> None:
        """As `Device.compute`."""
        program, _block = self._bound(shader, textures, constants)
        for name, _ in shader.images:
            program.image(_plain(name), images[_plain(name)])
        width, height, layers = (*size, 1)[:3]
        groups = -(-width // GROUP[0]), -(-height // GROUP[1]), layers
        self._gpu.compute.dispatch(program, *groups)

    def draw(
        self,
        shader: Drawing,
        batches: Sequence[tuple[Any, Values]],
        target: tuple[Any, Any],
        constants: Values,
    ) -> None:
        """As `Device.draw`."""
        state, (colour, depth) = self._gpu.state, target
        framebuffer = self._gpu.types.GPUFrameBuffer(depth_slot=depth, color_slots=(colour,))
        before = state.depth_test_get(), state.depth_mask_get(), state.blend_get()
        with framebuffer.bind():
            framebuffer.clear(color=(0.0, 0.0, 0.0, 0.0), depth=1.0)
            state.depth_test_set("LESS")
            state.depth_mask_set(True)
            state.blend_set("NONE")
            state.face_culling_set("NONE")
            try:
                self._draw(shader, batches, {}, constants)
            finally:
                state.depth_test_set(before[0])
                state.depth_mask_set(before[1])
                state.blend_set(before[2])

    def draw_over(
        self,
        shader: Drawing,
        batches: Sequence[tuple[Any, Values]],
        textures: Values,
        constants: Values,
    ) -> None:
        """As `Device.draw_over`."""
        state = self._gpu.state
        state.depth_test_set("LESS_EQUAL")
        # Of all that lies behind each other at a pixel the picture is drawn once.
        state.depth_mask_set(True)
        state.blend_set("ALPHA")
        try:
            self._draw(shader, batches, textures, constants)
        finally:
            state.blend_set("NONE")
            state.depth_mask_set(False)
            state.depth_test_set("NONE")

    def viewport(self) -> tuple[int, int, int, int]:
        """As `Device.viewport`."""
        return tuple(self._gpu.state.viewport_get())

    def _draw(
        self,
        shader: Drawing,
        batches: Sequence[tuple[Any, Values]],
        textures: Values,
        constants: Values,
    ) -> None:
        for batch, own in batches:
            program, _block = self._bound(shader, textures, {**constants, **own})
            batch.draw(program)

    def read(self, texture: Any, width: int, height: int) -> np.ndarray:
        """As `Device.read`."""
        return np.asarray(texture.read(), dtype=np.float32).reshape(height, width, 4)

    def _bound(
        self, shader: Compute | Drawing, textures: Values, constants: Values
    ) -> tuple[Any, Any]:
        """The program, ready to run, and the block of constants, which has to live till it ran."""
        program = self._program(shader)
        program.bind()
        for name in shader.textures:
            program.uniform_sampler(_plain(name), textures[_plain(name)])
        # A new one each time: what was run before may not have read its own yet.
        block = self._gpu.types.GPUUniformBuf(_packed(shader.constants, constants))
        program.uniform_block(BLOCK, block)
        return program, block

    def _program(self, shader: Compute | Drawing) -> Any:
        """The compiled shader.

        Raises
        ------
        DeviceError
            If the driver does not take it.
        """
        if shader.name not in self._shaders:
            try:
                self._shaders[shader.name] = self._gpu.shader.create_from_info(self._info(shader))
            except Exception as error:
                raise DeviceError(
                    f"the graphics driver does not take the shader '{shader.name}': {error}"
                ) from error
        return self._shaders[shader.name]

    def _info(self, shader: Compute | Drawing) -> Any:
        info = self._gpu.types.GPUShaderCreateInfo()
        for slot, name in enumerate(shader.textures):
            kind = "FLOAT_2D_ARRAY" if name.endswith("[]") else "FLOAT_2D"
            info.sampler(slot, kind, _plain(name))
        # Push constants would be too many for some devices.
        members = "".join(f"{kind} {name}; " for name, kind in _aligned(shader.constants))
        info.typedef_source(f"struct RosyConstants {{{members}}};\n")
        info.uniform_buf(0, "RosyConstants", BLOCK)
        named = "".join(f"#define {name} {BLOCK}.{name}\n" for name, _ in shader.constants)
        if isinstance(shader, Compute):
            for slot, (name, format_) in enumerate(shader.images):
                kind = "FLOAT_2D_ARRAY" if name.endswith("[]") else "FLOAT_2D"
                info.image(slot, format_, kind, _plain(name), qualifiers={"WRITE"})
            info.local_group_size(*GROUP)
            info.compute_source(named + shader.source)
            return info
        interface = self._gpu.types.GPUStageInterfaceInfo(f"rosy_{shader.name}")
        for name, kind in shader.varyings:
            (interface.flat if name == "triangle" else interface.smooth)(kind.upper(), name)
        info.vertex_in(0, "VEC4", "corner")
        info.vertex_out(interface)
        info.fragment_out(0, "VEC4", shader.target)
        info.vertex_source(named + shader.vertex_source)
        info.fragment_source(named + shader.fragment_source)
        return info


_device: BlenderDevice | None = None


def blender_device() -> BlenderDevice:
    """The one device, whose shaders are compiled once.

    Raises
    ------
    DeviceError
        If Blender has no graphics context.
    """
    global _device
    if _device is None:
        _device = BlenderDevice()
    return _device


def release() -> None:
    """Let go of the compiled shaders."""
    global _device
    _device = None


def _aligned(constants: Constants) -> Constants:
    """In an order in which each lies where the layout std140 wants it, without a gap."""
    return tuple(sorted(constants, key=lambda constant: -SIZES[constant[1]]))


def _packed(constants: Constants, values: Values) -> np.ndarray:
    """The bytes of a block of constants, whole rows of 16."""
    words: list[np.ndarray] = []
    for name, kind in _aligned(constants):
        type_ = np.int32 if kind in ("int", "ivec2") else np.float32
        words.append(np.atleast_1d(np.asarray(values[name], dtype=type_)).view(np.float32))
    flat = np.concatenate(words)
    return np.concatenate([flat, np.zeros(-len(flat) % 4, dtype=np.float32)])


def _plain(name: str) -> str:
    return name.removesuffix("[]")


def _is_usable(gpu: Any) -> bool:
    """Whether there is a graphics context, made here if Blender can make one without a window."""
    try:
        gpu.capabilities.max_texture_size_get()
    except SystemError:
        if not hasattr(gpu, "init"):
            return False
        try:
            gpu.init()
        except SystemError:
            return False
    return True
