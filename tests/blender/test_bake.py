"""The main job in Blender: bake, render what was baked, remove."""

import bpy
import numpy as np
from conftest import baked_images, pixels, render_image, run_blender


def material_of(obj):
    """Return the material of the evaluated object."""
    evaluated = obj.evaluated_get(bpy.context.evaluated_depsgraph_get())
    return evaluated.data.materials[-1].original


def hatching_node(obj):
    """Return the node of the group RoSy Hatching in the material of an object."""
    nodes = material_of(obj).node_tree.nodes
    return next(node for node in nodes if node.bl_idname == "ShaderNodeGroup")


def render(scene, folder, engine="CYCLES"):
    """Render the scene: (H, W, 4) display values, in Cycles sampled at the centers of pixels."""
    scene.cycles.samples, scene.cycles.use_denoising = 4, False
    scene.cycles.pixel_filter_type, scene.cycles.filter_width = "BOX", 0.01
    return render_image(scene, folder / "render.png", engine)


def plane_in_frame(scene):
    """Return a plane with a field of degree 4 that fills the orthographic frame."""
    bpy.ops.mesh.primitive_plane_add(size=8.0, rotation=(np.pi / 2, 0.0, 0.0))
    bpy.ops.rosy.field_generate(kind="axis", degree=4, axis=(1.0, 0.0, 0.3))
    scene.camera.data.type, scene.camera.data.ortho_scale = "ORTHO", 8.0
    scene.camera.location, scene.camera.rotation_euler = (0.0, -5.0, 0.0), (np.pi / 2, 0.0, 0.0)
    return bpy.context.object


RENDER_ALONE = """
import bpy
assert not hasattr(bpy.types.Scene, "rosy")
bpy.ops.render.render(write_still=True)
"""


def test_the_saved_file_renders_without_the_extension(baked, scene, tmp_path):
    expected = render(scene, tmp_path)
    scene.render.filepath = str(tmp_path / "alone.png")
    path = tmp_path / "baked.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(path))
    options = ["--factory-startup", str(path), "--python-exit-code", "1"]
    status, output = run_blender(*options, "--python-expr", RENDER_ALONE)
    assert status == 0, output
    rendered = pixels(bpy.data.images.load(str(tmp_path / "alone.png")))
    np.testing.assert_array_equal(rendered, expected)
    assert expected[..., :3][expected[..., 3] > 0.9].std() > 0.1


def test_a_relit_picture_is_the_picture_of_any_tone(scene, tmp_path):
    """The material draws from thresholds what the bake draws at the same tone."""
    plane = plane_in_frame(scene)
    for preset in ("engraving", "cross-hatch"):
        bpy.ops.rosy.preset_apply(preset=preset)
        scene.rosy.look.shading, scene.rosy.look.light = 1.0, "headlight"
        scene.rosy.look.tone_levels[2] = 1.0
        scene.rosy.relight = True
        assert bpy.ops.rosy.bake() == {"FINISHED"}
        node = hatching_node(plane)
        node.id_data.links.remove(node.inputs["Tone"].links[0])
        node.inputs["Tone"].default_value = 1.0  # the light of the headlight
        relit = {}
        for white in (1.25, 2.0, 4.0):
            node.inputs["White"].default_value = white
            relit[white] = render(scene, tmp_path)[..., :3].mean(axis=2)
        scene.rosy.relight = False
        for white, drawn in relit.items():
            scene.rosy.look.tone_levels[1] = white
            bpy.ops.rosy.bake()
            expected = render(scene, tmp_path)[..., :3].mean(axis=2)
            assert abs(drawn.mean() - expected.mean()) < 0.02, (preset, white)
            assert np.corrcoef(drawn.ravel(), expected.ravel())[0, 1] > 0.92, (preset, white)
    assert bpy.ops.rosy.remove() == {"FINISHED"}
    assert not bpy.data.node_groups and not bpy.data.materials and not baked_images()


def test_clear_paper_shows_what_is_behind(with_field, scene, tmp_path):
    """A red wall is behind Suzanne. Each pixel is wall where the picture has no ink, and ink where it is full."""
    bpy.ops.mesh.primitive_plane_add(size=30.0, location=(0, 3, 0), rotation=(np.pi / 2, 0.0, 0.0))
    wall = bpy.data.materials.new("Wall")
    wall.use_nodes = True
    wall.node_tree.nodes.clear()
    emission = wall.node_tree.nodes.new("ShaderNodeEmission")
    emission.inputs["Color"].default_value = (1.0, 0.0, 0.0, 1.0)
    output = wall.node_tree.nodes.new("ShaderNodeOutputMaterial")
    wall.node_tree.links.new(emission.outputs[0], output.inputs["Surface"])
    bpy.context.object.data.materials.append(wall)
    look = scene.rosy.look
    look.ink, look.ink_color, look.supersampling = "hatch", (0.0, 0.0, 0.0), 1
    look.paper_color = (1.0, 1.0, 1.0, 0.0)
    assert bpy.ops.rosy.bake() == {"FINISHED"}
    alpha, image = pixels(baked_images()[0])[..., 3], render(scene, tmp_path)
    np.testing.assert_allclose(image[alpha == 0][:, :3] - (1, 0, 0), 0, atol=2 / 255)
    ink = image[alpha == 1][:, :3].max(axis=1)
    # At silhouettes, other samples miss the surface.
    assert len(ink) > 100 and (ink < 2 / 255).mean() > 0.9


RENDER_WITHOUT_AND_WITH_INK = """
import bpy
scene = bpy.context.scene
scene.render.engine = "BLENDER_EEVEE_NEXT" if bpy.app.version < (5, 0, 0) else "BLENDER_EEVEE"
scene.eevee.taa_render_samples = 4
ink = bpy.data.objects["Suzanne ink"]
for name in ("with", "without"):
    scene.render.filepath = f"//{name}.png"
    bpy.ops.render.render(write_still=True)
    scene.collection.objects.unlink(ink) if name == "with" else None
"""


def test_ink_over_the_own_material(with_field, scene, tmp_path):
    """Each pixel is as without RoSy where the picture has no ink, and ink where it is full."""
    suzanne = bpy.context.object
    material = bpy.data.materials.new("Checkered")
    material.use_nodes = True
    nodes, links = material.node_tree.nodes, material.node_tree.links
    nodes.clear()
    checker, diffuse = nodes.new("ShaderNodeTexChecker"), nodes.new("ShaderNodeBsdfDiffuse")
    output = nodes.new("ShaderNodeOutputMaterial")
    links.new(checker.outputs["Color"], diffuse.inputs["Color"])
    links.new(diffuse.outputs[0], output.inputs["Surface"])
    suzanne.data.materials.append(material)
    bpy.ops.object.light_add(type="SUN", rotation=(0.7, 0.4, 0.2))
    bpy.context.object.data.angle, scene.cycles.max_bounces = 0.0, 0
    before = render(scene, tmp_path)
    look = scene.rosy.look
    look.ink, look.ink_color, look.supersampling = "hatch", (0.0, 0.0, 0.0), 1
    scene.rosy.over_material = True
    assert bpy.ops.rosy.bake() == {"FINISHED"}
    assert material_of(suzanne) == material
    assert not any(modifier.type == "NODES" for modifier in suzanne.modifiers)
    alpha = pixels(baked_images()[0])[..., 3]
    is_free = np.zeros(alpha.shape, dtype=bool)
    window = np.lib.stride_tricks.sliding_window_view(alpha, (3, 3))
    is_free[1:-1, 1:-1] = window.max(axis=(2, 3)) == 0

    def check(image, own, ink_level):
        assert np.abs(image - own)[is_free].max() < 2.5 / 255
        ink = np.median(image[alpha == 1][:, :3])  # at silhouettes, samples may miss the surface
        assert ink <= ink_level < 0.15 < np.median(own[alpha == 1][:, :3])

    check(render(scene, tmp_path), before, 2 / 255)
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "ink.blend"), copy=True)
    options = ["--factory-startup", str(tmp_path / "ink.blend"), "--python-exit-code", "1"]
    status, text = run_blender(*options, "--python-expr", RENDER_WITHOUT_AND_WITH_INK)
    assert status == 0, text
    files = (str(tmp_path / f"{name}.png") for name in ("with", "without"))
    check(*(pixels(bpy.data.images.load(path)) for path in files), 0.12)  # EEVEE filters
    suzanne.hide_render = True
    bpy.context.view_layer.update()
    assert np.ptp(render(scene, tmp_path)[..., 3]) == 0
    assert bpy.ops.rosy.remove() == {"FINISHED"}
    assert not suzanne.children


def test_bake_animation(with_field, scene, tmp_path):
    """The frames of the scene, and then two of them."""
    scene.frame_start, scene.frame_end = 1, 4
    scene.rosy.directory = str(tmp_path)
    assert bpy.ops.rosy.bake_animation() == {"FINISHED"}
    files = sorted(path.name for path in tmp_path.glob("*.png"))
    assert files == [f"RoSy_Scene_{n:04d}.png" for n in (1, 2, 3, 4)]
    assert bpy.ops.rosy.bake_animation(first=2, last=3) == {"FINISHED"}
    (record,) = scene.rosy.bakes
    assert record.frames == "2 to 3" and record.image.source == "SEQUENCE"
