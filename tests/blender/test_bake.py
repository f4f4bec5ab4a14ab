"""The main job in Blender: bake, render what was baked, undo, remove."""

from __future__ import annotations

import subprocess

import bpy
import numpy as np
import pytest
from conftest import contents


def baked_images():
    return [image for image in bpy.data.images if image.name.lower().startswith("rosy")]


def material_of(obj):
    """Return the material of the evaluated object."""
    evaluated = obj.evaluated_get(bpy.context.evaluated_depsgraph_get())
    return evaluated.data.materials[-1].original


def pixels(image):
    values = np.empty(len(image.pixels), dtype=np.float32)
    image.pixels.foreach_get(values)
    return values.reshape(image.size[1], image.size[0], 4)


def render(scene, folder):
    """Render the scene with Cycles: (H, W, 4) display values, sampled at the centers of pixels."""
    scene.render.engine = "CYCLES"
    scene.cycles.samples, scene.cycles.use_denoising = 4, False
    scene.cycles.pixel_filter_type, scene.cycles.filter_width = "BOX", 0.01
    scene.render.film_transparent = True
    scene.render.image_settings.file_format = "PNG"
    scene.render.image_settings.color_mode = "RGBA"
    scene.render.filepath = str(folder / "cycles.png")
    bpy.ops.render.render(write_still=True)
    return pixels(bpy.data.images.load(scene.render.filepath))


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
    options = ["-b", "--factory-startup", str(path), "--python-exit-code", "1"]
    process = subprocess.run(
        [bpy.app.binary_path, *options, "--python-expr", RENDER_ALONE],
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    assert process.returncode == 0, process.stdout + process.stderr
    rendered = pixels(bpy.data.images.load(str(tmp_path / "alone.png")))
    np.testing.assert_array_equal(rendered, expected)
    assert expected[..., :3][expected[..., 3] > 0.9].std() > 0.1


@pytest.mark.parametrize("placement", ["PROJECTION", "WINDOW"])
def test_cycles_shows_the_picture(with_field, scene, tmp_path, placement):
    scene.rosy.look.shading = 0.0
    scene.rosy.placement = placement
    bpy.ops.rosy.bake()
    (image,) = baked_images()
    picture = pixels(image)
    rendered = render(scene, tmp_path)
    inside = (picture[..., 3] > 0.99) & (rendered[..., 3] > 0.99)
    assert inside.mean() > 0.05
    assert (inside != (picture[..., 3] > 0.5)).mean() < 0.01
    assert np.abs(rendered - picture)[..., :3][inside].mean() < 0.02


def test_a_relit_picture_is_the_picture_of_any_tone(scene, tmp_path):
    """The material draws from thresholds what the bake draws at the same tone."""
    bpy.ops.mesh.primitive_plane_add(size=8.0, rotation=(np.pi / 2, 0.0, 0.0))
    plane = bpy.context.object
    bpy.ops.rosy.field_generate(kind="axis", degree=4, axis=(1.0, 0.0, 0.3))
    scene.view_settings.view_transform = "Standard"
    scene.camera.data.type, scene.camera.data.ortho_scale = "ORTHO", 8.0
    scene.camera.location, scene.camera.rotation_euler = (0.0, -5.0, 0.0), (np.pi / 2, 0.0, 0.0)
    for preset in ("engraving", "cross-hatch"):
        bpy.ops.rosy.preset_apply(preset=preset)
        scene.rosy.look.shading, scene.rosy.look.light = 1.0, "headlight"
        scene.rosy.look.tone_gamma = 1.0
        scene.rosy.relight = True
        assert bpy.ops.rosy.bake() == {"FINISHED"}
        nodes = material_of(plane).node_tree.nodes
        node = next(node for node in nodes if node.bl_idname == "ShaderNodeGroup")
        node.id_data.links.remove(node.inputs["Tone"].links[0])
        node.inputs["Tone"].default_value = 1.0  # the light of the headlight
        relit = {}
        for white in (1.25, 2.0, 4.0):
            node.inputs["White"].default_value = white
            relit[white] = render(scene, tmp_path)[..., :3].mean(axis=2)
        scene.rosy.relight = False
        for white, drawn in relit.items():
            scene.rosy.look.tone_white = white
            bpy.ops.rosy.bake()
            expected = render(scene, tmp_path)[..., :3].mean(axis=2)
            assert abs(drawn.mean() - expected.mean()) < 0.02, (preset, white)
            assert np.corrcoef(drawn.ravel(), expected.ravel())[0, 1] > 0.92, (preset, white)
    assert bpy.ops.rosy.remove() == {"FINISHED"}
    assert not bpy.data.node_groups and not bpy.data.materials and not baked_images()


@pytest.mark.parametrize("previous", ["another picture", "no picture"])
def test_undo(with_field, scene, previous):
    """Undo restores the file as it was before the bake, with all pixels; redo restores the bake."""
    if previous == "another picture":
        scene.rosy.look.seed = 1
        bpy.ops.rosy.bake()
    before = contents()
    first = [pixels(image) for image in baked_images()]
    bpy.ops.ed.undo_push(message="before")
    bpy.context.scene.rosy.look.seed = 2
    bpy.ops.rosy.bake()
    after = contents()
    second = [pixels(image) for image in baked_images()]
    bpy.ops.ed.undo_push(message="after")
    bpy.ops.ed.undo()
    assert contents() == before
    assert len(baked_images()) == len(first)
    for image, picture in zip(baked_images(), first, strict=True):
        np.testing.assert_array_equal(pixels(image), picture)
    bpy.ops.ed.redo()
    assert contents() == after
    for image, picture in zip(baked_images(), second, strict=True):
        np.testing.assert_array_equal(pixels(image), picture)


def test_bake_animation(with_field, tmp_path):
    scene = bpy.context.scene
    for frame, x in ((1, -0.4), (4, 0.4)):
        with_field.location.x = x
        with_field.keyframe_insert("location", frame=frame)
    scene.frame_start, scene.frame_end = 1, 4
    scene.rosy.directory = str(tmp_path)
    scene.frame_set(2)
    assert bpy.ops.rosy.bake_animation() == {"FINISHED"}
    names = sorted(path.name for path in tmp_path.glob("*.png"))
    assert names == [f"RoSy_Scene_{frame:04d}.png" for frame in (1, 2, 3, 4)]
    assert scene.frame_current == 2
    times = [path.stat().st_mtime_ns for path in sorted(tmp_path.glob("*.png"))]
    assert bpy.ops.rosy.bake_animation(first=2, last=3) == {"FINISHED"}
    assert times == [path.stat().st_mtime_ns for path in sorted(tmp_path.glob("*.png"))]
    (record,) = scene.rosy.bakes
    assert record.frames == "2 to 3" and record.image.source == "SEQUENCE"
    assert bpy.ops.rosy.remove() == {"FINISHED"}
    assert len(list(tmp_path.glob("*.png"))) == 4


def test_turntable(with_field, tmp_path):
    for kind in (".gif", ".mp4"):
        path = tmp_path / f"film{kind}"
        result = bpy.ops.rosy.turntable(
            filepath=str(path), film=kind, pictures=4, width=48, height=32
        )
        assert result == {"FINISHED"} and path.stat().st_size > 500
    clip = bpy.data.movieclips.load(str(tmp_path / "film.mp4"))
    assert clip.frame_duration == 4
    assert len(bpy.data.scenes) == 1
