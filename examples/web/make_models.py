"""Write models/metal.glb and models/hatching.glb for the page. RoSy must be installed in this Blender.

blender -b --python make_models.py
"""

from __future__ import annotations

import json
import math
from pathlib import Path

import bpy

FOLDER = Path(__file__).parent / "models"


def main() -> None:
    """Write both models."""
    FOLDER.mkdir(exist_ok=True)
    scene, obj = new_scene()
    write_metal(scene, obj)
    write_hatching(scene, obj)


def new_scene() -> tuple[bpy.types.Scene, bpy.types.Object]:
    """Return a scene with Blender's monkey, a field of degree 4 along its form, a lamp and a camera."""
    bpy.ops.wm.read_homefile(use_empty=True)
    scene = bpy.context.scene
    bpy.ops.object.camera_add(location=(2.0, -4.4, 1.0), rotation=(math.radians(78), 0, 0.425))
    scene.camera = bpy.context.object
    scene.camera.data.lens = 65.0
    scene.render.resolution_x = scene.render.resolution_y = 800
    bpy.ops.object.light_add(type="SUN", rotation=(0.7, -0.4, 0.3))
    bpy.context.object.data.energy = math.pi
    bpy.ops.mesh.primitive_monkey_add()
    obj = bpy.context.object
    bpy.ops.object.shade_smooth()
    obj.modifiers.new("Subdivision", "SUBSURF").levels = 2
    bpy.ops.object.modifier_apply(modifier="Subdivision")
    bpy.ops.object.mode_set(mode="EDIT")
    bpy.ops.mesh.select_all(action="SELECT")
    bpy.ops.uv.smart_project(island_margin=0.003)
    bpy.ops.object.mode_set(mode="OBJECT")
    bpy.ops.rosy.field_generate(kind="form", degree=4)
    scene.rosy.texture_size = 2048
    return scene, obj


def write_metal(scene: bpy.types.Scene, obj: bpy.types.Object) -> None:
    """Write a metal with the picture of the field as its color, brushed along the field."""
    bpy.ops.rosy.bake_texture()
    picture = texture_node(obj).image.copy()
    picture.use_fake_user = True
    scene.rosy.texture_content = "ANISOTROPY"
    bpy.ops.rosy.bake_texture()
    tree = texture_node(obj).id_data
    color = tree.nodes.new("ShaderNodeTexImage")
    color.image = picture
    tree.links.new(texture_node(obj).inputs["Vector"].links[0].from_socket, color.inputs["Vector"])
    shader = tree.nodes["Principled BSDF"]
    tree.links.new(color.outputs["Color"], shader.inputs["Base Color"])
    write(scene, "metal")
    scene.rosy.texture_content = "LOOK"


def write_hatching(scene: bpy.types.Scene, obj: bpy.types.Object) -> None:
    """Write thresholds of ink as the emission, and the inputs of the node group as a property."""
    bpy.ops.rosy.preset_apply(preset="engraving")
    bpy.ops.rosy.bake_texture()
    material = rosy_material(obj)
    group = next(n for n in material.node_tree.nodes if n.bl_idname == "ShaderNodeGroup")
    inputs = {}
    for socket in group.inputs:
        if not socket.is_linked:
            is_color = socket.type == "RGBA"
            inputs[socket.name] = (
                list(socket.default_value)[:3] if is_color else socket.default_value
            )
    material["rosy_hatching"] = json.dumps(inputs)
    material.update_tag()
    bpy.context.view_layer.update()
    write(scene, "hatching")


def rosy_material(obj: bpy.types.Object) -> bpy.types.Material:
    """Return the material that RoSy's modifier sets."""
    evaluated = obj.evaluated_get(bpy.context.evaluated_depsgraph_get())
    return evaluated.data.materials[0].original


def texture_node(obj: bpy.types.Object) -> bpy.types.Node:
    """Return the node of the texture in that material."""
    nodes = rosy_material(obj).node_tree.nodes
    return next(node for node in nodes if node.bl_idname == "ShaderNodeTexImage")


def write(scene: bpy.types.Scene, name: str) -> None:
    """Export the scene. RoSy's textures are set by a modifier, so modifiers are applied."""
    bpy.ops.export_scene.gltf(
        filepath=str(FOLDER / name),
        export_format="GLB",
        export_apply=True,
        export_tangents=True,
        export_cameras=True,
        export_lights=True,
        export_extras=True,
        export_import_convert_lighting_mode="RAW",
    )
    bpy.ops.wm.save_as_mainfile(filepath=str(FOLDER / f"{name}.blend"), copy=True)


if __name__ == "__main__":
    main()
