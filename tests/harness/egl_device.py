"""`EglDevice`: runs the shaders without Blender, on OpenGL with an EGL context."""

from collections.abc import Sequence
from typing import Any

import moderngl
import numpy as np

from rosy_addon.gpu.defines import shader_defines
from rosy_addon.gpu.device import Batches, Device, NamedValues
from rosy_addon.gpu.passes import WORKGROUP_SIZE, ComputePass, RasterPass

#: Components and data type of each texel format.
FORMATS = {"RGBA32F": (4, "f4"), "RGBA16F": (4, "f2"), "RG32F": (2, "f4"), "R32F": (1, "f4")}

#: A function that Blender defines for shaders that draw into its views.
BLENDER_DEFINES = "#define blender_srgb_to_framebuffer_space(color) (color)\n"


class EglDevice(Device):
    """A device on an EGL context."""

    def __init__(self) -> None:
        self.context = moderngl.create_standalone_context(backend="egl", require=430)
        self._shaders: dict[ComputePass | RasterPass, Any] = {}
        self.max_texture_size: int = self.context.info["GL_MAX_TEXTURE_SIZE"]

    @property
    def name(self) -> str:
        """The name of the renderer that the driver reports."""
        return self.context.info["GL_RENDERER"]

    def texture(
        self, size: Sequence[int], texel_format: str, layers: int = 0, data: Any = None
    ) -> Any:
        if texel_format == "DEPTH_COMPONENT32F":
            return self.context.depth_texture(size)
        components, dtype = FORMATS[texel_format]
        if data is not None:
            data = np.ascontiguousarray(data, dtype=dtype)
        if layers:
            return self.context.texture_array((*size, layers), components, data, dtype=dtype)
        return self.context.texture(size, components, data, dtype=dtype)

    def batch(self, vertices: np.ndarray) -> Any:
        return self.context.buffer(np.ascontiguousarray(vertices, dtype=np.float32))

    def compute(
        self, shader: ComputePass, size: Sequence[int], textures: NamedValues, uniforms: NamedValues
    ) -> None:
        program = self._bind(shader, textures, uniforms)
        for slot, (name, _) in enumerate(shader.images):
            textures[_base_name(name)].bind_to_image(slot, read=False, write=True)
        width, height, layers = size
        program.run(-(-width // WORKGROUP_SIZE[0]), -(-height // WORKGROUP_SIZE[1]), layers)
        self.context.memory_barrier()

    def draw(self, shader: RasterPass, batches: Batches, color: Any, depth: Any) -> None:
        framebuffer = self.context.framebuffer([color], depth)
        framebuffer.use()
        framebuffer.clear(depth=1.0)
        self.context.enable_only(moderngl.DEPTH_TEST | moderngl.CULL_FACE)
        for culled in ("back", "front"):
            self.context.cull_face = culled
            for batch, item_uniforms in batches:
                program = self._bind(shader, {}, item_uniforms)
                self.context.vertex_array(program, [(batch, "4f", "vertex_data")]).render()

    def read(self, texture: Any) -> np.ndarray:
        texels = np.frombuffer(texture.read(), np.float32)
        return texels.reshape(texture.height, texture.width, 4)

    def finish(self) -> None:
        """Wait until all commands have finished."""
        self.context.finish()

    def _bind(
        self, shader: ComputePass | RasterPass, textures: NamedValues, uniforms: NamedValues
    ) -> Any:
        program = self._program(shader)
        for slot, name in enumerate(shader.declared.textures):
            textures[_base_name(name)].use(slot)
            if _base_name(name) in program:
                program[_base_name(name)] = slot
        for name, _ in shader.uniforms:
            # Drivers remove uniforms that have no effect.
            if name in program:
                program[name] = uniforms[name]
        return program

    def _compiled(self, shader: ComputePass | RasterPass) -> Any:
        header = "#version 430\n"
        for name in shader.declared.textures:
            header += f"uniform sampler2D{'Array' * name.endswith('[]')} {_base_name(name)};\n"
        for name, kind in shader.uniforms:
            header += f"uniform {kind} {name};\n"
        if isinstance(shader, ComputePass):
            header += (
                f"layout(local_size_x={WORKGROUP_SIZE[0]}, local_size_y={WORKGROUP_SIZE[1]}) in;\n"
            )
            for slot, (name, kind) in enumerate(shader.images):
                header += (
                    f"layout({kind.lower()}, binding={slot}) writeonly uniform "
                    f"image2D{'Array' * name.endswith('[]')} {_base_name(name)};\n"
                )
            return self.context.compute_shader(header + shader.source)
        varyings = [
            f"{'flat ' * (name == 'triangle_id')}{{}} {kind} {name};\n"
            for name, kind in shader.vertex.outputs
        ]
        outputs = "".join(varying.format("out") for varying in varyings)
        vertex = header + "in vec4 vertex_data;\n" + outputs
        fragment = header + BLENDER_DEFINES + f"out vec4 {shader.fragment.outputs[0][0]};\n"
        fragment += "".join(varying.format("in") for varying in varyings)
        fragment += shader_defines() + shader.fragment.code
        return self.context.program(vertex + shader.vertex.code, fragment_shader=fragment)


def _base_name(name: str) -> str:
    return name.removesuffix("[]")
