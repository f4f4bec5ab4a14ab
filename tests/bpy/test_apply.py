"""Pictures on objects: applied, replaced, recorded and removed, as a whole or not at all."""

from unittest.mock import Mock

import bpy
import numpy as np
import pytest
from objects import add_camera, add_field, add_monkey, link
from rosy.rosy_addon.compositor.look import Look
from rosy.rosy_addon.core.cache import BAKE_CACHE
from rosy.rosy_addon.core.color import to_display
from rosy.rosy_addon.core.errors import RosyError
from rosy.rosy_addon.jobs.bake import bake
from rosy.rosy_addon.scene import pictures as pictures_room
from rosy.rosy_addon.scene.bake_records import has_pictures, list_bakes, remove_bakes
from rosy.rosy_addon.scene.cameras import scene_cameras
from rosy.rosy_addon.scene.pictures import show_bake
from scenes import contents, depsgraph, each_step, expect_error, pixels, reopen


def material_of(obj):
    """Return the material of all faces of an evaluated object."""
    evaluated = obj.evaluated_get(depsgraph())
    mesh = evaluated.to_mesh()
    materials = {mesh.materials[face.material_index] for face in mesh.polygons}
    evaluated.to_mesh_clear()
    (material,) = materials
    return material.original if material else None


@pytest.mark.parametrize("store", ["PACKED", "SAVED"])
def test_bakes_survive_saving(scene, camera, monkey, tmp_path, monkeypatch, store):
    """Folders are relative to the working directory, also if the .blend file is saved elsewhere."""
    monkeypatch.chdir(tmp_path)
    scene.rosy.store, scene.rosy.directory = store, "pictures"
    (baked,) = bake(scene)
    before = pixels(baked.image)
    (tmp_path / "files").mkdir()
    scene = reopen(tmp_path / "files/scene.blend")
    np.testing.assert_array_equal(pixels(bpy.data.images["RoSy Camera"]), before)
    assert [(bake.camera, bake.stale_reason) for bake in list_bakes(scene)] == [("Camera", "")]
    assert material_of(bpy.data.objects["Suzanne"]).name == "RoSy Camera"


@pytest.mark.parametrize("store", ["PACKED", "SAVED"])
@pytest.mark.parametrize(("image_format", "suffix"), [("BYTE", ".png"), ("FLOAT", ".exr")])
def test_the_image_holds_the_picture(scene, camera, monkey, tmp_path, store, image_format, suffix):
    scene.rosy.store, scene.rosy.directory = store, str(tmp_path)
    scene.rosy.image_format = image_format
    (baked,) = bake(scene)
    image, rgba = baked.image, baked.picture.rgba
    assert (image.name, tuple(image.size)) == ("RoSy Camera", (128, 128))
    assert (image.packed_file is None) == (store == "SAVED")
    files = [path.suffix for path in tmp_path.iterdir()]
    assert files == ([suffix] if store == "SAVED" else [])
    covered = rgba[..., 3] > 0
    np.testing.assert_array_equal(pixels(image)[..., 3] > 0, covered)
    stored, expected = pixels(image)[covered][:, :3], rgba[covered][:, :3]
    if image_format == "BYTE":
        np.testing.assert_allclose(stored, to_display(expected), atol=0.5 / 255 + 1e-6)
    else:
        np.testing.assert_allclose(stored, expected, atol=1e-3)
    bake(scene)
    assert len(list(tmp_path.iterdir())) == len(files)


def test_the_users_materials_and_modifiers_stay(scene, camera, monkey):
    user_material = bpy.data.materials.new("Own")
    monkey.data.materials.append(user_material)
    monkey.modifiers.new("Subdivision", "SUBSURF")
    other = link(bpy.data.objects.new("Other", monkey.data))
    other.rosy.include = False
    (baked,) = bake(scene)
    assert [slot.material for slot in monkey.material_slots] == [user_material]
    assert [modifier.name for modifier in monkey.modifiers] == ["Subdivision", "RoSy"]
    assert material_of(monkey) == baked.material
    assert material_of(other) == user_material


def test_baking_again_replaces(scene, camera, monkey):
    bake(scene)
    before = contents()
    monkey.modifiers.new("Bevel", "BEVEL")
    first = pixels(bpy.data.images["RoSy Camera"])
    bake(scene, look=Look(seed=5))
    assert np.abs(pixels(bpy.data.images["RoSy Camera"]) - first).max() > 0.1
    assert [modifier.name for modifier in monkey.modifiers] == ["Bevel", "RoSy"]
    monkey.modifiers.remove(monkey.modifiers["Bevel"])
    assert contents() == before


def test_remove_what_lost_its_record_or_users(scene, camera, monkey):
    """The user deleted the image, the modifier or the record, or copied the object."""
    before = contents()
    (baked,) = bake(scene)
    bpy.data.images.remove(baked.image)
    assert not list_bakes(scene) and has_pictures(scene)
    remove_bakes(scene)
    assert contents() == before and not has_pictures(scene)
    bake(scene)
    scene.rosy.bakes.clear()
    assert has_pictures(scene)
    remove_bakes(scene)
    assert contents() == before
    bake(scene)
    monkey.modifiers.clear()
    remove_bakes(scene)
    assert contents() == before


def test_remove_from_a_copy_of_the_scene(scene, camera, monkey):
    (baked,) = bake(scene)
    bpy.ops.scene.new(type="FULL_COPY")
    copy = bpy.context.scene
    assert copy != scene and [info.image for info in list_bakes(copy)] == [baked.image]
    remove_bakes(copy)
    assert not has_pictures(copy)
    assert [(info.image, info.is_shown) for info in list_bakes(scene)] == [(baked.image, True)]


def test_cancelling_at_any_step_changes_nothing(scene, camera, monkey):
    monkey.modifiers.new("Subdivision", "SUBSURF")
    before = contents()
    steps = sum(1 for _ in each_step(bake.begin(scene)))
    remove_bakes(scene)
    assert steps == 2
    for stop in range(steps):
        BAKE_CACHE.clear()
        stepping = each_step(bake.begin(scene))
        for _ in range(stop + 1):
            next(stepping)
        stepping.close()
        assert contents() == before


def test_an_error_while_applying_leaves_nothing(scene, camera, monkey, monkeypatch):
    before = contents()
    monkeypatch.setattr(pictures_room, "new_group", Mock(side_effect=RosyError("no more")))
    expect_error("no more", bake, scene)
    assert contents() == before


def test_several_cameras(scene, camera, monkey):
    add_camera("Second", (3.0, -4.0, 1.0))
    first_bake, last_bake = bake(scene, cameras=scene_cameras(scene))
    assert (first_bake.camera, last_bake.camera) == ("Second", "Camera")
    assert [entry.camera for entry in list_bakes(scene)] == ["Camera", "Second"]
    assert material_of(monkey).name == "RoSy Camera"
    assert [entry.is_shown for entry in list_bakes(scene)] == [True, False]
    groups = len(bpy.data.node_groups)
    show_bake(scene, "Second")
    assert material_of(monkey).name == "RoSy Second"
    assert [entry.is_shown for entry in list_bakes(scene)] == [False, True]
    assert len(bpy.data.node_groups) == groups
    expect_error("camera 'Third', only from 'Second', 'Camera'", show_bake, scene, "Third")


def test_an_object_that_is_left_out_shows_what_it_showed_before(scene, camera, monkey):
    toon = bpy.data.materials.new("Toon")
    monkey.data.materials.append(toon)
    other, above = add_field(add_monkey(), "axis", 2), add_camera("Above", (0.0, -1.0, 5.0))
    bake(scene)
    other.rosy.include = False
    bake(scene)
    assert material_of(monkey).name == "RoSy Camera" and not other.modifiers
    monkey.rosy.include, other.rosy.include = False, True
    bake(scene)
    assert material_of(monkey) == toon and not monkey.modifiers
    monkey.rosy.include = True
    bake(scene, cameras=[camera, above])
    monkey.rosy.include = False
    bake(scene, cameras=[above])
    assert [material_of(obj).name for obj in (monkey, other)] == ["RoSy Camera", "RoSy Above"]


def test_pictures_over_materials_take_turns_with_others(scene, camera, monkey):
    add_camera("Second", (3.0, -4.0, 1.0))
    before = contents()
    scene.rosy.look.ink, scene.rosy.over_material = "hatch", True
    (result,) = bake(scene)
    (ink,) = monkey.children
    assert result.objects == (monkey,) and not monkey.modifiers
    assert material_of(ink).name == "RoSy Camera"
    assert list_bakes(scene)[0].stale_reason == ""
    bake(scene, cameras=scene_cameras(scene))
    assert monkey.children == (ink,)
    show_bake(scene, "Second")
    assert material_of(ink).name == "RoSy Second"
    scene.rosy.over_material = False
    bake(scene)
    assert not monkey.children and material_of(monkey).name == "RoSy Camera"
    scene.rosy.over_material = True
    bake(scene)
    (ink,) = monkey.children
    assert not monkey.modifiers and ink.users_collection == monkey.users_collection
    monkey.hide_viewport = True
    bpy.context.view_layer.update()
    assert ink.hide_viewport
    monkey.hide_viewport = False
    other = add_field(add_monkey(), "axis", 2)
    monkey.rosy.include = False
    bake(scene)
    assert not monkey.children and len(other.children) == 1
    remove_bakes(scene)
    bpy.data.meshes.remove(other.data)
    assert contents() == before


def test_warnings(scene, camera, monkey):
    assert bake(scene)[0].warnings == ()
    scene.view_settings.view_transform = "Filmic"
    (warning,) = bake(scene)[0].warnings
    assert "Filmic" in warning
    assert scene.view_settings.view_transform == "Filmic"


def test_a_look_argument_does_not_make_a_bake_stale(scene, camera, monkey):
    bake(scene, look=Look(seed=3))
    assert list_bakes(scene)[0].stale_reason == ""
