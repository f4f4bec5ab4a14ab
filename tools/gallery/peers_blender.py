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

import bpy
from mathutils import Vector

ROOT = Path(__file__).resolve().parents[2]

#: Size in pixels, twice that of the finished pictures.
WIDTH, HEIGHT = 804, 660
INK = (0.006, 0.006, 0.008)

#: Direction to the light in the space of the camera: the same as RoSy's lamp.
LAMP = Vector((-0.50, 0.60, 0.62)).normalized()

#: Kinds of edges that a line set of Freestyle may draw.
EDGES = (
    "silhouette",
    "border",
    "crease",
    "ridge_valley",
    "suggestive_contour",
    "material_boundary",
    "contour",
    "external_contour",
    "edge_mark",
)

Prepare = Callable[[bpy.types.Object], None]


def main() -> None:
    """Draw the named pictures, by default all."""
    folder, *names = sys.argv[sys.argv.index("--") + 1 :]
    load_rosy()
    seconds_path = Path(folder).resolve() / "seconds.json"
    seconds_path.parent.mkdir(parents=True, exist_ok=True)
    seconds = json.loads(seconds_path.read_text()) if seconds_path.exists() else {}
    for prepare in (line_art, freestyle, shader, rosy):
        if not names or prepare.__name__ in names:
            seconds[prepare.__name__] = time_drawing(
                prepare, seconds_path.with_name(f"{prepare.__name__}.png")
            )
            seconds_path.write_text(json.dumps(seconds, indent=1) + "\n", encoding="utf-8")


def time_drawing(prepare: Prepare, path: Path) -> float:
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


def new_scene() -> bpy.types.Object:
    """Open a scene with a white, subdivided Suzanne, a camera, a sun and a white background."""
    for obj in list(bpy.data.objects):
        bpy.data.objects.remove(obj)
    scene = bpy.context.scene
    scene.rosy.bakes.clear()
    bpy.ops.mesh.primitive_monkey_add()
    monkey = bpy.context.object
    # Two levels are applied, so that edges can be marked; a modifier adds one more.
    subdivide(monkey, 2)
    bpy.ops.object.modifier_apply(modifier=monkey.modifiers[0].name)
    subdivide(monkey, 1)
    bpy.ops.object.shade_smooth()
    monkey.data.materials.append(plain("White", (1, 1, 1)))

    camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    scene.collection.objects.link(camera)
    camera.data.lens, camera.data.shift_x, camera.data.shift_y = 82, -0.082, -0.004
    location = Vector((-2.62, -5.35, 0.88))
    camera.location = location
    camera.rotation_euler = (Vector((0, 0, -0.02)) - location).to_track_quat("-Z", "Y").to_euler()
    scene.camera = camera
    bpy.context.view_layer.update()

    sun = bpy.data.objects.new("Sun", bpy.data.lights.new("Sun", "SUN"))
    scene.collection.objects.link(sun)
    toward = camera.matrix_world.to_3x3() @ LAMP
    sun.rotation_euler = toward.to_track_quat("Z", "Y").to_euler()
    sun.data.energy, sun.data.angle = 3.14159, 0

    world = bpy.data.worlds.new("White")
    world.use_nodes = True
    world.node_tree.nodes["Background"].inputs["Color"].default_value = (1, 1, 1, 1)
    scene.world = world
    scene.view_settings.view_transform = "Standard"
    scene.render.resolution_x, scene.render.resolution_y = WIDTH, HEIGHT
    scene.render.resolution_percentage = 100
    scene.render.use_freestyle = False
    use_cycles()
    return monkey


def subdivide(obj: bpy.types.Object, levels: int) -> None:
    modifier = obj.modifiers.new("Subdivision", "SUBSURF")
    modifier.levels = modifier.render_levels = levels


def use_cycles() -> None:
    """Choose Cycles with few samples, enough for flat colors, which have no noise."""
    scene = bpy.context.scene
    scene.render.engine = "CYCLES"
    scene.cycles.device, scene.cycles.samples = "CPU", 16
    scene.cycles.use_denoising = False
    scene.cycles.use_adaptive_sampling = False
    scene.cycles.max_bounces = 0


def plain(name: str, color: tuple[float, float, float]) -> bpy.types.Material:
    """Return a material of one color, which light does not change."""
    material = bpy.data.materials.new(name)
    material.use_nodes = True
    nodes, links = material.node_tree.nodes, material.node_tree.links
    nodes.clear()
    glow = nodes.new("ShaderNodeEmission")
    glow.inputs["Color"].default_value = (*color, 1)
    links.new(glow.outputs[0], nodes.new("ShaderNodeOutputMaterial").inputs["Surface"])
    return material


def line_art(monkey: bpy.types.Object) -> None:
    """Draw contours and creases with Line Art, thinner toward their ends."""
    bpy.ops.object.select_all(action="DESELECT")
    monkey.select_set(True)
    bpy.context.view_layer.objects.active = monkey
    bpy.ops.object.grease_pencil_add(type="LINEART_OBJECT")
    lines = bpy.context.object
    for material in lines.data.materials:
        material.grease_pencil.color = (*INK, 1)
    drawing = lines.modifiers[0]
    drawing.radius = 0.011
    drawing.use_crease = drawing.use_crease_on_smooth = True
    drawing.crease_threshold = 2.53
    taper = lines.modifiers.new("Taper", "GREASE_PENCIL_THICKNESS")
    taper.use_custom_curve = True
    points = taper.custom_curve.curves[0].points
    points[0].location, points[1].location = (0, 0.15), (1, 0.15)
    points.new(0.5, 1.0)
    taper.custom_curve.update()


def freestyle(monkey: bpy.types.Object) -> None:
    """Draw with Freestyle: sketched contours, and marked edges in the shade as hatching."""
    mark_shaded_edges(monkey)
    scene, layer = bpy.context.scene, bpy.context.view_layer
    scene.render.use_freestyle = layer.use_freestyle = True
    scene.render.line_thickness_mode = "ABSOLUTE"
    settings = layer.freestyle_settings
    for lines in list(settings.linesets):
        settings.linesets.remove(lines)
    settings.use_smoothness = True
    form = settings.linesets.new("Form")
    select_edges(form, "silhouette", "border", "crease", "external_contour", "suggestive_contour")
    set_sketchy_style(form, thickness=3.2, rounds=2, shake=2.0)
    shade = settings.linesets.new("Shade")
    select_edges(shade, "edge_mark")
    set_sketchy_style(shade, thickness=2.2, rounds=2, shake=1.2)


def mark_shaded_edges(monkey: bpy.types.Object) -> None:
    """Mark horizontal edges that face away from the sun, because Freestyle does not use light."""
    toward = bpy.data.objects["Sun"].matrix_world.to_3x3() @ Vector((0, 0, 1))
    mesh = monkey.data
    marks = mesh.attributes.get("freestyle_edge") or mesh.attributes.new(
        "freestyle_edge", "BOOLEAN", "EDGE"
    )
    for edge in mesh.edges:
        normal = sum((mesh.vertices[v].normal for v in edge.vertices), Vector()).normalized()
        start, end = (mesh.vertices[v].co for v in edge.vertices)
        level = abs((end - start).normalized().z) < 0.6
        marks.data[edge.index].value = level and normal.dot(toward) < 0.45


def select_edges(lines: bpy.types.FreestyleLineSet, *kinds: str) -> None:
    """Select the edges that a line set draws."""
    for name in EDGES:
        setattr(lines, f"select_{name}", name in kinds)


def set_sketchy_style(
    lines: bpy.types.FreestyleLineSet, thickness: float, rounds: int, shake: float
) -> None:
    """Make lines look sketched: drawn several times, shaky, thinner toward their ends."""
    style = lines.linestyle or bpy.data.linestyles.new(lines.name)
    lines.linestyle = style
    style.color, style.thickness = INK, thickness
    style.use_chaining, style.chaining, style.rounds = True, "SKETCHY", rounds
    style.caps = "ROUND"
    taper = style.thickness_modifiers.new("Taper", "ALONG_STROKE")
    taper.mapping, taper.value_min, taper.value_max = "CURVE", 0.4, thickness
    points = taper.curve.curves[0].points
    points[0].location, points[1].location = (0, 0), (1, 0)
    points.new(0.5, 1.0)
    taper.curve.update()
    hand = style.geometry_modifiers.new("Hand", "PERLIN_NOISE_2D")
    hand.frequency, hand.amplitude, hand.octaves = 8, shake, 2


def shader(monkey: bpy.types.Object) -> None:
    """Draw with EEVEE: light as color, and bands across the window that get wider in the dark."""
    scene = bpy.context.scene
    scene.render.engine = "BLENDER_EEVEE"
    scene.eevee.taa_render_samples = 16
    material = bpy.data.materials.new("Hatching")
    material.use_nodes = True
    nodes, links = material.node_tree.nodes, material.node_tree.links
    nodes.clear()

    def math_node(operation: str, *inputs: bpy.types.NodeSocket | float) -> bpy.types.NodeSocket:
        node = nodes.new("ShaderNodeMath")
        node.operation = operation
        for socket, value in zip(node.inputs, inputs, strict=False):
            if isinstance(value, bpy.types.NodeSocket):
                links.new(value, socket)
            else:
                socket.default_value = value
        return node.outputs[0]

    light = nodes.new("ShaderNodeShaderToRGB")
    links.new(nodes.new("ShaderNodeBsdfDiffuse").outputs[0], light.inputs[0])
    tone = nodes.new("ShaderNodeRGBToBW")
    links.new(light.outputs[0], tone.inputs[0])
    window_coordinates = nodes.new("ShaderNodeTexCoord").outputs["Window"]
    paper = None
    # Bands at three angles, each starting at a darker tone.
    for degrees, darker in ((40, 0.72), (-50, 0.45), (-5, 0.22)):
        rotated = nodes.new("ShaderNodeVectorRotate")
        rotated.rotation_type = "Z_AXIS"
        links.new(window_coordinates, rotated.inputs["Vector"])
        rotated.inputs["Angle"].default_value = degrees * 3.14159 / 180
        bands = nodes.new("ShaderNodeTexWave")
        bands.inputs["Scale"].default_value = 26
        bands.inputs["Distortion"].default_value = 1.2
        bands.inputs["Detail Scale"].default_value = 0.6
        links.new(rotated.outputs[0], bands.inputs["Vector"])
        width = math_node("SUBTRACT", darker, tone.outputs[0])
        line = math_node(
            "LESS_THAN", bands.outputs["Factor" if "Factor" in bands.outputs else "Fac"], width
        )
        clear = math_node("SUBTRACT", 1.0, line)
        paper = clear if paper is None else math_node("MULTIPLY", paper, clear)
    glow = nodes.new("ShaderNodeEmission")
    links.new(paper, glow.inputs["Color"])
    links.new(glow.outputs[0], nodes.new("ShaderNodeOutputMaterial").inputs["Surface"])
    monkey.data.materials.clear()
    monkey.data.materials.append(material)
    # Light of the world would brighten the shadows.
    world = bpy.context.scene.world.node_tree
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
