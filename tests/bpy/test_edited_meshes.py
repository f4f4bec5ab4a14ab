"""Fields on meshes that were turned, joined, edited, or had modifiers applied, since they were made."""

import bpy
import numpy as np
import pytest
from objects import (
    add_field,
    add_monkey,
    add_plane,
    aim,
    apply_modifiers,
    select_only,
    set_attribute,
)
from rosy.rosy_addon.jobs.bake import bake
from rosy.rosy_addon.scene.mesh_fields import read_mesh_field, write_mesh_field
from rosy.rosy_addon.scene.scene_reader import SceneReader
from scenes import assert_same_directions, expect_error, member_vectors, projected, read_live

#: Turned about all axes, so that no symmetry of the objects hides a mistake.
ANGLES = (0.5, -0.3, 1.1)


def live_instances():
    reader = SceneReader()
    return [entry.instance for entry in read_live(reader)], reader.errors


def apply_transform(obj):
    select_only(obj)
    bpy.ops.object.transform_apply(location=True, rotation=True, scale=True)


@pytest.mark.parametrize("form", ["VECTOR", "DIRECTIONS", "ANGLE"])
def test_applied_transforms(scene, camera, monkey, form):
    write_mesh_field(monkey.data, read_mesh_field(monkey.data), "field", form)
    monkey.data.attributes.remove(monkey.data.attributes["rosy"])
    monkey.rotation_euler, monkey.scale = ANGLES, (0.7, 0.7, 0.7)
    monkey.location = (0.2, 0.0, -0.1)
    before = projected(camera)
    apply_transform(monkey)
    after = projected(camera)
    assert_same_directions(before, after, degrees=0.1)
    instances, errors = live_instances()
    assert not errors
    assert_same_directions(after, projected(camera, instances), degrees=1e-3)


def test_joined_objects(scene, camera, monkey):
    other = add_field(add_monkey((0.9, 0.3, 0.4)))
    other.rotation_euler, other.scale = ANGLES, (0.6, 0.6, 0.6)
    before = projected(camera)
    select_only(monkey, other)
    bpy.ops.object.join()
    assert_same_directions(before, projected(camera), degrees=0.1)


@pytest.mark.parametrize("modifiers", [["MIRROR", "SUBSURF"], ["SIMPLE_DEFORM"], ["ARRAY"]])
def test_applied_modifiers(scene, camera, monkey, modifiers):
    for kind in modifiers:
        modifier = monkey.modifiers.new(kind, kind)
        if kind == "MIRROR":
            modifier.use_axis = (False, True, False)
            monkey.location.z = -0.5
        if kind == "SIMPLE_DEFORM":
            modifier.angle = 0.5
    aim(camera, (-3.0, -5.0, 2.0))
    before = projected(camera)
    apply_modifiers(monkey)
    assert not monkey.modifiers
    # The twist and the smoothing also shear the faces, which only the modifiers themselves show.
    assert_same_directions(before, projected(camera), degrees=3.0, percentile=90)
    monkey.rotation_euler = ANGLES
    before = projected(camera)
    apply_transform(monkey)
    assert_same_directions(before, projected(camera), degrees=0.1)


def test_faces_that_are_turned_in_edit_mode(scene, camera, monkey):
    before = projected(camera)
    select_only(monkey)
    bpy.ops.object.mode_set(mode="EDIT")
    bpy.ops.mesh.select_all(action="SELECT")
    bpy.ops.transform.rotate(value=0.4, orient_axis="Y")
    in_edit_mode = projected(camera)
    in_edit_mode_live = projected(camera, live_instances()[0])
    bpy.ops.object.mode_set(mode="OBJECT")
    after = projected(camera)
    assert_same_directions(after, in_edit_mode, degrees=1e-3)
    assert_same_directions(after, in_edit_mode_live, degrees=1e-3)
    assert len(np.setdiff1d(before.pixel, after.pixel))  # the mesh did turn


def test_vectors_that_were_stored_later_are_not_turned(scene):
    """A script turns a plane within itself, and then stores vectors for it as it is now."""
    plane = add_field(add_plane(), kind="axis", degree=1, axis=(1.0, 0.0, 0.0))
    plane.rotation_euler = (0.0, 0.5, 0.0)
    apply_transform(plane)
    turned = read_mesh_field(plane.data).vectors
    np.testing.assert_allclose(turned, [[np.cos(0.5), 0, -np.sin(0.5)]], atol=1e-6)
    set_attribute(plane.data, [[0.0, 0.0, 1.0]])
    np.testing.assert_allclose(read_mesh_field(plane.data).vectors, [[0, 0, 1]], atol=1e-6)


def test_an_unchanged_mesh_reads_what_was_stored(scene, monkey):
    stored = member_vectors(monkey.data)
    np.testing.assert_array_equal(read_mesh_field(monkey.data).vectors.astype("f4"), stored)
    hidden = [a.name for a in monkey.data.attributes if a.name.startswith(".rosy")]
    assert hidden == [".rosy_rest", ".rosy_check"]


@pytest.mark.parametrize("index", [0, 1])
@pytest.mark.parametrize("change", ["remove", "convert"])
def test_a_field_without_its_rest_shape_is_read_as_it_is(scene, monkey, index, change):
    mesh, stored = monkey.data, member_vectors(monkey.data)
    name = (".rosy_rest", ".rosy_check")[index]
    mesh.attributes.remove(mesh.attributes[name])
    if change == "convert":
        mesh.attributes.new(name, "FLOAT_COLOR", ("POINT", "FACE")[index])
    monkey.location.x = 1.0
    apply_transform(monkey)
    np.testing.assert_array_equal(read_mesh_field(mesh).vectors.astype("f4"), stored)


@pytest.fixture
def broken(scene, monkey):
    """A monkey whose field has lost its frame, and cannot be repaired, beside a good one."""
    other = add_monkey((2.5, 0.0, 0.0))
    other.name = "Broken"
    vectors = np.roll(member_vectors(add_field(other).data), 1, axis=1)
    for name in [a.name for a in other.data.attributes if "rosy" in a.name]:
        other.data.attributes.remove(other.data.attributes[name])
    set_attribute(other.data, vectors)
    return other


def test_one_bad_object_is_left_out_by_name(scene, camera, monkey, broken):
    (result,) = bake(scene)
    assert result.objects == (monkey,)
    (warning,) = (text for text in result.warnings if "Broken" in text)
    assert "object 'Broken'" in warning and "left out" in warning and "again" in warning
    instances, errors = live_instances()
    assert [instance.field is not None for instance in instances] == [True, False]
    assert list(errors) == ["Broken"]
    assert str(errors["Broken"]) in warning


def test_a_bad_object_that_was_asked_for_is_an_error(scene, camera, monkey, broken):
    expect_error(r"'Broken'.*not tangent", bake, scene, objects=[monkey, broken])
    monkey.rosy.include = False
    expect_error(r"'Broken'.*not tangent", bake, scene)
