"""Whatever users do with objects that show pictures: Remove leaves nothing of RoSy's, and all of theirs."""

import bmesh
import bpy
import numpy as np
import pytest
from objects import add_camera, add_field, add_plane, apply_modifiers, link, load, select_only
from rosy.rosy_addon.jobs.bake import bake
from rosy.rosy_addon.scene.bake_records import has_pictures, list_bakes, remove_bakes
from rosy.rosy_addon.scene.cameras import scene_cameras
from rosy.rosy_addon.scene.pictures import show_bake
from scenes import contents, empty_scene, reopen
from test_up_to_date import deferred, exclude, obj


def build(folder=None):
    """Build a scene of two meshes with fields, materials and modifiers, and two cameras."""
    scene = empty_scene(24)
    scene.camera = add_camera("Camera", (0.0, -5.0, 0.5))
    add_camera("Second", (3.0, -4.0, 1.0))
    own = [bpy.data.materials.new(name) for name in ("Own", "Other")]
    for name, x in (("Sheet", -0.7), ("Plain", 0.7)):
        obj = add_field(add_plane(name, size=0.6, cuts=2), kind="axis")
        obj.location.x = x
        for material in own:
            obj.data.materials.append(material)
        obj.data.attributes.new("mine", "FLOAT", "FACE")
        obj.data.polygons[1].material_index = 1
    bpy.data.objects["Sheet"].modifiers.new("Solid", "SOLIDIFY")
    image = bpy.data.images.new("Painting", 4, 4)
    image.use_fake_user = True
    bpy.context.view_layer.update()
    return scene


@deferred
def selected(tmp_path, operator, *names):
    """An action: call an operator for some objects."""
    select_only(*map(obj, names))
    operator()


def rename(tmp_path):
    for name in ("Sheet", "Plain", "Camera"):
        obj(name).data.name, obj(name).name = f"My {name} Data", f"My {name}"
    bpy.context.scene.name = "Shot"


@deferred
def apply(tmp_path, *names):
    for name in names:
        apply_modifiers(obj(name))


@deferred
def apply_and(tmp_path, action):
    apply("Sheet", "Plain")(tmp_path)
    action(tmp_path)


def unlink(tmp_path):
    obj("Plain").use_fake_user = True
    bpy.context.scene.collection.objects.unlink(obj("Plain"))


def copy_modifier(tmp_path):
    other = link(add_plane("Copy").copy())
    other.modifiers.new("Picture", "NODES").node_group = obj("Plain").modifiers[-1].node_group


def save_and_open(tmp_path):
    reopen(tmp_path / "scene.blend")


def bake_with_another_camera(tmp_path):
    bpy.context.scene.camera = obj("Second")
    bake(bpy.context.scene)


FUNCTIONS = rename, unlink, copy_modifier, save_and_open, bake_with_another_camera
ACTIONS = {function.__name__: function for function in FUNCTIONS}
ACTIONS |= {
    "nothing": lambda _: None,
    "duplicate": selected(bpy.ops.object.duplicate, "Plain", "Sheet"),
    "join": selected(bpy.ops.object.join, "Sheet", "Plain"),
    "delete": selected(bpy.ops.object.delete, "Plain"),
    "delete_camera": selected(bpy.ops.object.delete, "Second"),
}
ACTIONS |= {f"apply and {name}": apply_and(ACTIONS[name]) for name in ("duplicate", "join")}
ACTIONS["apply and edit"] = apply_and(lambda _: bpy.ops.object.mode_set(mode="EDIT"))
ACTIONS["apply and bake again"] = apply_and(lambda _: bake(bpy.context.scene))
ACTIONS |= {"apply": apply("Sheet", "Plain"), "apply one": apply("Plain")}
ACTIONS["exclude"] = lambda _: exclude("Plain")(bpy.context.scene)

#: Actions on the modifiers of the user, or on RoSy's alone, without a picture.
NEEDS_PICTURE = ("copy_modifier", "apply and bake again", "bake_with_another_camera")


def user_contents():
    """Return the contents of the file, and the material of each face."""
    if bpy.context.mode != "OBJECT":
        bpy.ops.object.mode_set(mode="OBJECT")
    indices = {m.name: [face.material_index for face in m.polygons] for m in bpy.data.meshes}
    return contents() | indices


@pytest.mark.parametrize(
    ("name", "store"),
    [*((name, "PACKED") for name in ACTIONS), ("nothing", "SAVED"), ("save_and_open", "SAVED")],
)
def test_remove_leaves_what_the_user_has_made(name, store, tmp_path):
    """The file is as if the same had been done to it without a picture."""
    action = ACTIONS[name]
    build()
    if name not in NEEDS_PICTURE:
        action(tmp_path)
    elif name == "copy_modifier":
        link(add_plane("Copy").copy())
    elif name == "apply and bake again":
        ACTIONS["apply"](tmp_path)
    expected = user_contents()
    scene = build()
    scene.rosy.store, scene.rosy.directory = store, str(tmp_path / "pictures")
    bake(scene, cameras=scene_cameras(scene))
    action(tmp_path)
    scene = bpy.context.scene
    assert has_pictures(scene)
    remove_bakes(scene)
    assert user_contents() == expected
    assert not has_pictures(scene) and not list_bakes(scene)


@pytest.mark.parametrize("applied", [False, True], ids=["modifier", "applied"])
def test_an_appended_object(applied, tmp_path):
    """It brings its picture, which the panel lists and Remove removes."""
    path = baked_file(tmp_path, *(["Plain"] if applied else []))
    scene = build()
    bake(scene)
    link(load(path, "Plain"))
    appended = obj("Plain.001")
    infos = list_bakes(scene)
    assert [(info.width, info.height, info.is_shown) for info in infos] == [(24, 24, True)] * 2
    assert [info.camera for info in infos if info.unknown_reason] == ["Camera.001"]
    assert len({info.image for info in infos}) == 2
    remove_bakes(scene)
    assert not list_bakes(scene) and not has_pictures(scene)
    assert [material.name[:5] for material in appended.data.materials] == ["Own.0", "Other"]
    assert not bpy.data.node_groups
    assert [image.name for image in bpy.data.images] == ["Painting"]
    assert {material.name[:3] for material in bpy.data.materials} == {"Own", "Oth"}


def baked_file(tmp_path, *applied):
    """Return the path of a .blend file with pictures, which are applied to the objects of these names."""
    bake(build())
    apply(*applied)(tmp_path)
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "baked.blend"))
    return tmp_path / "baked.blend"


def test_an_appended_object_takes_part_in_the_next_bake(tmp_path):
    path = baked_file(tmp_path)
    scene = build()
    link(load(path, "Plain"))
    (info,) = list_bakes(scene)
    assert info.unknown_reason == "baked in another file or scene"
    bake(scene)
    assert [(info.camera, info.unknown_reason) for info in list_bakes(scene)] == [("Camera", "")]
    assert len([image for image in bpy.data.images if image.get("rosy_made")]) == 1


def test_a_camera_that_is_still_in_use_stays():
    """Blender does not count the camera of a scene, nor the target of a constraint, as a user."""
    scene = build()
    bake(scene, cameras=scene_cameras(scene))
    first, second = obj("Camera"), obj("Second")
    for camera in (first, second):
        scene.collection.objects.unlink(camera)
    scene.camera = first
    remove_bakes(scene)
    assert scene.camera == first
    assert "Second" not in bpy.data.objects


def test_a_linked_object_is_left_alone(tmp_path):
    path = baked_file(tmp_path)
    scene = build()
    link(load(path, "Plain", link=True))
    before = contents()
    assert not has_pictures(scene) and not list_bakes(scene)
    remove_bakes(scene)
    assert contents() == before


def test_an_override_shows_the_picture_of_its_library_again(tmp_path):
    path = baked_file(tmp_path)
    scene = empty_scene(24)
    scene.camera = add_camera()
    link(load(path, "Plain", link=True))
    override = obj("Plain").override_create(remap_local_usages=True)
    group = override.modifiers["RoSy"].node_group
    before = contents()
    assert not has_pictures(scene)
    bake(scene)
    assert override.modifiers["RoSy"].node_group != group
    show_bake(scene, "Camera")
    remove_bakes(scene)
    assert override.modifiers["RoSy"].node_group == group
    assert contents() == before and not has_pictures(scene)


@pytest.mark.parametrize("name", ["rosy_material", "rosy_projection"])
def test_attributes_of_the_user_with_the_same_name_stay(name, tmp_path):
    """Only an attribute of RoSy's type and domain comes from its modifier."""
    scene = build()
    bake(scene)
    apply("Plain")(tmp_path)
    for other in ("Plain", "Sheet"):
        attributes = obj(other).data.attributes
        if name in attributes:
            attributes.remove(attributes[name])
        attributes.new(name, "FLOAT_VECTOR", "FACE")
    remove_bakes(scene)
    for other in ("Plain", "Sheet"):
        names = [attribute.name for attribute in obj(other).data.attributes]
        assert [found for found in names if found.startswith("rosy_")] == [name]


def test_the_other_of_two_attributes_with_one_name_stays(tmp_path):
    """Blender 4.2 and 4.3 allow two in different domains, and may remove the one that was not asked for."""
    scene = build()
    bake(scene)
    apply("Plain")(tmp_path)
    mesh = obj("Plain").data
    edited = bmesh.new()
    edited.from_mesh(mesh)
    edited.loops.layers.int.new("rosy_projection")
    edited.to_mesh(mesh)
    edited.free()
    names = [attribute.name for attribute in mesh.attributes]
    remove_bakes(scene)
    if names.count("rosy_projection") == 2:
        kinds = {(attribute.name, attribute.domain) for attribute in mesh.attributes}
        assert ("rosy_projection", "CORNER") in kinds


def test_objects_without_materials_have_no_slots_afterwards(tmp_path):
    """Blender crashes if an object with more slots than its mesh has materials is joined."""
    scene = build()
    obj("Plain").data.materials.clear()
    bake(scene)
    apply("Plain")(tmp_path)
    copied = link(obj("Plain").copy())
    remove_bakes(scene)
    for other in (obj("Plain"), copied):
        assert len(other.material_slots) == len(other.data.materials) == 0


def test_materials_of_strokes_stay(tmp_path):
    """A mesh of the user's may have the ink of strokes that were converted."""
    scene = build()
    ink = bpy.data.materials.new("RoSy Ink")
    ink["rosy_made"] = True
    obj("Plain").data.materials.append(ink)
    bake(scene)
    remove_bakes(scene)
    names = [material.name for material in obj("Plain").data.materials]
    assert names == ["Own", "Other", "RoSy Ink"]


def test_a_duplicate_shows_the_picture_of_another_camera(tmp_path):
    scene = build()
    bake(scene, cameras=scene_cameras(scene))
    rename(tmp_path)
    select_only(obj("My Plain"))
    bpy.ops.object.duplicate()
    show_bake(scene, "Second")
    shown = {info.camera: info.is_shown for info in list_bakes(scene)}
    assert shown == {"Second": True, "My Camera": False}
    matrices = {
        np.round(tuple(modifier.node_group.rosy.projections[0].matrix), 4).tobytes()
        for name in ("My Plain", "My Plain.001", "My Sheet")
        for modifier in obj(name).modifiers
        if modifier.name == "RoSy"
    }
    assert len(matrices) == 2 and len(bpy.data.node_groups) == 3
