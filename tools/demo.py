"""Suzanne with a 4-RoSy field along her principal curvatures, baked and rendered: `make demo`."""

from __future__ import annotations

import sys
from pathlib import Path

import bpy
from mathutils import Vector

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from rosy_addon.bake import bake
from rosy_addon.compositor.look import Look
from rosy_addon.field.generate import generate
from rosy_addon.scene.attributes import write_mesh_field
from rosy_addon.scene.meshes import mesh_surface
from rosy_addon.ui.properties import ensure_registered

SIZE = 800
SUBDIVISIONS = 3
BACKGROUND = (0.8, 0.8, 0.82, 1.0)
LOOK = Look(length=60, grain=2.0, gain=3.0, shading=0.6, supersampling=2)


def main() -> int:
    """Write the picture to the path given and print it."""
    target = Path(sys.argv[1]).resolve()
    ensure_registered()
    bpy.ops.wm.read_homefile(use_empty=True)
    scene = bpy.context.scene
    add_camera(scene, (-1.2, -4.0, 0.8))
    add_suzanne_with_field()
    bake(scene, look=LOOK, size=(SIZE, SIZE))
    render(scene, target)
    print(target)
    return 0


def add_suzanne_with_field() -> None:
    """Suzanne, smooth and finely divided, with the field on her faces."""
    bpy.ops.mesh.primitive_monkey_add()
    suzanne = bpy.context.object
    modifier = suzanne.modifiers.new("Subdivision", "SUBSURF")
    modifier.levels = SUBDIVISIONS
    bpy.ops.object.modifier_apply(modifier=modifier.name)
    bpy.ops.object.shade_smooth()
    write_mesh_field(suzanne.data, generate(mesh_surface(suzanne.data), "curvature", degree=4))


def add_camera(scene: bpy.types.Scene, location: tuple[float, float, float]) -> None:
    """The scene's camera, looking at the origin."""
    camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    scene.collection.objects.link(camera)
    camera.location = location
    camera.rotation_euler = (-Vector(location)).to_track_quat("-Z", "Y").to_euler()
    scene.camera = camera
    bpy.context.view_layer.update()


def render(scene: bpy.types.Scene, target: Path) -> None:
    """Render with Cycles, through the material that the bake made."""
    scene.world = bpy.data.worlds.new("World")
    scene.world.use_nodes = True
    scene.world.node_tree.nodes["Background"].inputs["Color"].default_value = BACKGROUND
    scene.view_settings.view_transform = "Standard"
    scene.render.engine = "CYCLES"
    scene.cycles.samples, scene.cycles.use_denoising = 16, False
    scene.render.resolution_x = scene.render.resolution_y = SIZE
    scene.render.resolution_percentage = 100
    scene.render.image_settings.file_format = "PNG"
    scene.render.filepath = str(target)
    bpy.ops.render.render(write_still=True)


if __name__ == "__main__":
    sys.exit(main())
