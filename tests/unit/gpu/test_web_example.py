"""The material of examples/web, whose GLSL repeats the formula of `compositor.ink_from_thresholds`."""

from pathlib import Path

import numpy as np
import pytest

from rosy_addon.compositor.ink_from_thresholds import ink_of_thresholds, layer_inks
from rosy_addon.compositor.look import Look
from rosy_addon.core.color import from_hex, to_linear

MATERIAL = Path(__file__).parents[3] / "examples" / "web" / "hatching_material.js"

#: What three.js provides, and a triangle that covers the picture.
COMMON = "float luminance(vec3 c) { return dot(c, vec3(0.2126729, 0.7151522, 0.0721750)); }"
VERTEX = """#version 330
out vec2 vUv;
out vec3 vNormal;
void main() {
  vUv = vec2(gl_VertexID & 1, gl_VertexID >> 1) * 2.0;
  vNormal = vec3(0.0, 0.0, 1.0);
  gl_Position = vec4(2.0 * vUv - 1.0, 0.0, 1.0);
}"""


def fragment_shader():
    """Return the shader of the material in the dialect of desktop OpenGL."""
    source = MATERIAL.read_text(encoding="utf-8")
    source = source.split("const FRAGMENT = /* glsl */ `")[1].split("`;")[0]
    source = source.replace("#include <common>", COMMON)
    source = source.replace("#include <colorspace_fragment>", "")
    for web, desktop in (("varying", "in"), ("texture2D", "texture"), ("gl_FragColor", "fragment")):
        source = source.replace(web, desktop)
    return "#version 330\nout vec4 fragment;\n" + source


@pytest.mark.parametrize(
    "settings",
    [
        {},
        {"hue": "tone", "crispness": 0.1},
        {"hue": "families", "layers": 2},
        {"ink_color": "#ffffff", "paper_color": "#101020", "layering": 0.1},
    ],
    ids=str,
)
def test_the_material_draws_the_ink_of_thresholds(device, settings):
    look = Look(ink="hatch", shading=1.0, **settings)
    pixels = np.random.default_rng(5).random((256, 4), dtype=np.float32)
    pixels[:128, 3] = np.square(2 * pixels[:128, :3] - 1).mean(axis=1)  # not filtered
    layers, inks = layer_inks(look, 6)
    uniforms = {
        "lightDirection": (0, 0, 1),
        "shading": 1,
        "black": 0,
        "white": 1,
        "gamma": 1,
        "layers": layers,
        "layering": look.layering,
        "crispness": look.crispness,
        "highlights": float(look.hue == "tone"),
        "highlightColor": tuple(to_linear(from_hex(look.ink_color_light))),
        "inks": [tuple(inks.dark[min(layer, len(inks.dark) - 1)]) for layer in range(3)],
        "paper": tuple(inks.paper),
    }
    context = device.context
    context.enable_only(context.NOTHING)
    program = context.program(VERTEX, fragment_shader=fragment_shader())
    context.texture((256, 1), 4, pixels.tobytes(), dtype="f4").use(0)
    target = context.framebuffer([context.texture((256, 1), 4, dtype="f4")])
    target.use()
    for name, value in uniforms.items():
        program[name] = value
    for tone in (0.0, 0.1, 0.35, 0.6, 0.9, 1.0):
        program["lightStrength"] = tone
        context.vertex_array(program, []).render(vertices=3)
        drawn = np.frombuffer(target.read(components=4, dtype="f4"), np.float32).reshape(256, 4)
        expected, _ = ink_of_thresholds(pixels, np.full(256, tone, np.float32), look, 6)
        np.testing.assert_allclose(drawn[:, :3], expected, atol=2e-4)
