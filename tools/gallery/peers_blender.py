"""Draw Suzanne with Blender's own line renderers and with RoSy, in Blender 5.

    blender -b --factory-startup -P tools/gallery/peers_blender.py -- FOLDER [NAME ...]

All use the same mesh, camera and sun. Writes a .png for each into FOLDER, and `seconds.json` with the
processor time of each, including the render. If FOLDER is dist/peers,
`python -m tools.gallery peers` puts the pictures side by side.
"""

from __future__ import annotations

import importlib.util
import json
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import bpy
from mathutils import Vector

ROOT = Path(__file__).resolve().parents[2]

#: Size in pixels, twice that of the finished pictures.
WIDTH, HEIGHT = 804, 660
INK = (0.006, 0.006, 0.008)

#: Direction to the light in the space of the camera: the same as RoSy's lamp.
LAMP = Vector((-0.50, 0.60, 0.62)).normalized()

#: Position of the camera, and what it looks at.
EYE, TARGET = Vector((-2.62, -5.35, 0.88)), Vector((0, 0, -0.02))

#: Kinds of edges that a line set of Freestyle may draw.
EDGES = (
    *("silhouette", "border", "crease", "ridge_valley", "suggestive_contour"),
    *("material_boundary", "contour", "external_contour", "edge_mark"),
)

#: Bands of the shader: angle in degrees, and the tone below which they begin.
BANDS = ((40, 0.72), (-50, 0.45), (-5, 0.22))


def main() -> None:
    """Draw the named pictures, by default all."""
    folder, *names = sys.argv[sys.argv.index("--") + 1 :]
    load_rosy()
    seconds_path = Path(folder).resolve() / "seconds.json"
    seconds_path.parent.mkdir(parents=True, exist_ok=True)
    seconds = json.loads(seconds_path.read_text()) if seconds_path.exists() else {}
    for prepare in (line_art, freestyle, shader, rosy):
        name = prepare.__name__
        if not names or name in names:
            seconds[name] = time_drawing(prepare, seconds_path.with_name(f"{name}.png"))
            seconds_path.write_text(json.dumps(seconds, indent=1) + "\n", encoding="utf-8")


def time_drawing(prepare: Callable[[bpy.types.Object], None], path: Path) -> float:
    """Return the processor time of a second run, when shaders are already compiled, in seconds."""
    for _ in range(2):
        monkey = new_scene()
        start = time.process_time()
        prepare(monkey)
        bpy.context.scene.render.filepath = str(path)
        bpy.ops.render.render(write_still=True)
    return time.process_time() - start


def load_rosy() -> None:
    """Import the root of the repository as the package `rosy`, and register it."""
    spec = importlib.util.spec_from_file_location(
        "rosy", ROOT / "__init__.py", submodule_search_locations=[str(ROOT)]
    )
    module = importlib.util.module_from_spec(spec)
    sys.modules["rosy"] = module
    spec.loader.exec_module(module)
    module.register()


def configure(owner: Any, **values: Any) -> Any:
    """Set properties, and return their owner."""
    for name, value in values.items():
        setattr(owner, name, value)
    return owner


def new_scene() -> bpy.types.Object:
    """Open a scene with a white, subdivided Suzanne, a camera, a sun and a white background."""
    for obj in list(bpy.data.objects):
        bpy.data.objects.remove(obj)
    scene = bpy.context.scene
    scene.rosy.bakes.clear()
    bpy.ops.mesh.primitive_monkey_add()
    monkey = bpy.context.object
    # Two levels are applied, so that edges can be marked; a modifier adds one more.
    for levels in (2, 1):
        modifier = monkey.modifiers.new("Subdivision", "SUBSURF")
        configure(modifier, levels=levels, render_levels=levels)
        if levels == 2:
            bpy.ops.object.modifier_apply(modifier=modifier.name)
    bpy.ops.object.shade_smooth()
    monkey.data.materials.append(emission("White", (1, 1, 1, 1))[0])
    scene.camera = add("Camera", bpy.data.cameras.new("Camera"), EYE - TARGET)
    configure(scene.camera.data, lens=82, shift_x=-0.082, shift_y=-0.004)
    scene.camera.location = EYE
    bpy.context.view_layer.update()
    toward = scene.camera.matrix_world.to_3x3() @ LAMP
    sun = add("Sun", bpy.data.lights.new("Sun", "SUN"), toward)
    configure(sun.data, energy=3.14159, angle=0)
    scene.world = configure(bpy.data.worlds.new("White"), use_nodes=True)
    scene.world.node_tree.nodes["Background"].inputs["Color"].default_value = (1, 1, 1, 1)
    scene.view_settings.view_transform = "Standard"
    configure(scene.render, resolution_x=WIDTH, resolution_y=HEIGHT, resolution_percentage=100)
    # Few samples are enough for flat colors, which have no noise.
    configure(scene.render, use_freestyle=False, engine="CYCLES")
    configure(scene.cycles, device="CPU", samples=16, max_bounces=0)
    configure(scene.cycles, use_denoising=False, use_adaptive_sampling=False)
    return monkey


def add(name: str, data: bpy.types.ID, backward: Vector) -> bpy.types.Object:
    """Add a camera or a lamp that looks against a direction."""
    obj = bpy.data.objects.new(name, data)
    bpy.context.scene.collection.objects.link(obj)
    obj.rotation_euler = backward.to_track_quat("Z", "Y").to_euler()
    return obj


def emission(name: str, color: tuple[float, ...]) -> tuple[bpy.types.Material, bpy.types.Node]:
    """Return a material whose color does not depend on light, and its node."""
    material = configure(bpy.data.materials.new(name), use_nodes=True)
    nodes, links = material.node_tree.nodes, material.node_tree.links
    nodes.clear()
    glow = nodes.new("ShaderNodeEmission")
    glow.inputs["Color"].default_value = color
    links.new(glow.outputs[0], nodes.new("ShaderNodeOutputMaterial").inputs["Surface"])
    return material, glow


def set_taper(curve: Any, end: float) -> None:
    """Make a curve of thickness that is 1 in the middle of a line and `end` at its ends."""
    points = curve.curves[0].points
    points[0].location, points[1].location = (0, end), (1, end)
    points.new(0.5, 1.0)
    curve.update()


def line_art(monkey: bpy.types.Object) -> None:
    """Draw contours and creases with Line Art, thinner toward their ends."""
    bpy.ops.object.select_all(action="DESELECT")
    monkey.select_set(True)
    bpy.context.view_layer.objects.active = monkey
    bpy.ops.object.grease_pencil_add(type="LINEART_OBJECT")
    lines = bpy.context.object
    for material in lines.data.materials:
        material.grease_pencil.color = (*INK, 1)
    configure(lines.modifiers[0], radius=0.011, crease_threshold=2.53)
    configure(lines.modifiers[0], use_crease=True, use_crease_on_smooth=True)
    taper = lines.modifiers.new("Taper", "GREASE_PENCIL_THICKNESS")
    taper.use_custom_curve = True
    set_taper(taper.custom_curve, 0.15)


def freestyle(monkey: bpy.types.Object) -> None:
    """Draw with Freestyle: sketched contours, and marked edges in the shade as hatching."""
    mark_shaded_edges(monkey)
    scene, layer = bpy.context.scene, bpy.context.view_layer
    configure(scene.render, use_freestyle=True, line_thickness_mode="ABSOLUTE")
    layer.use_freestyle = True
    settings = configure(layer.freestyle_settings, use_smoothness=True)
    for lines in list(settings.linesets):
        settings.linesets.remove(lines)
    form = ("silhouette", "border", "crease", "external_contour", "suggestive_contour")
    add_sketched_lines(settings.linesets.new("Form"), form, thickness=3.2, shake=2.0)
    add_sketched_lines(settings.linesets.new("Shade"), ("edge_mark",), thickness=2.2, shake=1.2)


def mark_shaded_edges(monkey: bpy.types.Object) -> None:
    """Mark horizontal edges that face away from the sun, because Freestyle does not use light."""
    toward = bpy.data.objects["Sun"].matrix_world.to_3x3() @ Vector((0, 0, 1))
    mesh, name = monkey.data, "freestyle_edge"
    marks = mesh.attributes.get(name) or mesh.attributes.new(name, "BOOLEAN", "EDGE")
    for edge in mesh.edges:
        normal = sum((mesh.vertices[v].normal for v in edge.vertices), Vector()).normalized()
        start, end = (mesh.vertices[v].co for v in edge.vertices)
        is_level = abs((end - start).normalized().z) < 0.6
        marks.data[edge.index].value = is_level and normal.dot(toward) < 0.45


def add_sketched_lines(
    lines: bpy.types.FreestyleLineSet, edges: tuple[str, ...], thickness: float, shake: float
) -> None:
    """Draw kinds of edges as if sketched: twice, shaky, thinner toward their ends."""
    for name in EDGES:
        setattr(lines, f"select_{name}", name in edges)
    lines.linestyle = style = lines.linestyle or bpy.data.linestyles.new(lines.name)
    configure(style, color=INK, thickness=thickness, caps="ROUND")
    configure(style, use_chaining=True, chaining="SKETCHY", rounds=2)
    taper = style.thickness_modifiers.new("Taper", "ALONG_STROKE")
    configure(taper, mapping="CURVE", value_min=0.4, value_max=thickness)
    set_taper(taper.curve, 0)
    hand = style.geometry_modifiers.new("Hand", "PERLIN_NOISE_2D")
    configure(hand, frequency=8, amplitude=shake, octaves=2)


def shader(monkey: bpy.types.Object) -> None:
    """Draw with EEVEE: light as color, and bands across the window that get wider in the dark."""
    scene = bpy.context.scene
    scene.render.engine, scene.eevee.taa_render_samples = "BLENDER_EEVEE", 16
    material, glow = emission("Hatching", (1, 1, 1, 1))
    nodes, links = material.node_tree.nodes, material.node_tree.links

    def node(kind: str, **inputs: Any) -> bpy.types.Node:
        made = nodes.new(f"ShaderNode{kind}")
        for name, value in inputs.items():
            socket = made.inputs[int(name[1:]) if name[0] == "_" else name.replace("_", " ")]
            if isinstance(value, bpy.types.NodeSocket):
                links.new(value, socket)
            else:
                socket.default_value = value
        return made

    def math_node(operation: str, one: Any, other: Any) -> bpy.types.NodeSocket:
        return configure(node("Math", _0=one, _1=other), operation=operation).outputs[0]

    light = node("ShaderToRGB", _0=node("BsdfDiffuse").outputs[0])
    tone = node("RGBToBW", _0=light.outputs[0]).outputs[0]
    window = node("TexCoord").outputs["Window"]
    paper = None
    for degrees, darker in BANDS:
        rotated = node("VectorRotate", Vector=window, Angle=degrees * 3.14159 / 180)
        rotated.rotation_type = "Z_AXIS"
        bands = node("TexWave", Vector=rotated.outputs[0], Scale=26, Distortion=1.2)
        bands.inputs["Detail Scale"].default_value = 0.6
        band = bands.outputs["Factor" if "Factor" in bands.outputs else "Fac"]
        line = math_node("LESS_THAN", band, math_node("SUBTRACT", darker, tone))
        clear = math_node("SUBTRACT", 1.0, line)
        paper = clear if paper is None else math_node("MULTIPLY", paper, clear)
    links.new(paper, glow.inputs["Color"])
    monkey.data.materials.clear()
    monkey.data.materials.append(material)
    # Light of the world would brighten the shadows.
    world = scene.world.node_tree
    rays, switch = world.nodes.new("ShaderNodeLightPath"), world.nodes["Background"]
    world.links.new(rays.outputs["Is Camera Ray"], switch.inputs["Strength"])


def rosy(monkey: bpy.types.Object) -> None:
    """Draw with RoSy: make a field, apply a preset, bake."""
    bpy.context.view_layer.objects.active = monkey
    monkey.select_set(True)
    bpy.ops.rosy.field_generate(kind="curvature", reach=0.03)
    bpy.ops.rosy.preset_apply(preset="cross-hatch")
    bpy.ops.rosy.bake()


if __name__ == "__main__":
    main()
