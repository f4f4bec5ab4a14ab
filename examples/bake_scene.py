"""Draw the fields of a .blend file from its camera, render it, and save it beside the original.

    blender -b SCENE.blend -P examples/bake_scene.py -- OUT.png

Meshes without a field get one along the directions of their curvature.
"""

import sys
from pathlib import Path

import bpy

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from rosy_addon.bake import bake
from rosy_addon.field.generate import generate
from rosy_addon.scene.field_attributes import has_field
from rosy_addon.scene.meshes import mesh_surface
from rosy_addon.scene.write_field import write_mesh_field
from rosy_addon.ui.properties import ensure_registered


def main(output: Path) -> None:
    ensure_registered()
    scene = bpy.context.scene
    for thing in scene.objects:
        if thing.type == "MESH" and not has_field(thing):
            surface = mesh_surface(thing.data)
            write_mesh_field(thing.data, generate(surface, "curvature", 4))
    for baked in bake(scene):
        names = ", ".join(thing.name for thing in baked.objects)
        print(f"{names} drawn from {baked.camera}, {tuple(baked.image.size)} pixels")
        print(*baked.warnings, sep="\n")
    scene.render.filepath = str(output.resolve())
    bpy.ops.render.render(write_still=True)
    bpy.ops.wm.save_as_mainfile(filepath=str(output.resolve().with_suffix(".blend")), copy=True)


if __name__ == "__main__":
    main(Path(sys.argv[sys.argv.index("--") + 1]))
