"""Pictures on objects: applied, replaced, recorded and removed, as a whole or not at all."""

from __future__ import annotations

import bpy
import numpy as np
import pytest
from rosy.rosy_addon.compositor.look import Look
from rosy.rosy_addon.core.cache import BAKE_CACHE
from rosy.rosy_addon.core.color import to_display
from rosy.rosy_addon.core.errors import RosyError
from rosy.rosy_addon.jobs.bake import bake
from rosy.rosy_addon.scene import pictures as pictures_room
from rosy.rosy_addon.scene.bake_records import has_pictures, list_bakes, remove_bakes
from rosy.rosy_addon.scene.cameras import scene_cameras
from rosy.rosy_addon.scene.look_properties import apply_look, read_look
from rosy.rosy_addon.scene.pictures import show_bake
from scenes import (
    add_camera,
    add_field,
    add_plane,
    contents,
    each_step,
    link,
    pixels,
    set_vectors,
)


def material_of(obj):
    """Return the material of all faces of an evaluated object."""
    evaluated = obj.evaluated_get(bpy.context.evaluated_depsgraph_get())
    mesh = evaluated.to_mesh()
    materials = {mesh.materials[face.material_index] for face in mesh.polygons}
    evaluated.to_mesh_clear()
    (material,) = materials
    return material.original if material else None


def test_the_image_holds_the_picture(scene, camera, monkey):
    (baked,) = bake(scene)
    image, rgba = baked.image, baked.picture.rgba
    assert (image.name, tuple(image.size)) == ("RoSy Camera", (128, 128))
    assert image.packed_file is not None
    covered = rgba[..., 3] > 0
    stored = pixels(image)
    np.testing.assert_allclose(
        stored[covered][:, :3], to_display(rgba[covered][:, :3]), atol=0.5 / 255 + 1e-6
    )
    np.testing.assert_array_equal(stored[..., 3] > 0, covered)


def test_bakes_survive_saving(scene, camera, monkey, tmp_path):
    (baked,) = bake(scene)
    before = pixels(baked.image)
    path = str(tmp_path / "scene.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path)
    bpy.ops.wm.open_mainfile(filepath=path)
    np.testing.assert_array_equal(pixels(bpy.data.images["RoSy Camera"]), before)
    scene = bpy.context.scene
    assert [(bake.camera, bake.stale_reason) for bake in list_bakes(scene)] == [("Camera", "")]
    assert material_of(bpy.data.objects["Suzanne"]).name == "RoSy Camera"


@pytest.mark.parametrize(("image_format", "suffix"), [("BYTE", ".png"), ("FLOAT", ".exr")])
def test_saved_to_a_folder(scene, camera, monkey, tmp_path, image_format, suffix):
    scene.rosy.store, scene.rosy.directory = "SAVED", str(tmp_path / "pictures")
    scene.rosy.image_format = image_format
    (baked,) = bake(scene)
    (path,) = (tmp_path / "pictures").iterdir()
    assert path.suffix == suffix
    assert baked.image.packed_file is None
    covered = baked.picture.rgba[..., 3] > 0
    stored = pixels(baked.image)[covered][:, :3]
    expected = baked.picture.rgba[covered][:, :3]
    if image_format == "BYTE":
        np.testing.assert_allclose(stored, to_display(expected), atol=0.5 / 255 + 1e-6)
    else:
        np.testing.assert_allclose(stored, expected, atol=1e-3)
    bake(scene)
    assert len(list((tmp_path / "pictures").iterdir())) == 1


def test_a_relative_folder_is_that_of_the_working_directory(
    scene, camera, monkey, tmp_path, monkeypatch
):
    """Also after the .blend file was saved elsewhere, which moves relative paths."""
    monkeypatch.chdir(tmp_path)
    scene.rosy.store, scene.rosy.directory = "SAVED", "pictures"
    (baked,) = bake(scene)
    expected = pixels(baked.image)
    (tmp_path / "files").mkdir()
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "files/scene.blend"))
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "files/scene.blend"))
    np.testing.assert_array_equal(pixels(bpy.data.images["RoSy Camera"]), expected)


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


def test_an_earlier_bake_does_not_change_the_next(scene, camera, monkey):
    first = bake(scene)[0].picture.rgba
    second = bake(scene)[0].picture.rgba
    np.testing.assert_array_equal(first, second)


def test_remove_leaves_no_trace(scene, camera, monkey):
    monkey.data.materials.append(bpy.data.materials.new("Own"))
    monkey.modifiers.new("Subdivision", "SUBSURF")
    other = add_field(add_plane("Other"), kind="axis")
    other.location.x = 1.0
    add_camera("Second", (3.0, -4.0, 1.0))
    before = contents()
    bake(scene, cameras=scene_cameras(scene))
    assert contents() != before
    removed = remove_bakes(scene)
    assert removed == (2, 2)
    assert contents() == before
    assert remove_bakes(scene).objects == 0


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

    def fails(*_):
        raise RosyError("no more")

    monkeypatch.setattr(pictures_room, "new_group", fails)
    with pytest.raises(RosyError, match="no more"):
        bake(scene)
    assert contents() == before


def test_several_cameras(scene, camera, monkey):
    second = add_camera("Second", (3.0, -4.0, 1.0))
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
    with pytest.raises(RosyError, match="camera 'Third', only from 'Second', 'Camera'"):
        show_bake(scene, "Third")
    assert second.name == "Second"


def change_look(scene, camera, monkey):
    scene.rosy.look.seed += 1
    return "look"


def change_camera(scene, camera, monkey):
    camera.data.lens += 5.0
    return "camera 'Camera' was changed"


def move_camera(scene, camera, monkey):
    camera.location.x += 0.1
    bpy.context.view_layer.update()
    return "camera 'Camera' was changed"


def move_object(scene, camera, monkey):
    monkey.location.x += 0.1
    bpy.context.view_layer.update()
    return "'Suzanne' was moved"


def change_field(scene, camera, monkey):
    set_vectors(monkey.data, np.zeros((len(monkey.data.polygons), 3)))
    return "mesh or field of 'Suzanne'"


def change_mesh(scene, camera, monkey):
    monkey.data.vertices[7].co.x += 0.1
    return "mesh or field of 'Suzanne'"


def change_degree(scene, camera, monkey):
    monkey.data.rosy.degree = 2
    return "mesh or field of 'Suzanne'"


def delete_object(scene, camera, monkey):
    bpy.data.objects.remove(monkey)
    return "'Suzanne' was deleted"


def delete_camera(scene, camera, monkey):
    bpy.data.objects.remove(camera)
    return "'Camera' was deleted"


@pytest.mark.parametrize(
    "change",
    [
        change_look,
        change_camera,
        move_camera,
        move_object,
        change_field,
        change_mesh,
        change_degree,
        delete_object,
        delete_camera,
    ],
)
def test_stale_reasons(scene, camera, monkey, change):
    bake(scene)
    assert list_bakes(scene)[0].stale_reason == ""
    reason = change(scene, camera, monkey)
    assert reason in list_bakes(scene)[0].stale_reason


def test_warnings(scene, camera, monkey):
    assert bake(scene)[0].warnings == ()
    scene.view_settings.view_transform = "Filmic"
    (warning,) = bake(scene)[0].warnings
    assert "Filmic" in warning
    assert scene.view_settings.view_transform == "Filmic"


def test_settings_of_a_look(scene):
    assert read_look(scene.rosy) == Look()
    look = Look(
        method="brute",
        gain=1.234,
        density=0.999,
        seed=2**31 - 1,
        hue="magnitude",
        magnitude_length=True,
    )
    apply_look(scene.rosy, look)
    assert read_look(scene.rosy) == look
    for name, setting in ((entry.name, entry.metadata["setting"]) for entry in look_fields()):
        description = scene.rosy.look.bl_rna.properties[name].description
        assert description == setting.text


def look_fields():
    from dataclasses import fields

    return fields(Look)


def test_same_scene_same_bytes(scene, camera, monkey):
    first = bytes(bake(scene)[0].image.packed_file.data)
    remove_bakes(scene)
    assert bytes(bake(scene)[0].image.packed_file.data) == first


def test_lights_of_the_scene(scene, camera, monkey):
    data = bpy.data.lights.new("Sun", "SUN")
    data.energy = 3.0
    sun = link(bpy.data.objects.new("Sun", data))
    sun.rotation_euler = (0.0, np.pi / 2, 0.0)
    look = Look(light="scene", shading=1.0)
    rgba = bake(scene, look=look)[0].picture.rgba
    columns = np.arange(rgba.shape[1])
    brightness = (rgba[..., 0] * rgba[..., 3]).sum(axis=0)
    middle = (rgba[..., 3].sum(axis=0) * columns).sum() / rgba[..., 3].sum()
    assert brightness[columns > middle].sum() > 2 * brightness[columns < middle].sum()


def test_undo_restores_the_previous_picture(scene, camera, monkey):
    bake(scene)
    first = pixels(bpy.data.images["RoSy Camera"])
    bpy.ops.ed.undo_push(message="first")
    bake(scene, look=Look(seed=3))
    second = pixels(bpy.data.images["RoSy Camera"])
    assert np.abs(first - second).max() > 0.1
    bpy.ops.ed.undo_push(message="second")
    bpy.ops.ed.undo()
    np.testing.assert_array_equal(pixels(bpy.data.images["RoSy Camera"]), first)
    bpy.ops.ed.redo()
    np.testing.assert_array_equal(pixels(bpy.data.images["RoSy Camera"]), second)


def test_a_look_argument_does_not_make_a_bake_stale(scene, camera, monkey):
    bake(scene, look=Look(seed=3))
    assert list_bakes(scene)[0].stale_reason == ""


def test_a_bake_of_a_3d_view(scene, monkey):
    """Its camera is not an object of the scene."""
    from rosy.rosy_addon.projection.camera import look_at, perspective_camera
    from rosy.rosy_addon.scene.cameras import VIEW_NAME

    view = perspective_camera(look_at((0, -5, 1), (0, 0, 0)), 80, 60, name=VIEW_NAME)
    (baked,) = bake(scene, cameras=[view])
    assert tuple(baked.image.size) == (80, 60)
    assert [(entry.camera, entry.stale_reason) for entry in list_bakes(scene)] == [("3D View", "")]
