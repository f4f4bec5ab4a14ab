"""Bake the fields of a .blend file, render it, and save a copy next to the picture.

    blender -b SCENE.blend -P examples/bake_scene.py -- OUT.png

Meshes without a field get a curvature field.
"""

import sys
from pathlib import Path

import bpy

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from rosy_addon.field.generate import generate
from rosy_addon.jobs.bake import bake
from rosy_addon.scene.field_attributes import has_field
from rosy_addon.scene.mesh_fields import write_mesh_field
from rosy_addon.scene.meshes import mesh_surface
from rosy_addon.ui.properties import ensure_registered


def main(output: Path) -> None:
    ensure_registered()
    scene = bpy.context.scene
    for obj in scene.objects:
        if obj.type == "MESH" and not has_field(obj):
            surface = mesh_surface(obj.data)
            write_mesh_field(obj.data, generate(surface, "curvature", 4))
    for result in bake(scene):
        names = ", ".join(obj.name for obj in result.objects)
        width, height = result.image.size
        print(f"{names} drawn from {result.camera}, {width} x {height} pixels")
        for warning in result.warnings:
            print(warning)
    scene.render.filepath = str(output.resolve())
    bpy.ops.render.render(write_still=True)
    bpy.ops.wm.save_as_mainfile(filepath=str(output.resolve().with_suffix(".blend")), copy=True)


if __name__ == "__main__":
    main(Path(sys.argv[sys.argv.index("--") + 1]))
