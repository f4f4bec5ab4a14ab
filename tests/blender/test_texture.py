"""Textures in Blender: bake, unwrap, undo, remove, and the file without the extension."""

import bpy
import numpy as np
from conftest import baked_images, contents, error_of, pixels
from extension import rosy
from test_bake import hatching_node, material_of, plane_in_frame, render


def test_hatching_follows_the_tone(scene, tmp_path):
    """The paper and the ink of a texture have the mean that the tone asks, without a new texture."""
    to_linear = rosy("rosy_addon.core.color").to_linear
    plane = plane_in_frame(scene)
    scene.rosy.texture_size = 1024
    for preset, light_ink in (("cross-hatch", False), ("white-on-black", True)):
        bpy.ops.rosy.preset_apply(preset=preset)
        scene.rosy.look.shading = 1.0
        assert bpy.ops.rosy.bake_texture() == {"FINISHED"}
        node = hatching_node(plane)
        tree = node.id_data
        tree.links.remove(node.inputs["Tone"].links[0])
        colors = [node.inputs[name].default_value[0] for name in ("Ink", "Paper")]
        for tone in (0.0, 0.25, 0.75):
            node.inputs["Tone"].default_value = tone
            mean = to_linear(render(scene, tmp_path)[..., 0]).mean()
            share = 1 - tone if not light_ink else tone
            expected = colors[1] + share * (colors[0] - colors[1])
            assert abs(mean - expected) < 0.03, (preset, tone)
    assert len([g for g in bpy.data.node_groups if g.name.startswith("RoSy Hatching")]) == 1
    assert bpy.ops.rosy.remove() == {"FINISHED"}
    assert not bpy.data.node_groups and not bpy.data.materials and not baked_images()


def test_highlights_of_a_torus_lie_along_its_principal_directions(scene, tmp_path):
    """Whether the directions are in a texture, also in mirrored charts, or in an attribute."""
    bpy.ops.mesh.primitive_torus_add(major_segments=96, minor_segments=48, minor_radius=0.5)
    torus = bpy.context.object
    bpy.ops.object.shade_smooth()
    layer = torus.data.uv_layers.active
    uv = np.array([corner.vector for corner in layer.uv]) @ [1, 1j]
    is_mirrored = np.arange(len(uv)) < len(uv) // 2
    uv = np.where(is_mirrored, -uv.conj() * np.exp(0.5j), uv) * 0.35 + np.where(
        is_mirrored, 0.4, 0.5j
    )
    layer.uv.foreach_set("vector", np.stack([uv.real, uv.imag], axis=1).ravel())
    bpy.ops.rosy.field_generate(kind="curvature", degree=4)
    scene.rosy.texture_content, scene.rosy.texture_size = "ANISOTROPY", 512
    assert bpy.ops.rosy.bake_texture() == {"FINISHED"}
    assert bpy.ops.rosy.field_store(form="TANGENT") == {"FINISHED"}
    bpy.ops.object.light_add(type="SUN", rotation=(0.6, 0.3, 0.0))
    from_texture = render(scene, tmp_path)
    tree = material_of(torus).node_tree
    shader = tree.nodes["Principled BSDF"]
    attribute = tree.nodes.new("ShaderNodeAttribute")
    attribute.attribute_name = "rosy_tangent"
    tree.links.remove(shader.inputs["Anisotropic Rotation"].links[0])
    tree.links.new(attribute.outputs["Vector"], shader.inputs["Tangent"])

    def differences(turns):
        """How far the picture is from that of the attribute, turned by some angles."""
        mean = []
        for turn in turns:
            shader.inputs["Anisotropic Rotation"].default_value = turn / 360
            mean.append(np.abs(render(scene, tmp_path) - from_texture)[..., :3].mean())
        return mean

    nearest, left, right = differences((90, 88, 92))
    assert nearest < 0.5 * min(left, right)
    x, y = np.array([vertex.co[:2] for vertex in torus.data.vertices]).T
    vertex = np.array([loop.vertex_index for loop in torus.data.loops])
    tangent = np.array([item.vector for item in torus.data.attributes["rosy_tangent"].data])
    circle = np.stack([-y, x, 0 * x], axis=1)[vertex]
    circle /= np.linalg.norm(circle, axis=1, keepdims=True)
    assert np.abs((tangent * circle).sum(axis=1)).min() > np.cos(np.radians(2.0))


def test_meshes_without_a_uv_map_can_be_unwrapped(scene):
    bpy.ops.mesh.primitive_cube_add()
    cube = bpy.context.object
    cube.data.uv_layers.remove(cube.data.uv_layers[0])
    cube.data.polygons[2].hide = True
    bpy.ops.rosy.field_generate(kind="smoothest", degree=4)
    scene.rosy.texture_size = 64
    assert "unwrap its mesh first" in error_of(bpy.ops.rosy.bake_texture)
    assert bpy.ops.rosy.bake_texture(unwrap=True) == {"FINISHED"}
    assert len(cube.data.uv_layers) == 1 and cube.mode == "OBJECT" and cube.select_get()
    assert [face.hide for face in cube.data.polygons] == [False, False, True, False, False, False]
    assert pixels(baked_images()[0])[..., 0].std() > 0.05


def test_unwrapping_is_undone_if_the_bake_fails(with_field, scene):
    with_field.rosy.texture_uv_map = "None"
    bpy.ops.mesh.primitive_cube_add()
    cube = bpy.context.object
    cube.data.uv_layers.remove(cube.data.uv_layers[0])
    cube.data.attributes.new("UVMap", "FLOAT", "POINT")  # so that the new map gets another name
    bpy.ops.rosy.field_generate(kind="smoothest", degree=4)
    with_field.select_set(True)
    before = contents()
    assert "no UV map 'None'" in error_of(bpy.ops.rosy.bake_texture, unwrap=True)
    assert contents() == before
    assert bpy.context.object == cube and len(bpy.context.selected_objects) == 2
