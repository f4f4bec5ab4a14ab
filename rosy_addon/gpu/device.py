"""A thin layer over Blender's `gpu` module: textures, batches and shader runs.

Tests and benchmarks use a class with the same methods that needs no Blender.
"""

from collections.abc import Mapping, Sequence
from contextlib import suppress
from typing import Any

import numpy as np

from ..core.errors import DeviceError
from .defines import shader_defines
from .passes import WORKGROUP_SIZE, ComputePass, RasterPass, Uniforms

NamedValues = Mapping[str, Any]

#: Triangles to draw: vertex buffers, each with its own uniforms.
Batches = Sequence[tuple[Any, NamedValues]]

#: Name of the uniform block in shaders.
UNIFORM_BLOCK = "rosy_constants"

#: Number of 32-bit words of each GLSL type of uniform.
UNIFORM_WORDS = {"vec4": 4, "vec2": 2, "ivec2": 2, "float": 1, "int": 1}


class Device:
    """Blender's graphics context. Textures and batches are opaque handles.

    Attributes
    ----------
    max_texture_size : int
        Maximum side of a texture, in texels.

    Raises
    ------
    DeviceError
        If Blender has no graphics context.
    """

    def __init__(self) -> None:
        import gpu

        if not _is_usable(gpu):
            raise DeviceError(
                "Blender has no graphics context here: start it with a window, or use Blender 5.2 or "
                "later"
            )
        self._gpu = gpu
        self._shaders: dict[ComputePass | RasterPass, Any] = {}
        self.max_texture_size: int = gpu.capabilities.max_texture_size_get()

    def is_compiled(self, shader: ComputePass | RasterPass) -> bool:
        """Return whether a shader is compiled. A shader that is not compiled yet is compiled on first use."""
        return shader in self._shaders

    def compile(self, shader: ComputePass | RasterPass) -> None:
        """Compile a shader. If the driver rejects the shader, an error is raised only when it is used."""
        with suppress(DeviceError):
            self._program(shader)

    def texture(
        self, size: Sequence[int], texel_format: str, layers: int = 0, data: Any = None
    ) -> Any:
        """Return a new texture of a width and height; with `layers` above 0, an array of so many layers.

        `texel_format` is the name of a format in Blender's `gpu` module, such as "RGBA32F". `data` is the
        contents, (height, width, 4) float32, rows from the bottom. By default, the contents are undefined.
        """
        options = {}
        if data is not None:
            flat = np.ascontiguousarray(data, dtype=np.float32).reshape(-1)
            options["data"] = self._gpu.types.Buffer("FLOAT", len(flat), flat)
        return self._gpu.types.GPUTexture(size, layers=layers, format=texel_format, **options)

    def batch(self, vertices: np.ndarray) -> Any:
        """Return a vertex buffer of triangles from (3 T, 4) float32 corners.

        The last component of a corner is a number that vertex shaders read, such as the id of the triangle.
        """
        layout = self._gpu.types.GPUVertFormat()
        layout.attr_add(id="vertex_data", comp_type="F32", len=4, fetch_mode="FLOAT")
        buffer = self._gpu.types.GPUVertBuf(layout, len(vertices))
        buffer.attr_fill("vertex_data", np.ascontiguousarray(vertices, dtype=np.float32))
        return self._gpu.types.GPUBatch(type="TRIS", buf=buffer)

    def compute(
        self, shader: ComputePass, size: Sequence[int], textures: NamedValues, uniforms: NamedValues
    ) -> None:
        """Run a compute shader; `size` is the width, the height and the number of layers.

        `textures` are the textures and images that the shader reads and writes, and `uniforms` the values of
        its uniforms, both by their names there. A shader with switches must be the result of
        `ComputePass.variant`.
        """
        program, _block = self._bind(shader, textures, uniforms)
        for name, _ in shader.images:
            program.image(_base_name(name), textures[_base_name(name)])
        width, height, layers = size
        groups = -(-width // WORKGROUP_SIZE[0]), -(-height // WORKGROUP_SIZE[1]), layers
        self._gpu.compute.dispatch(program, *groups)

    def draw(self, shader: RasterPass, batches: Batches, color: Any, depth: Any) -> None:
        """Clear a color and a depth texture, and draw batches (vertex buffers with uniforms) into them."""
        state = self._gpu.state
        framebuffer = self._gpu.types.GPUFrameBuffer(depth_slot=depth, color_slots=(color,))
        saved = state.depth_test_get(), state.depth_mask_get(), state.blend_get()
        with framebuffer.bind():
            framebuffer.clear(color=(0.0, 0.0, 0.0, 0.0), depth=1.0)
            self._set_state("LESS", True, "NONE")
            try:
                # Front faces first: graphics cards skip fragments that are hidden behind them.
                for culled in ("BACK", "FRONT"):
                    state.face_culling_set(culled)
                    self._draw_batches(shader, batches, {}, {})
            finally:
                state.face_culling_set("NONE")
                self._set_state(*saved)

    def draw_to_view(
        self, shader: RasterPass, batches: Batches, textures: NamedValues, uniforms: NamedValues
    ) -> None:
        """Draw batches into the current 3D view, tested against the depths in it.

        `textures` and `uniforms` are shared by all batches, by their names in the shader.
        """
        # With depth writes, the picture is drawn once where surfaces overlap.
        self._set_state("LESS_EQUAL", True, "ALPHA")
        try:
            self._draw_batches(shader, batches, textures, uniforms)
        finally:
            self._set_state("NONE", False, "NONE")

    def _set_state(self, depth_test: str, depth_mask: bool, blend: str) -> None:
        """Set the depth test, depth writes and blending for all triangles that are drawn from now on.

        `depth_test` and `blend` are names of modes in ``gpu.state``, such as "LESS" and "ALPHA".
        """
        self._gpu.state.depth_test_set(depth_test)
        self._gpu.state.depth_mask_set(depth_mask)
        self._gpu.state.blend_set(blend)

    def viewport(self) -> tuple[int, int, int, int]:
        """Return x and y of the lower left corner, width and height of the current view, in pixels.

        The corner is relative to the frame buffer.
        """
        return tuple(self._gpu.state.viewport_get())

    def _draw_batches(
        self, shader: RasterPass, batches: Batches, textures: NamedValues, uniforms: NamedValues
    ) -> None:
        for batch, item_uniforms in batches:
            program, _block = self._bind(shader, textures, {**uniforms, **item_uniforms})
            batch.draw(program)

    def read(self, texture: Any) -> np.ndarray:
        """Return the (height, width, 4) float32 contents of a texture, rows from the bottom."""
        texels = np.asarray(texture.read(), dtype=np.float32)
        return texels.reshape(texture.height, texture.width, 4)

    def _bind(
        self, shader: ComputePass | RasterPass, textures: NamedValues, uniforms: NamedValues
    ) -> tuple[Any, Any]:
        """Bind a shader with its textures and uniforms.

        Return the program and its uniform block. The caller must keep the block until the run ends.
        """
        program = self._program(shader)
        program.bind()
        for name in shader.declared.textures:
            program.uniform_sampler(_base_name(name), textures[_base_name(name)])
        # A new block for each run: the device may not have read the previous one yet.
        block = self._gpu.types.GPUUniformBuf(_pack_uniforms(shader.uniforms, uniforms))
        program.uniform_block(UNIFORM_BLOCK, block)
        return program, block

    def _program(self, shader: ComputePass | RasterPass) -> Any:
        """Return the compiled shader.

        Raises
        ------
        DeviceError
            If the driver rejects the shader.
        """
        if shader not in self._shaders:
            try:
                self._shaders[shader] = self._compiled(shader)
            except Exception as error:
                raise DeviceError(
                    f"the graphics driver cannot compile the shader '{shader.name}': {error}"
                ) from error
        return self._shaders[shader]

    def _compiled(self, shader: ComputePass | RasterPass) -> Any:
        create = self._gpu.shader.create_from_info
        info = self._gpu.types.GPUShaderCreateInfo()
        for slot, name in enumerate(shader.declared.textures):
            kind = "FLOAT_2D_ARRAY" if name.endswith("[]") else "FLOAT_2D"
            info.sampler(slot, kind, _base_name(name))
        # A uniform block: some devices have too few push constants.
        members = "".join(f"{kind} {name}; " for name, kind in _std140_order(shader.uniforms))
        info.typedef_source(f"struct RosyConstants {{{members}}};\n")
        info.uniform_buf(0, "RosyConstants", UNIFORM_BLOCK)
        defines = "".join(f"#define {name} {UNIFORM_BLOCK}.{name}\n" for name, _ in shader.uniforms)
        if isinstance(shader, ComputePass):
            for slot, (name, format_) in enumerate(shader.images):
                kind = "FLOAT_2D_ARRAY" if name.endswith("[]") else "FLOAT_2D"
                info.image(slot, format_, kind, _base_name(name), qualifiers={"WRITE"})
            info.local_group_size(*WORKGROUP_SIZE)
            info.compute_source(defines + shader.source)
            return create(info)
        interface = self._gpu.types.GPUStageInterfaceInfo(f"rosy_{shader.name}")
        for name, kind in shader.vertex.outputs:
            (interface.flat if name == "triangle_id" else interface.smooth)(kind.upper(), name)
        info.vertex_in(0, "VEC4", "vertex_data")
        info.vertex_out(interface)
        info.fragment_out(0, "VEC4", shader.fragment.outputs[0][0])
        info.vertex_source(defines + shader.vertex.code)
        info.fragment_source(defines + shader_defines() + shader.fragment.code)
        return create(info)


_device: Device | None = None


def blender_device() -> Device:
    """Return the one device of this Blender. Later calls return the same object and compiled shaders.

    Raises
    ------
    DeviceError
        If Blender has no graphics context.
    """
    global _device
    if _device is None:
        _device = Device()
    return _device


def release() -> None:
    """Free the compiled shaders."""
    global _device
    _device = None


def _std140_order(uniforms: Uniforms) -> Uniforms:
    """Return uniforms in an order that the std140 layout aligns without gaps."""
    return tuple(sorted(uniforms, key=lambda uniform: -UNIFORM_WORDS[uniform[1]]))


def _pack_uniforms(uniforms: Uniforms, values: NamedValues) -> np.ndarray:
    """Return the values of a uniform block in the std140 layout, padded to whole rows of 16 bytes.

    The result is a flat float32 array. Integers are stored as floats with the same bits.
    """
    words: list[np.ndarray] = []
    for name, kind in _std140_order(uniforms):
        type_ = np.int32 if kind in ("int", "ivec2") else np.float32
        words.append(np.atleast_1d(np.asarray(values[name], dtype=type_)).view(np.float32))
    flat = np.concatenate(words)
    return np.concatenate([flat, np.zeros(-len(flat) % 4, dtype=np.float32)])


def _base_name(name: str) -> str:
    return name.removesuffix("[]")


def _is_usable(gpu: Any) -> bool:
    """Return whether there is a graphics context. If Blender has no window, try to create a context."""
    with suppress(SystemError):
        gpu.capabilities.max_texture_size_get()
        return True
    with suppress(SystemError, AttributeError):  # Blender before 5.2 has no `init`
        gpu.init()
        return True
    return False
