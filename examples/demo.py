"""Build a scene with Suzanne, bake a cross field along her curvature, and render it.

With Blender's Python module, bpy, or with Blender:

    python examples/demo.py [DEMO.png]
    blender -b -P examples/demo.py -- [DEMO.png]
"""

import sys
from math import cos, pi, radians, sin
from pathlib import Path

import bpy
from mathutils import Vector

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from rosy_addon.compositor.look import Look
from rosy_addon.field.generate import generate
from rosy_addon.jobs.bake import bake
from rosy_addon.scene.mesh_fields import write_mesh_field
from rosy_addon.scene.meshes import mesh_surface
from rosy_addon.ui.properties import ensure_registered

SIZE = 800, 640

#: The lights of the scene shade the picture, so it has no shading of its own.
LOOK = Look(shading=0.0, supersampling=2)


def main(output: Path) -> None:
    bpy.ops.wm.read_factory_settings(use_empty=True)
    ensure_registered()
    scene = bpy.context.scene
    suzanne = add_suzanne()
    write_mesh_field(suzanne.data, generate(mesh_surface(suzanne.data), "curvature", 4))
    add_backdrop(suzanne)
    scene.camera = add_camera((1.45, -5.6, 1.0), (0.03, 0.0, -0.08))
    add_lamp("Key", (-3.5, -4.5, 4.5), energy=520, size=2.0)
    add_lamp("Rim", (3.5, 2.5, 3.0), energy=400, size=1.5)
    set_render(scene)
    scene.rosy.emission, scene.rosy.diffuse = 0.3, 0.9
    bake(scene, look=LOOK)
    scene.render.filepath = str(output.resolve())
    bpy.ops.render.render(write_still=True)
    print(output.resolve())


def add_suzanne():
    """Add Suzanne, subdivided, because curvature needs a smooth surface."""
    bpy.ops.mesh.primitive_monkey_add(rotation=(radians(-8), 0.0, 0.0))
    suzanne = bpy.context.object
    suzanne.modifiers.new("Subdivision", "SUBSURF").levels = 3
    bpy.ops.object.modifier_apply(modifier="Subdivision")
    bpy.ops.object.shade_smooth()
    return suzanne


def add_backdrop(suzanne):
    """Add a floor under Suzanne that curves up into a wall behind her."""
    floor = min((suzanne.matrix_world @ vertex.co).z for vertex in suzanne.data.vertices)
    bend = [
        (4 + 3 * sin(angle), floor + 3 - 3 * cos(angle))
        for angle in (pi / 48 * i for i in range(25))
    ]
    profile = [(-15.0, floor), *bend, (7.0, floor + 15)]
    vertices = [(x, y, z) for y, z in profile for x in (-20.0, 20.0)]
    faces = [(i, i + 1, i + 3, i + 2) for i in range(0, len(vertices) - 2, 2)]
    mesh = bpy.data.meshes.new("Backdrop")
    mesh.from_pydata(vertices, [], faces)
    mesh.shade_smooth()
    material = bpy.data.materials.new("Backdrop")
    material.use_nodes = True
    surface = material.node_tree.nodes["Principled BSDF"]
    surface.inputs["Base Color"].default_value = (0.30, 0.34, 0.38, 1.0)
    surface.inputs["Roughness"].default_value = 1.0
    mesh.materials.append(material)
    bpy.context.scene.collection.objects.link(bpy.data.objects.new("Backdrop", mesh))


def add_camera(location, target):
    camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    bpy.context.scene.collection.objects.link(camera)
    camera.data.lens = 66.0
    aim(camera, location, target)
    return camera


def add_lamp(name, location, energy, size):
    data = bpy.data.lights.new(name, "AREA")
    data.energy, data.size = energy, size
    lamp = bpy.data.objects.new(name, data)
    bpy.context.scene.collection.objects.link(lamp)
    aim(lamp, location, (0.0, 0.0, 0.0))


def aim(obj, location, target):
    """Move an object to a location and point its -Z axis at a target."""
    obj.location = location
    direction = Vector(target) - Vector(location)
    obj.rotation_euler = direction.to_track_quat("-Z", "Y").to_euler()


def set_render(scene):
    world = bpy.data.worlds.new("World")
    world.use_nodes = True
    world.node_tree.nodes["Background"].inputs["Color"].default_value = (0.6, 0.65, 0.7, 1.0)
    world.node_tree.nodes["Background"].inputs["Strength"].default_value = 0.35
    scene.world = world
    scene.view_settings.view_transform = "Standard"
    render = scene.render
    render.engine = "CYCLES"
    render.resolution_x, render.resolution_y = SIZE
    render.image_settings.file_format = "PNG"
    # The denoiser is off, because not every build of Blender has it.
    scene.cycles.device, scene.cycles.samples, scene.cycles.use_denoising = "CPU", 32, False


if __name__ == "__main__":
    arguments = sys.argv[sys.argv.index("--") + 1 :] if "--" in sys.argv else sys.argv[1:]
    main(Path(arguments[0] if arguments else "demo.png"))
